"""Complete ensemble empirical mode decomposition with adaptive noise: the improved and the classic variant."""

from __future__ import annotations

import os
from concurrent.futures import ThreadPoolExecutor
from functools import partial
from typing import TYPE_CHECKING, Literal, get_args

import numpy as np

from testbed.compensation.emd import check_count, checked_signal, first_mode, while_modes_are_left
from testbed.errors import quoted
from testbed.signals import random_stream

if TYPE_CHECKING:
    from testbed.signals import FloatArray

Variant = Literal["improved", "classic"]
# Trials that one thread sums up: fixed, so that the order of every sum is the same for any number of threads.
CHUNK = 5


def ceemdan(
    signal: FloatArray,
    *,
    variant: Variant = "improved",
    trials: int = 100,
    noise: float = 0.2,
    sifts: int = 10,
    seed: int = 0,
    threads: int | None = None,
) -> FloatArray:
    r"""Decompose a record into modes with the help of added noise, fastest first: :math:`x = \sum_k d_k + r`.

    With M the local mean, E_k the k-th mode by `emd`, w_i white noise of unit variance and :math:`r_0 = x`, the
    improved variant [1]_ is

    .. math:: r_k = \langle M(r_{k-1} + \beta_{k-1} E_k(w_i)) \rangle, \quad d_k = r_{k-1} - r_k,
        \quad \beta_k = \epsilon\,\sigma(r_k)

    with :math:`E_1(w_i)` divided by its standard deviation; the classic one [2]_ (equations 1-6 of [3]_) is

    .. math:: d_k = \langle E_1(r_{k-1} + \beta_{k-1} E_{k-1}(w_i)) \rangle, \quad r_k = r_{k-1} - d_k,
        \quad E_0(w) = w .

    A noise that has no mode left adds nothing. The end is that of `emd`. Each trial has a random stream of its own; the
    result has the same bits for any number of threads.

    Parameters
    ----------
    signal : ndarray, shape (n_time,)
        Equally spaced samples, any unit.
    variant : {"improved", "classic"}
        Colominas 2014 or Torres 2011.
    trials : int
        Realisations of the added noise [-]; 8 n_time bytes each.
    noise : float
        epsilon, standard deviation of the added noise over that of what is being decomposed [-]; 0 is plain `emd`.
    sifts : int
        Sifts per mode [-].
    seed : int
        Seed of the added noise.
    threads : int, optional
        Threads to use; all processors unless told.

    Returns
    -------
    ndarray, shape (n_mode + 1, n_time)
        Modes, then the residual; the unit of `signal`.

    Raises
    ------
    ValueError
        If the signal is empty, not one-dimensional or not finite, a count is below one, the noise negative or the
        variant unknown.

    References
    ----------
    .. [1] Colominas, Schlotthauer, Torres, Biomed. Signal Process. Control 14, 2014, 19-29.
    .. [2] Torres, Colominas, Schlotthauer, Flandrin, ICASSP 2011, 4144-4147.
    .. [3] Wang, Cui, Cao, Micromachines 14, 2023, 1712.
    """
    residual = checked_signal(signal)
    workers = (os.cpu_count() or 1) if threads is None else threads
    _check(variant, noise, trials=trials, sifts=sifts, threads=workers)
    whites = np.empty((trials, residual.size))
    chunks = [whites[start : start + CHUNK] for start in range(0, trials, CHUNK)]
    modes: list[FloatArray] = []
    with ThreadPoolExecutor(workers) as pool:
        list(pool.map(lambda i: random_stream(seed, "ceemdan", str(i)).standard_normal(out=whites[i]), range(trials)))
        for _ in while_modes_are_left(residual, sifts):
            before, amplitude = residual.copy(), noise * residual.std()
            parts = pool.map(partial(_sum_of_rest, before, amplitude, variant, len(modes), sifts), chunks)
            residual[:] = sum(parts) / trials
            modes.append(before - residual)
    return np.stack([*modes, residual])


def _sum_of_rest(
    signal: FloatArray, amplitude: float, variant: Variant, stage: int, sifts: int, whites: FloatArray
) -> FloatArray:
    """Return the sum over trials of what one more mode leaves of the signal; takes the noise's own mode out of
    `whites`.
    """
    total = np.zeros(signal.size)
    for white in whites:
        added = amplitude * _noise_mode(white, variant, stage, sifts)
        noisy = signal + added
        total += noisy - first_mode(noisy, sifts)
        # The classic variant averages modes: the added noise stays in them.
        if variant == "classic":
            total -= added
    return total


def _noise_mode(white: FloatArray, variant: Variant, stage: int, sifts: int) -> FloatArray:
    """Return the part of the noise that this stage adds, and take it out of `white`: modes are made when they are
    needed.
    """
    if variant == "classic" and stage == 0:
        return white
    mode: FloatArray = first_mode(white, sifts)
    white -= mode
    return mode / mode.std() if stage == 0 and mode.any() else mode


def _check(variant: str, noise: float, **counts: int) -> None:
    """Refuse what cannot be decomposed with."""
    for name, value in counts.items():
        check_count(name, value)
    if not 0.0 <= noise < np.inf:
        msg = f"noise: expected a finite ratio of at least 0, got {noise}"
        raise ValueError(msg)
    if variant not in get_args(Variant):
        msg = f"variant: expected one of {', '.join(get_args(Variant))}, got {quoted(variant)}"
        raise ValueError(msg)
