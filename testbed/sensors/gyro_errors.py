"""What a gyro does to a rate besides noise and low-pass: constant errors before it, the clock of the readings behind
it.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Annotated, Literal

import numpy as np
from pydantic import Field, field_validator

from testbed.parts import Part
from testbed.signals import Recursion
from testbed.units import (
    Duration,
    Probability,
    Quantity,
    RatePerAcceleration,
    RatePerKelvin,
    RateStd,
    Ratio,
    RatioPerKelvin,
    Temperature,
)

if TYPE_CHECKING:
    from testbed.sensors.stages import Surroundings
    from testbed.signals import ComplexArray, FloatArray

# Along the sensing axis of a level instrument at rest.
_GRAVITY = 9.80665

GainError = Annotated[float, Quantity("", "200 ppm", above=-1.0)]
Weights = Annotated[tuple[Annotated[float, Field(allow_inf_nan=False)], ...], Field(min_length=1)]


class GyroErrors(Part):
    r"""Errors of a gyro with the rate, the surroundings and the clock; every default is the perfect instrument.

    .. math:: y = [1 + s + s_T (T - T_0)] w + \tfrac{a}{2} |w| + b_0 + b_T (T - T_0) + g \cdot f,
        \quad w = w_z + c_x w_x + c_y w_y

    Parameters
    ----------
    scale_factor_error : float
        s [-].
    scale_factor_asymmetry : float
        a, scale factor of positive minus that of negative rates [-].
    cross_axis : tuple of 2 float
        c_x, c_y, electronic coupling of the rates about the housing's x and y [-]; a tilted housing is `mounting`.
    turn_on_bias : float
        Standard deviation of b_0, drawn once per run [rad/s].
    g_sensitivity : tuple of 3 float
        g, bias per specific force along the housing's x, y, z, gravity included [rad/s per m/s^2].
    bias_temperature : float
        b_T [rad/s/K].
    scale_factor_temperature : float
        s_T [1/K].
    reference_temperature : float
        T_0, of the calibration [K].
    fir : tuple of float or "average", optional
        Decimation filter: weights of the samples at 20 kHz, newest first, divided by their sum; "average" is the mean
        over one reading's period.
    jitter : float
        The reading is older than its time stamp by 0 to this, uniformly spread [s].
    dead_band : float
        Smaller readings are zero [rad/s].
    dropped : float
        Probability that a reading is lost and is NaN [-].
    """

    scale_factor_error: GainError = 0.0
    scale_factor_asymmetry: Ratio = 0.0
    cross_axis: tuple[Ratio, Ratio] = (0.0, 0.0)
    turn_on_bias: RateStd = 0.0
    g_sensitivity: tuple[RatePerAcceleration, RatePerAcceleration, RatePerAcceleration] = (0.0, 0.0, 0.0)
    bias_temperature: RatePerKelvin = 0.0
    scale_factor_temperature: RatioPerKelvin = 0.0
    reference_temperature: Temperature = 298.15
    fir: Weights | Literal["average"] | None = None
    jitter: Duration = 0.0
    dead_band: RateStd = 0.0
    dropped: Probability = 0.0

    @field_validator("fir")
    @classmethod
    def _passes_a_constant(cls, weights: Weights | Literal["average"] | None) -> Weights | Literal["average"] | None:
        if isinstance(weights, tuple) and abs(sum(weights)) < 1e-9 * max(map(abs, weights), default=0.0):
            msg = "expected weights whose sum is not zero"
            raise ValueError(msg)
        return weights

    @property
    def exposed(self) -> bool:
        """Whether cross rates or accelerations matter; see `Sensor.exposed`."""
        return any(self.cross_axis) or any(self.g_sensitivity)

    def distort(self, true_rate: FloatArray, surroundings: Surroundings) -> FloatArray:
        """Return what the element senses, b_0 apart.

        Parameters
        ----------
        true_rate : ndarray, shape (n_time,)
            True rate about the sensing axis [rad/s].
        surroundings : Surroundings
            Over the same samples.

        Returns
        -------
        ndarray, shape (n_time,)
            Rate with all errors but that bias, which a constant low-pass lets come later [rad/s].
        """
        sensed, cross, force = true_rate, surroundings.cross_rate, surroundings.specific_force
        heat = 0.0 if surroundings.temperature is None else surroundings.temperature - self.reference_temperature
        if cross is not None:
            sensed = sensed + (self.cross_axis[0] * cross[:, 0] + self.cross_axis[1] * cross[:, 1])
        if self.scale_factor_error or self.scale_factor_temperature or self.scale_factor_asymmetry:
            gain = 1.0 + self.scale_factor_error + self.scale_factor_temperature * heat
            sensed = gain * sensed + 0.5 * self.scale_factor_asymmetry * np.abs(sensed)
        along = (0.0, 0.0, _GRAVITY) if force is None else force.T
        leaning = sum(g * f for g, f in zip(self.g_sensitivity, along, strict=True) if g)
        shifted: FloatArray = sensed + (self.bias_temperature * heat + leaning)
        return shifted

    def weights(self, ratio: int) -> FloatArray:
        """Return the decimation filter's weights for `ratio` samples per reading, shape (n_tap,), sum 1 [-]."""
        taps = np.ones(ratio if self.fir == "average" else 1) if self.fir in {None, "average"} else np.array(self.fir)
        weights: FloatArray = taps / taps.sum()
        return weights

    def clock_response(self, freq_hz: FloatArray, sample_rate_hz: float, input_rate_hz: float) -> ComplexArray:
        r"""Return the response of decimation filter and mean age, :math:`\sum_m c_m e^{-j w m T} e^{-j w J / 2}`.

        Parameters
        ----------
        freq_hz : ndarray, shape (n_freq,)
            Frequency [Hz].
        sample_rate_hz, input_rate_hz : float
            Rates of the readings and of the samples 1/T [Hz].

        Returns
        -------
        ndarray of complex, shape (n_freq,)
            Response [-].
        """
        turn = -2j * np.pi * freq_hz
        taps = self.weights(round(input_rate_hz / sample_rate_hz))
        response: ComplexArray = np.polyval(taps[::-1], np.exp(turn / input_rate_hz)) * np.exp(0.5 * turn * self.jitter)
        return response

    def delay(self, sample_rate_hz: float, input_rate_hz: float) -> float:
        """Return the delay of a slow rate by decimation filter and mean age [s]; arguments as `clock_response`."""
        taps = self.weights(round(input_rate_hz / sample_rate_hz))
        return float(taps @ np.arange(taps.size)) / input_rate_hz + 0.5 * self.jitter


