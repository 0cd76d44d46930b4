"""Paper 3's compensation of one record, literally: decompose, group, filter, regress on the temperature, reconstruct.

It trains on the very record that it corrects, as the paper does. Temperature and time are nearly one there, so that
what it removes is largely true rate (docs/compensation_models.md): it is here to be audited, not to be used.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Literal

import numpy as np

from testbed.compensation import lssvm
from testbed.compensation.fading import choose_factor, choose_ratio, fading_memory
from testbed.compensation.features import Features
from testbed.compensation.lssvm import Lssvm
from testbed.compensation.search import Best, grey_wolf
from testbed.compensation.training import gather

if TYPE_CHECKING:
    from collections.abc import Sequence

    from testbed.compensation.record import GyroRecord
    from testbed.compensation.training import TrainingRows
    from testbed.signals import FloatArray

# Equation (21) and below: the box of the wolves for gamma and sigma^2.
_BOUNDS = ((10.0, 1e5), (1e-6, 1e6))
_BLOCK = 7200.0
TEMPERATURE_ALONE = Features(degree=1, slopes=False, lags=())


@dataclass(frozen=True)
class PaperOptions:
    """The paper's numbers, and our choice wherever it leaves one.

    Parameters
    ----------
    variant : {"improved", "classic"}
        CEEMDAN of equations (1)-(6) with the noise's own modes, or the older one.
    trials : int
        Noise realisations; not given, 100 is usual.
    noise : float
        Their standard deviation over the record's; not given, 0.2 is usual [-].
    grouping : {"sample_entropy", "permutation_entropy", "period"}
        How modes are sorted. The text says permutation entropy, which cannot give the paper's groups; sample entropy
        does.
    noise_modes : {"filter", "drop"}
        Whether IMF1-4 pass through the Kalman filter, as the steps have it, or are left out, as section 4.3 may be
        read.
    factor : float or None
        s of equation (22); None: chosen by the whiteness of the innovation [-].
    ratio : float or None
        Q/R of the filter; not given. None: the one that foresees best with s = 1 [-].
    features : Features
        What the machine sees; "temperature" in the paper, so T alone.
    fitness : {"training", "blocked"}
        Error that the wolves lower: on the training rows, as in the paper, or blocked cross-validation.
    log_search : bool
        Search in logarithms. The paper's ranges of four and twelve decades cannot be searched otherwise; it does not
        say.
    wolves, iterations : int
        Of the search; 50 and 20 in the paper.
    rows : int
        Most training rows: 85,200 samples are too many for a dense machine, and the paper does not say what it did.
    """

    variant: Literal["improved", "classic"] = "improved"
    trials: int = 100
    noise: float = 0.2
    grouping: Literal["sample_entropy", "permutation_entropy", "period"] = "sample_entropy"
    noise_modes: Literal["filter", "drop"] = "filter"
    factor: float | None = 0.583
    ratio: float | None = None
    features: Features = TEMPERATURE_ALONE
    fitness: Literal["training", "blocked"] = "training"
    log_search: bool = True
    wolves: int = 50
    iterations: int = 20
    rows: int = 300


@dataclass(frozen=True)
class PaperResult:
    """The corrected record and what led to it.

    Parameters
    ----------
    rate : ndarray, shape (n_time,)
        Filtered fast part plus drift group minus modelled drift, constant included [rad/s].
    drift : ndarray, shape (n_time,)
        Modelled drift, of mean zero over the training rows [rad/s].
    filtered : ndarray, shape (n_time,)
        What the Kalman filter leaves of the fast part [rad/s].
    sizes : tuple of int
        Number of modes in the groups noise, mixed and drift (with the residual).
    factor, ratio : float
        s and Q/R used [-].
    search : Best
        gamma and sigma^2 with their fitness (logarithm of a rms).
    """

    rate: FloatArray
    drift: FloatArray
    filtered: FloatArray
    sizes: tuple[int, int, int]
    factor: float
    ratio: float
    search: Best


def compensate(
    record: GyroRecord,
    options: PaperOptions | None = None,
    *,
    seed: int = 0,
    modes: FloatArray | None = None,
    groups: Sequence[range] | None = None,
) -> PaperResult:
    """Correct a record by the paper's pipeline.

    The constant is kept in the rate: the paper abandons "constant noise", and Earth rate with it.

    Parameters
    ----------
    record : GyroRecord
        Readings; training and correction use the same ones.
    options : PaperOptions, optional
        The paper's numbers and our choices.
    seed : int
        Of the decomposition and the search.
    modes : ndarray, shape (n_mode + 1, n_time), optional
        A decomposition made before, residual last [rad/s].
    groups : sequence of range, optional
        Rows of noise, mixed and drift, if they are not to be found.

    Returns
    -------
    PaperResult
        Corrected rate and its parts.

    Raises
    ------
    ValueError
        If the modes do not fit the record.

    References
    ----------
    Wang, Cui, Cao, Micromachines 14 (2023) 1712, sections 2 and 3.
    """
    chosen = PaperOptions() if options is None else options
    rows = decompose(record, chosen, seed) if modes is None else modes
    if rows.ndim != 2 or rows.shape[1] != record.rate.size:
        msg = f"modes: expected shape (n_mode + 1, {record.rate.size}), got {rows.shape}"
        raise ValueError(msg)
    noise, mixed, slow = _group(rows, record.sample_rate_hz, chosen) if groups is None else groups
    fast = rows[list(mixed)].sum(axis=0)
    if chosen.noise_modes == "filter":
        fast = fast + rows[list(noise)].sum(axis=0)
    filtered, factor, ratio = _filter(fast, chosen)
    signal = rows[list(slow)].sum(axis=0)
    drift, search = _regress(record, signal, chosen, seed)
    sizes = (len(noise), len(mixed), len(slow))
    return PaperResult(filtered + signal - drift, drift, filtered, sizes, factor, ratio, search)


def decompose(record: GyroRecord, options: PaperOptions, seed: int) -> FloatArray:
    """Return the modes that the pipeline begins with, the residual last [rad/s], shape (n_mode + 1, n_time).

    Parameters
    ----------
    record : GyroRecord
        To decompose.
    options : PaperOptions
        Variant, trials and noise.
    seed : int
        Of the added noise.
    """
    from testbed.compensation.ceemdan import ceemdan

    return ceemdan(record.rate, variant=options.variant, trials=options.trials, noise=options.noise, seed=seed)


def corrected(record: GyroRecord) -> FloatArray:
    """Paper 3's own protocol, trained on the record that it corrects.

    Parameters
    ----------
    record : GyroRecord
        To correct.

    Returns
    -------
    ndarray, shape (n_time,)
        Corrected rate [rad/s].
    """
    return compensate(record).rate


def _group(modes: FloatArray, sample_rate_hz: float, options: PaperOptions) -> tuple[range, range, range]:
    from testbed.compensation.grouping import group_modes

    found = group_modes(modes, sample_rate_hz, method=options.grouping)
    return found.noise, found.mixed, found.drift


def _filter(fast: FloatArray, options: PaperOptions) -> tuple[FloatArray, float, float]:
    """Return the filtered fast part, s and Q/R; without modes to filter it is zero."""
    if not fast.any():
        return fast, 1.0, 0.0
    ratio = choose_ratio(fast) if options.ratio is None else options.ratio
    factor = choose_factor(fast, ratio) if options.factor is None else options.factor
    return fading_memory(fast, factor, ratio)[0], factor, ratio


def _regress(record: GyroRecord, signal: FloatArray, options: PaperOptions, seed: int) -> tuple[FloatArray, Best]:
    """Return the machine's drift at each sample and the search for its parameters."""
    part = type(record)(signal, record.temperature, record.sample_rate_hz)
    rows = gather([part], options.features, block=min(_BLOCK, record.duration / 3.0), most=options.rows)

    def fitness(point: FloatArray) -> float:
        return float(np.log(np.sqrt(np.mean(_errors(rows, point, options) ** 2))))

    best = grey_wolf(
        fitness, _BOUNDS, wolves=options.wolves, iterations=options.iterations, seed=seed, log=options.log_search
    )
    machine = Lssvm.fit(rows.Z, rows.y, best.point[0], best.point[1])
    features = options.features.compute(record.temperature, record.sample_rate_hz)
    return machine.predict(rows.scaling.apply(features)), best


def _errors(rows: TrainingRows, point: FloatArray, options: PaperOptions) -> FloatArray:
    gamma, width2 = float(point[0]), float(point[1])
    if options.fitness == "blocked":
        return lssvm.kernel_residuals(rows.Z, rows.y, gamma, width2, rows.folds)
    # The last row of equation (20): e = a / gamma.
    return Lssvm.fit(rows.Z, rows.y, gamma, width2).weights / gamma
