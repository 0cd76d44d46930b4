"""The Sage-Husa filter with bands of the online angle random walk: as corrected, and as printed."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Annotated, ClassVar, Literal

import numpy as np
from pydantic import Field, model_validator

from testbed.fusion import kernels
from testbed.fusion.base import DEG, Variance
from testbed.fusion.shakf import SageHusa, SageHusaParameters
from testbed.parts import Part
from testbed.units import Duration, PositiveDuration

if TYPE_CHECKING:
    from collections.abc import Mapping

    from numpy.typing import ArrayLike

    from testbed.fusion.belief import SensorBelief
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


def _default_bands(wait_gyro: float, wait_mhd: float) -> dict[str, Bands]:
    # Thresholds: calibrated on the sweep of examples/calibrate_bands.py, two digits kept.
    square = DEG**2
    return {
        "mems_gyro": Bands(
            thresholds=(1.0e-5 * square, 3.8e-5 * square),
            R=(1e-4 * square, 1e-3 * square, 1e-2 * square),
            wait=wait_gyro,
        ),
        "mhd_ars": Bands(
            thresholds=(7.0e-7 * square, 1.5e-6 * square),
            R=(6.5e-7 * square, 2e-7 * square, 1e-7 * square),
            wait=wait_mhd,
        ),
    }


class ArwShakfParameters(SageHusaParameters):
    """Parameters of `ArwShakf`, the corrected form.

    Parameters
    ----------
    bands : dict of str to Bands
        Bands per sensor; a sensor without adapts by (17) alone.
    alpha : float
        Factor of (36), 0 (S = 1) to below 1.
    window : int
        Readings n in the mean (34).
    memory : float or None
        Time constant of N_k [s]; None is the infinite memory of (30).
    innovation : {"difference", "value"}
        Judge in (17) and (34) by half the squared difference of successive innovations, which cancels the filter's lag, or as printed.
    clamp : float or None
        Keep R within this factor of its band's value (1 freezes it); None leaves it free.
    """

    default_q: ClassVar[dict[int, float]] = {1: 0.1 * DEG**2}

    beta: Annotated[float, Field(gt=0.0, lt=1.0)] = 0.9999
    bands: dict[str, Bands] = _default_bands(65e-3, 10e-3)
    alpha: Annotated[float, Field(ge=0.0, lt=1.0)] = 0.9
    window: Annotated[int, Field(ge=1, le=1_000_000)] = 200
    memory: PositiveDuration | None = 1.0
    innovation: Literal["difference", "value"] = "difference"
    clamp: Annotated[float, Field(ge=1.0, allow_inf_nan=False)] | None = None


class ArwShakfLiteralParameters(ArwShakfParameters):
    """Parameters of `ArwShakfLiteral`: equations (28)-(38) as printed, with a q of its own."""

    default_q: ClassVar[dict[int, float]] = {1: 0.3 * DEG**2}

    use_input_noise: bool = False
    bands: dict[str, Bands] = _default_bands(0.0, 0.0)
    memory: PositiveDuration | None = None
    innovation: Literal["difference", "value"] = "value"


class ArwShakf(SageHusa):
    r"""Sage-Husa filter whose R is set by bands of the online angle random walk N_k and inflated by S_k.

    .. math:: N_k/dT = (1 - g_k) N_{k-1}/dT + g_k (z_k - z_{k-1})^2 / 2, \quad \tilde R = S R,\; S = \max(1, \alpha \hat C / (H P^- H' + R))

    On entering a band R takes the band's value; within it R follows (17). For a sine N_k sees amplitude times frequency, so the bands hold
    for the amplitude that they were calibrated at (`calibrate_bands`).

    Corrected against the paper: (17) and the mean (34) judge by (e_k - e_{k-1})^2/2, so that the slow lag of the filter is not taken for
    sensor noise; g_k = max(1/(k-1), dT/memory), so that a late change is seen; a band is judged only after a wait; the gyro's input noise is
    process noise. Most of the gain comes from the first.

    Parameters
    ----------
    belief : mapping of str to SensorBelief
        Dynamics and noise of each sensor.
    sample_rate_hz : mapping of str to float
        Rate of each sensor [Hz].
    parameters : ArwShakfParameters
        Signal model, adaptation and bands.

    Raises
    ------
    ValueError
        If the bands given name an unknown sensor.

    References
    ----------
    Paper 1 (doi 10.1109/TIM.2024.3375962), equations (28)-(38).
    """

    Parameters: ClassVar[type[Part]] = ArwShakfParameters
    _diagnostics: ClassVar[dict[str, int]] = SageHusa._diagnostics | {
        "N": kernels.INCREMENTS,
        "band": kernels.BAND,
        "S": kernels.INFLATION,
    }

    def __init__(
        self, belief: Mapping[str, SensorBelief], sample_rate_hz: Mapping[str, float], parameters: ArwShakfParameters
    ) -> None:
        super().__init__(belief, sample_rate_hz, parameters)
        self.check_sensors("bands", parameters.bands, explicit="bands" in parameters.model_fields_set)
        self._windows = np.zeros((len(self.model.sensors), parameters.window))
        self._sensors["difference"] = parameters.innovation == "difference"
        self._sensors["alpha"] = parameters.alpha
        for i, name in enumerate(self.model.sensors):
            rate_hz = sample_rate_hz[name]
            self._sensors[i]["least_weight"] = (
                0.0 if parameters.memory is None else min(1.0, 1.0 / (rate_hz * parameters.memory))
            )
            if name in parameters.bands:
                self._set_bands(i, parameters.bands[name], rate_hz, parameters.clamp)

    def _set_bands(self, i: int, bands: Bands, rate_hz: float, clamp: float | None) -> None:
        record = self._sensors[i]
        record["banded"] = True
        record["thresholds"] = bands.thresholds
        record["levels"] = bands.R
        record["wait"] = max(1, math.ceil(bands.wait * rate_hz))
        record["clamp"] = np.inf if clamp is None else clamp


class ArwShakfLiteral(ArwShakf):
    """The filter of `ArwShakf` as printed: innovations themselves in (17) and (34), N_k with infinite memory, bands from the second reading.

    At the q of `Shakf` it repairs nothing: (17) and S undo the reset of R. With its own q of 0.3 (deg/s)^2/s it works, and so does `Shakf`.

    Parameters
    ----------
    belief : mapping of str to SensorBelief
        Dynamics and noise of each sensor.
    sample_rate_hz : mapping of str to float
        Rate of each sensor [Hz].
    parameters : ArwShakfLiteralParameters
        Signal model, adaptation and bands.

    References
    ----------
    Paper 1 (doi 10.1109/TIM.2024.3375962), equations (28)-(38).
    """

    Parameters: ClassVar[type[Part]] = ArwShakfLiteralParameters


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
    """Return the thresholds of one sensor from a sweep of N_k over frequency at constant amplitude, such as 0.1-25 Hz at 1 deg/s.

    The thresholds are N_k / dT at the frequencies of the two band edges, interpolated in the logarithms of both. By default the low band
    ends at 2 Hz, about the corner of the MHD sensor, and the mid band at 6.3 Hz, beyond the low-pass of the filtered gyro.

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
        If an edge lies outside the sweep, or N_k does not rise from one edge to the other (it cannot tell the bands apart).

    References
    ----------
    Paper 1 (doi 10.1109/TIM.2024.3375962), figure 7.
    """
    freq, level = np.asarray(freq_hz, float), np.asarray(increments, float)
    if not (np.all(np.diff(freq) > 0.0) and freq[0] <= edges_hz[0] < edges_hz[1] <= freq[-1]):
        msg = f"edges_hz: expected two rising frequencies within a rising sweep of {freq[0]:g} to {freq[-1]:g} Hz, got {edges_hz}"
        raise ValueError(msg)
    low, high = np.exp(np.interp(np.log(edges_hz), np.log(freq), np.log(level)))
    if not low < high:
        msg = f"increments: expected to rise from {edges_hz[0]:g} to {edges_hz[1]:g} Hz, got {low:g} and {high:g} rad^2/s^2"
        raise ValueError(msg)
    return float(low), float(high)