class Fir:
    """Weighted sum of the newest samples, the first one for ever before it; the same bits for any division into blocks.

    Parameters
    ----------
    weights : ndarray, shape (n_tap,)
        Newest first [-].
    """

    def __init__(self, weights: FloatArray) -> None:
        self._weights, self._recursion = weights, Recursion(weights, np.ones(1))
        self._started = False

    def process(self, u: FloatArray) -> FloatArray:
        """Return the filtered samples, shape (n_time,), unit of `u`."""
        if self._weights.size == 1 or not u.size:
            return u
        if not self._started:
            # Each delayed sum holds what is left of a constant's.
            self._recursion.state[:], self._started = np.cumsum(self._weights[:0:-1])[::-1] * u[0], True
        y: FloatArray = self._recursion.process(u)
        return y


class AgedSampler:
    """Takes every `ratio`-th sample, each a little old: a straight line between the samples around its instant; the
    first sample stands for all before it.

    Parameters
    ----------
    ratio : int
        Samples per reading.
    spread : float
        Largest age [samples].
    stream : numpy.random.Generator, optional
        Source of the ages, uniform from 0 to `spread`; without it all have the mean age.
    """

    def __init__(self, ratio: int, spread: float, stream: np.random.Generator | None) -> None:
        self._ratio, self._spread, self._stream, self._skip = ratio, spread, stream, 0
        self._past = np.full(int(np.ceil(spread)) + 1, np.nan)

    def process(self, samples: FloatArray) -> FloatArray:
        """Return the readings that the clock takes in this block, unit of `samples`."""
        if samples.size and np.isnan(self._past).all():
            self._past[:] = samples[0]
        line = np.concatenate([self._past, samples])
        due = np.arange(self._skip, samples.size, self._ratio) + self._past.size
        self._skip = (self._skip - samples.size) % self._ratio
        self._past = line[line.size - self._past.size :]
        age = self._spread * (np.full(due.size, 0.5) if self._stream is None else self._stream.random(due.size))
        newer = due - age.astype(np.int64)
        taken: FloatArray = line[newer] + (age % 1.0) * (line[newer - 1] - line[newer])
        return taken
