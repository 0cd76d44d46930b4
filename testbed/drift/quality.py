"""How quiet a record is: block means, Allan deviation at an hour, and the coefficients where the noise model holds."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from scipy.signal import butter, sosfiltfilt

from testbed.allan import allan_deviation, fit_allan
from testbed.allan.fit import judge_fit
from testbed.compensation import training

if TYPE_CHECKING:
    from testbed.allan import AllanCurve, AllanFit
    from testbed.signals import FloatArray

BLOCK = 100.0  # s, of the block means
HOUR = 3600.0  # s
# A fit is trusted up to where the model holds comfortably, less three averaging times: where the departure only begins
# to drown in the spread of the estimates, it still bends the coefficients.
_COMFORT, _MARGIN, _LEAST = 0.05, 3, 8


@dataclass(frozen=True)
class Quality:
    """A record's Allan curve and what it says.

    Parameters
    ----------
    curve : AllanCurve
        Over all averaging times.
    fit : AllanFit or None
        Over the averaging times up to `fitted_to`; None where the five terms do not describe it, so that no coefficient
        is given.
    fitted_to : float
        Longest averaging time that the fit saw [s].
    block_std : float
        Standard deviation of the means over 100 s [rad/s].
    hour_deviation : float or None
        Allan deviation at 3600 s [rad/s]; None for a record under four hours.
    """

    curve: AllanCurve
    fit: AllanFit | None
    fitted_to: float
    block_std: float
    hour_deviation: float | None


def assess(rate: FloatArray, sample_rate_hz: float, fitted_to: float) -> Quality:
    """Return the quality of a record.

    Parameters
    ----------
    rate : ndarray, shape (n_time,)
        [rad/s].
    sample_rate_hz : float
        [Hz].
    fitted_to : float
        Longest averaging time to fit [s], from `described_to` of the record before compensation, so that both are
        fitted alike.

    Returns
    -------
    Quality
        Its figures.
    """
    curve = allan_deviation(rate, sample_rate_hz)
    fit = fit_allan(curve.between(0.0, fitted_to))
    long_enough = rate.size >= 4.0 * HOUR * sample_rate_hz
    hour = float(allan_deviation(rate, sample_rate_hz, [HOUR]).deviation[0]) if long_enough else None
    return Quality(curve, fit if fit.goodness.accepted else None, fitted_to, block_std(rate, sample_rate_hz), hour)


def described_to(curve: AllanCurve) -> float:
    """Return the longest averaging time [s] up to which the five terms describe a curve, drift coming in beyond.

    Parameters
    ----------
    curve : AllanCurve
        Of the record before compensation.
    """
    tau = curve.tau
    for n_cut in range(tau.size - _LEAST - _MARGIN):
        if judge_fit(curve.between(0.0, float(tau[-1 - n_cut]) * 1.001)).p_value >= _COMFORT:
            return float(tau[-1 - n_cut - (_MARGIN if n_cut else 0)]) * 1.001
    return float(tau[_LEAST - 1]) * 1.001


def block_std(rate: FloatArray, sample_rate_hz: float, block: float = BLOCK) -> float:
    """Return the standard deviation of the means over blocks [rad/s], an incomplete last block left out.

    Parameters
    ----------
    rate : ndarray, shape (n_time,)
        [rad/s].
    sample_rate_hz : float
        [Hz].
    block : float, optional
        Length of a block [s].
    """
    return float(timed_means(rate, sample_rate_hz, block).std())


def timed_means(values: FloatArray, sample_rate_hz: float, block: float = BLOCK) -> FloatArray:
    """Return the means over blocks, shape (n_block,), an incomplete last block left out.

    Parameters
    ----------
    values : ndarray, shape (n_time,)
        Samples, any unit.
    sample_rate_hz : float
        [Hz].
    block : float, optional
        Length of a block [s].
    """
    return training.block_means(values, max(1, round(block * sample_rate_hz)))


def smoothed(rate: FloatArray, sample_rate_hz: float, bandwidth: float) -> FloatArray:
    r"""Return the record through a zero-phase low-pass, twice a second-order Butterworth filter, -3 dB at `bandwidth`.

    The two passes have the gain :math:`1 / (1 + (f/f_c)^4)`, so :math:`f_c = f_{3dB} (\sqrt{2} - 1)^{-1/4}`.

    Parameters
    ----------
    rate : ndarray, shape (n_time,)
        [rad/s].
    sample_rate_hz : float
        [Hz].
    bandwidth : float
        Where its gain is 1/sqrt(2) [Hz].

    Returns
    -------
    ndarray, shape (n_time,)
        [rad/s].
    """
    corner = bandwidth * (np.sqrt(2.0) - 1.0) ** -0.25
    sections = butter(2, min(corner, 0.499 * sample_rate_hz), fs=sample_rate_hz, output="sos")
    filtered: FloatArray = sosfiltfilt(sections, rate)
    return filtered
