"""Adaptive Kalman filter of a level, its gain by a randomly weighted mean of squared innovations: paper 3's reference
22.
"""

# mypy: disable-error-code="no-untyped-def, misc"

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np
from numba import njit

from testbed.compensation.fading import choose_ratio, fading_memory, steady_gain
from testbed.compensation.record import checked
from testbed.signals import random_stream

if TYPE_CHECKING:
    from testbed.signals import FloatArray

# Sets of weights, taken in turn; a prime, so that no set meets the same place of a window again and again.
_SETS = 997


@njit(cache=True)
def _adaptive(z, weights, Q, R, short, limit, estimate):  # pragma: no cover
    """Fill the estimates; `weights`, shape (n_set, window), rows of sum one, newest first."""
    window = weights.shape[1]
    squares = np.full(window, R)
    recent = np.zeros(short)
    level, P = z[0], R
    for k in range(z.size):
        prior = P + Q
        innovation = z[k] - level
        squares[k % window] = innovation * innovation
        recent[k % short] = innovation
        expected = 0.0
        for j in range(window):
            expected += weights[k % weights.shape[0], j] * squares[(k - j) % window]
        moved = recent.sum() / short
        if k >= short and moved * moved * short > limit * limit * (prior + R):
            # A discontinuity: what is predicted is as uncertain as the readings lately were off, R apart.
            prior = max(prior, moved * moved)
        gain = min(prior / max(expected, prior), 1.0)
        level += gain * innovation
        P = (1.0 - gain) * prior
        estimate[k] = level


def random_weighting(
    z: FloatArray, *, window: int = 50, short: int = 10, limit: float = 4.0, seed: int = 0
) -> FloatArray:
    r"""Filter a record with a gain that follows the innovations.

    A random walk seen in white noise, with Q and R of the largest likelihood over the record. The covariance of the
    innovation is a random-weighted mean over a window, and the gain is

    .. math:: K = P^- / \hat C, \quad \hat C_k = \sum_{j < N} \lambda_j e_{k-j}^2, \quad
        \lambda \sim \mathrm{Dirichlet}(1, \ldots, 1);

    where the moving average of the last innovations is further from zero than `limit` of its own deviations, a
    discontinuity, P^- is raised to its square so that the filter follows.

    Parameters
    ----------
    z : ndarray, shape (n_time,)
        Samples, any unit, not constant.
    window : int
        N [-].
    short : int
        Innovations of the moving average [-].
    limit : float
        In standard deviations [-].
    seed : int
        Of the weights.

    Returns
    -------
    ndarray, shape (n_time,)
        Level after each sample, unit of `z`.

    Raises
    ------
    ValueError
        If a sample is not finite or a number not positive.

    References
    ----------
    Yang, Liu, Li, Song, Sensors 15 (2015) 26940-26960 ("AMA-RWE-DFAKF"): both factors as its abstract has them; order
    of the model, window and limit are ours.
    """
    samples = checked("z", z)
    if not (window >= 1 and short >= 1 and 0.0 < limit < math.inf):
        msg = f"window, short, limit: expected positive numbers, got {window}, {short} and {limit}"
        raise ValueError(msg)
    ratio = choose_ratio(samples)
    gain = steady_gain(1.0, ratio)
    # The innovation of the settled filter has the variance R (1 + p), 1 + p = 1 / (1 - K).
    R = float(np.mean(fading_memory(samples, 1.0, ratio)[1] ** 2)) * (1.0 - gain)
    draws = random_stream(seed, "random weighting").standard_exponential((_SETS, window))
    estimate = np.empty(samples.size)
    _adaptive(samples, draws / draws.sum(axis=1, keepdims=True), ratio * R, R, short, limit, estimate)
    return estimate
