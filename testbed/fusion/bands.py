"""Bands of the online angle random walk N_k: limits and the R that each sets, shipped by name, and how they are
calibrated.
"""

from __future__ import annotations

import functools
from typing import TYPE_CHECKING

import numpy as np
from pydantic import model_validator

from testbed.fusion.model_filter import Variance
from testbed.parts import Part, read_shipped
from testbed.units import Duration

if TYPE_CHECKING:
    from numpy.typing import ArrayLike

    from testbed.signals import FloatArray


class Bands(Part):
    """Low, mid and high band of N_k of one sensor and the R that each sets.

    Parameters
    ----------
    thresholds : tuple of two floats
        N_k / dT at the low-mid and the mid-high edge [rad^2/s^2], rising.
    R : tuple of three floats
        R on entering the low, mid and high band [rad^2/s^2].
    wait : float
        Time from the first reading before a band is judged [s].
    """

    thresholds: tuple[Variance, Variance]
    R: tuple[Variance, Variance, Variance]
    wait: Duration = 0.0

    @model_validator(mode="after")
    def _rising(self) -> Bands:
        if not self.thresholds[0] < self.thresholds[1]:
            msg = f"thresholds: expected the low-mid edge below the mid-high edge, got {self.thresholds}"
            raise ValueError(msg)
        return self


@functools.cache
def _shipped(name: str) -> dict[str, Bands]:
    content = read_shipped("set of bands", "testbed.fusion", "bands", name)
    return {key: Bands.model_validate(value, context={"border": True}) for key, value in content.items()}


def load_bands(name: str) -> dict[str, Bands]:
    """Return the shipped bands of that name; the file says where its limits come from.

    Parameters
    ----------
    name : str
        Such as "sx300_adis16505".

    Returns
    -------
    dict of str to Bands
        One entry per sensor.

    Raises
    ------
    UnknownNameError
        If no bands of that name are shipped.
    """
    return dict(_shipped(name))


def increment_variance(reading: ArrayLike) -> float:
    """Return N_k / dT of (28)-(30) over a whole record: the mean of half the squared increments.

    Parameters
    ----------
    reading : array_like, shape (n_time,)
        Readings of one sensor [rad/s], at least two.

    Returns
    -------
    float
        N_k / dT [rad^2/s^2].

    References
    ----------
    Paper 1 (doi 10.1109/TIM.2024.3375962), equations (28)-(30).
    """
    return 0.5 * float(np.mean(np.diff(np.asarray(reading, float)) ** 2))


def calibrate_bands(
    freq_hz: FloatArray, increments: FloatArray, edges_hz: tuple[float, float] = (2.0, 6.3)
) -> tuple[float, float]:
    """Return the thresholds of one sensor from a sweep of N_k over frequency at constant amplitude, such as 0.1-25 Hz
    at 1 deg/s.

    The thresholds are N_k / dT at the frequencies of the two band edges, interpolated in the logarithms of both. By
    default the low band ends at 2 Hz, about the corner of the MHD sensor, and the mid band at 6.3 Hz, beyond the
    low-pass of the filtered gyro.

    Parameters
    ----------
    freq_hz : ndarray, shape (n_freq,)
        Frequencies of the sweep [Hz], rising.
    increments : ndarray, shape (n_freq,)
        N_k / dT at each [rad^2/s^2], as from `increment_variance`.
    edges_hz : tuple of two floats, optional
        Frequencies of the low-mid and the mid-high edge [Hz], within the sweep.

    Returns
    -------
    tuple of two floats
        Thresholds of N_k / dT [rad^2/s^2].

    Raises
    ------
    ValueError
        If an edge lies outside the sweep, or N_k does not rise from one edge to the other (it cannot tell the bands
        apart).

    References
    ----------
    Paper 1 (doi 10.1109/TIM.2024.3375962), figure 7.
    """
    freq, level = np.asarray(freq_hz, float), np.asarray(increments, float)
    if not (np.all(np.diff(freq) > 0.0) and freq[0] <= edges_hz[0] < edges_hz[1] <= freq[-1]):
        msg = (
            "edges_hz: "
            f"expected two rising frequencies within a rising sweep of {freq[0]:g} to {freq[-1]:g} Hz, got {edges_hz}"
        )
        raise ValueError(msg)
    low, high = np.exp(np.interp(np.log(edges_hz), np.log(freq), np.log(level)))
    if not low < high:
        msg = (
            f"increments: expected to rise from {edges_hz[0]:g} to {edges_hz[1]:g} Hz, "
            f"got {low:g} and {high:g} rad^2/s^2"
        )
        raise ValueError(msg)
    return float(low), float(high)
