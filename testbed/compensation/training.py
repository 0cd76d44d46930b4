"""Rows for training: block means of several cycles, their contiguous folds, and the fits with their blocked
cross-validation.
"""

from __future__ import annotations

import itertools
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from testbed.compensation import lssvm, polynomial
from testbed.compensation.features import Scaling
from testbed.compensation.flicker import whiten
from testbed.compensation.lssvm import Lssvm
from testbed.compensation.polynomial import Polynomial
from testbed.compensation.search import evolve

if TYPE_CHECKING:
    from collections.abc import Sequence

    from testbed.compensation.features import Features
    from testbed.compensation.record import GyroRecord
    from testbed.signals import FloatArray

# Rows are means over at least this time [s], and longer for a machine whose cost is cubic.
_AVERAGE = 100.0
MOST_SUPPORT = 300
# Standardised features: a kernel narrower than half a standard deviation learns time, one wider than a thousand is
# flat.
_GAMMAS, _WIDTHS2 = (1e-2, 1e6), (0.3, 1e6)
# Smaller ones change nothing but let a cycle that leaves a feature undetermined do so.
_PENALTIES = np.geomspace(1e-5, 1.0, 23)
# Where 1/f and white noise of paper 3's gyro are equal, B^2 / (2 pi N^2) [Hz].
_CORNER = 0.017


@dataclass(frozen=True)
class TrainingRows:
    """Training rows.

    Parameters
    ----------
    Z : ndarray, shape (n_row, n_feature)
        Standardised features [-].
    y : ndarray, shape (n_row,)
        Rate without the mean of all rows [rad/s].
    mean_rate : float
        That mean [rad/s].
    scaling : Scaling
        From features to Z.
    folds : list of slice
        Contiguous rows of one cycle each.
    cycles : list of slice
        Rows of each cycle.
    average : float
        Time that a row is the mean of [s].
    n_play : int
        How many of the features are play operators; they are the last.
    """

    Z: FloatArray
    y: FloatArray
    mean_rate: float
    scaling: Scaling
    folds: list[slice]
    cycles: list[slice]
    average: float
    n_play: int


def gather(cycles: Sequence[GyroRecord], features: Features, *, block: float, most: int | None = None) -> TrainingRows:
    """Form rows from cycles: features at full rate, then means over whole blocks.

    Parameters
    ----------
    cycles : sequence of GyroRecord
        At one sample rate, each long enough for two folds.
    features : Features
        What is formed of the temperature.
    block : float
        Length of a fold [s].
    most : int, optional
        Most rows; the means get longer until they fit.

    Returns
    -------
    TrainingRows
        Standardised by their own statistics.

    Raises
    ------
    ValueError
        If there is no cycle, their rates differ or one is shorter than two folds.
    """
    rates = {cycle.sample_rate_hz for cycle in cycles}
    if len(rates) != 1:
        msg = f"cycles: expected at least one, all at one sample rate, got the rates {sorted(rates)}"
        raise ValueError(msg)
    shortest, total = min(cycle.duration for cycle in cycles), sum(cycle.duration for cycle in cycles)
    if not block > _AVERAGE or shortest < 2.0 * block:
        msg = (
            f"cycles: expected at least two blocks of {block:g} s (over {_AVERAGE:g} s) in each, "
            f"got one of {shortest:g} s"
        )
        raise ValueError(msg)
    average = _AVERAGE if most is None else max(_AVERAGE, total / most)
    n_mean = max(1, round(average * rates.pop()))
    X = [block_means(features.compute(each.temperature, each.sample_rate_hz), n_mean) for each in cycles]
    y = np.concatenate([block_means(each.rate, n_mean) for each in cycles])
    scaling = Scaling.fit(np.concatenate(X))
    mean = float(y.mean())
    average = n_mean / cycles[0].sample_rate_hz
    ends = np.cumsum([0, *(len(part) for part in X)])
    whole = [slice(int(a), int(b)) for a, b in itertools.pairwise(ends)]
    folds = [fold for rows in whole for fold in _folds(rows, block / average)]
    return TrainingRows(
        scaling.apply(np.concatenate(X)), y - mean, mean, scaling, folds, whole, average, len(features.plays)
    )


