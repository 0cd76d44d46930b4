"""The methods that paper 3's Table 2 compares itself with, on the record that they correct; here to be audited.

All three take noise away and leave the slow part as it is: they compensate no drift, and pay with bandwidth.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from testbed.compensation.ceemdan import ceemdan
from testbed.compensation.grouping import group_modes
from testbed.compensation.kernel_components import kernel_components
from testbed.compensation.lifting import lifting_threshold
from testbed.compensation.local_mean import local_mean_decomposition
from testbed.compensation.random_weighting import random_weighting

if TYPE_CHECKING:
    from testbed.compensation.record import GyroRecord
    from testbed.signals import FloatArray


def akf22(record: GyroRecord, *, seed: int = 0) -> FloatArray:
    """Adaptive Kalman filter with random weighting, the paper's reference 22.

    Parameters
    ----------
    record : GyroRecord
        To filter.
    seed : int
        Of the random weights.

    Returns
    -------
    ndarray, shape (n_time,)
        Filtered rate [rad/s].
    """
    return random_weighting(record.rate, seed=seed)


def olmd_kpca(record: GyroRecord, *, seed: int = 0) -> FloatArray:
    """Optimised local mean decomposition, noise functions left out, mixed ones by kernel principal components.

    The paper names the parts and no more; the groups are those of `group_modes` by period.

    Parameters
    ----------
    record : GyroRecord
        To filter.
    seed : int
        Of the instants that make the kernel.

    Returns
    -------
    ndarray, shape (n_time,)
        Filtered rate [rad/s].
    """
    functions = local_mean_decomposition(record.rate)
    groups = group_modes(functions, record.sample_rate_hz)
    slow: FloatArray = functions[list(groups.drift)].sum(axis=0)
    if not groups.mixed:
        return slow
    mixed: FloatArray = kernel_components(functions[list(groups.mixed)], seed=seed).sum(axis=0)
    return slow + mixed


def ceemdan_lwt(
    record: GyroRecord,
    *,
    seed: int = 0,
    trials: int = 100,
    threads: int | None = None,
    modes: FloatArray | None = None,
) -> FloatArray:
    """CEEMDAN, noise and mixed modes each by the soft thresholds of a lifting wavelet.

    Parameters
    ----------
    record : GyroRecord
        To filter.
    seed : int
        Of the added noise.
    trials : int
        Its realisations [-].
    threads : int, optional
        All processors unless told.
    modes : ndarray, shape (n_mode + 1, n_time), optional
        A decomposition made before, residual last [rad/s].

    Returns
    -------
    ndarray, shape (n_time,)
        Filtered rate [rad/s].
    """
    rows = ceemdan(record.rate, seed=seed, trials=trials, threads=threads) if modes is None else modes
    groups = group_modes(rows, record.sample_rate_hz)
    fast = [lifting_threshold(rows[k]) for k in (*groups.noise, *groups.mixed)]
    corrected: FloatArray = np.sum([*fast, *rows[list(groups.drift)]], axis=0)
    return corrected