def block_means(values: FloatArray, n_mean: int) -> FloatArray:
    """Return the means of whole blocks of `n_mean` samples along the first axis; an incomplete last block is left out.

    Parameters
    ----------
    values : ndarray, shape (n_time, ...)
        Samples, any unit.
    n_mean : int
        Samples per block.

    Returns
    -------
    ndarray, shape (n_time // n_mean, ...)
        Means.
    """
    n_row = len(values) // n_mean
    means: FloatArray = values[: n_row * n_mean].reshape(n_row, n_mean, *values.shape[1:]).mean(axis=1)
    return means


def _folds(rows: slice, fold: float) -> list[slice]:
    """Return nearly equal contiguous folds of about `fold` rows of one cycle, at least two."""
    number = max(2, round((rows.stop - rows.start) / fold))
    edges = np.linspace(rows.start, rows.stop, number + 1).round().astype(int)
    return [slice(int(a), int(b)) for a, b in itertools.pairwise(edges)]


def fit_polynomial(rows: TrainingRows, _seed: int = 0) -> tuple[Polynomial, float]:
    """Fit by least squares with the penalty of least blocked error.

    Returns it and the rms of that error [rad/s].

    Parameters
    ----------
    rows : TrainingRows
        Training rows.
    """
    weights, error = _least_squares(np.column_stack([np.ones(rows.y.size), rows.Z]), rows.y, 1, rows.folds)
    return Polynomial(weights[1:], float(weights[0])), error


def fit_coloured(rows: TrainingRows, _seed: int = 0) -> tuple[Polynomial, float]:
    """Fit by least squares under 1/f noise, each cycle with a constant of its own that is no drift.

    Returns as `fit_polynomial`.
    The error is that of the whitened rows: what is new in a row beyond the noise before it, in units of the noise's
    variance.

    Parameters
    ----------
    rows : TrainingRows
        Training rows.
    """
    U, v = whiten(rows.Z, rows.y, rows.cycles, _CORNER * rows.average)
    n_cycle = len(rows.cycles)
    weights, error = _least_squares(U, v, n_cycle, rows.folds)
    return Polynomial(weights[n_cycle:], 0.0), error


def fit_process(rows: TrainingRows, _seed: int = 0) -> tuple[Polynomial, float]:
    """Fit a Gaussian process under 1/f noise, with the prior variances of the largest likelihood.

    As `fit_coloured` otherwise.
    Play operators have a variance of their own, so hysteresis is believed only as far as the cycles show it.

    Parameters
    ----------
    rows : TrainingRows
        Training rows.
    """
    U, v = whiten(rows.Z, rows.y, rows.cycles, _CORNER * rows.average)
    n_cycle, n_feature = len(rows.cycles), rows.Z.shape[1]
    group = np.repeat([-1, 0, 1], [n_cycle, n_feature - rows.n_play, rows.n_play])
    ridge = polynomial.likeliest_ridge(U, v, group)
    error = _rms(polynomial.ridge_residuals(U, v, ridge, rows.folds))
    return Polynomial(polynomial.penalised(U, v, ridge)[n_cycle:], 0.0), error


def _least_squares(U: FloatArray, y: FloatArray, n_free: int, folds: list[slice]) -> tuple[FloatArray, float]:
    """Return the weights under the penalty of least blocked error, and that error; the first columns are free."""
    ridges = [y.size * penalty * (np.arange(U.shape[1]) >= n_free) for penalty in _PENALTIES]
    errors = [_rms(polynomial.ridge_residuals(U, y, ridge, folds)) for ridge in ridges]
    best = int(np.argmin(errors))
    return polynomial.penalised(U, y, ridges[best]), errors[best]


def fit_lssvm(rows: TrainingRows, seed: int) -> tuple[Lssvm, float]:
    """Fit a least-squares support vector machine with gamma and sigma^2 of least blocked error.

    Returns it and the rms of that error [rad/s].

    Parameters
    ----------
    rows : TrainingRows
        Training rows.
    seed : int
        Of the search.
    """

    def objective(point: FloatArray) -> float:
        return float(np.log(_rms(lssvm.kernel_residuals(rows.Z, rows.y, point[0], point[1], rows.folds))))

    best = evolve(objective, (_GAMMAS, _WIDTHS2), seed=seed, log=True)
    return Lssvm.fit(rows.Z, rows.y, best.point[0], best.point[1]), float(np.exp(best.value))


def _rms(values: FloatArray) -> float:
    return float(np.sqrt(np.mean(values * values)))
