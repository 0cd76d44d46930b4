"""The MEMS gyro: input-referred noise, low-pass, reading clock, word."""

from __future__ import annotations

from typing import TYPE_CHECKING, Annotated

import numpy as np
from pydantic import Field, model_validator

from testbed.sensors.base import Converter, Decimator, Sensor, rate_ratio, rounding_psd
from testbed.sensors.noise import GyroTerms
from testbed.sensors.noise_terms import NoiseStage
from testbed.signals import LinearFilter, transfer
from testbed.units import Frequency, Quantity, Range

if TYPE_CHECKING:
    from typing import Self

    from numpy.typing import ArrayLike

    from testbed.signals import ComplexArray, FloatArray

# Base clock of a run, at which the noise enters.
_INPUT_RATE_HZ = 20000.0

WordSensitivity = Annotated[float, Quantity("LSB*s/rad", "2621440 LSB/(deg/s)", above=0.0)]
Coefficients = Annotated[tuple[Annotated[float, Field(allow_inf_nan=False)], ...], Field(min_length=1)]


class MemsGyro(Sensor, GyroTerms):
    """A MEMS gyro as its user sees it: readings in rad/s.

    The noise is added to the rate and passes the low-pass with it, as in the real chip. The low-pass is given either
    by its coefficients or as a second order with `corner` and `damping`.

    Parameters
    ----------
    numerator, denominator : tuple of float, optional
        Low-pass in s [rad/s], highest power first.
    corner : float, optional
        Natural frequency of a second-order low-pass [Hz].
    damping : float
        Its damping ratio [-].
    range : float
        Readings saturate at plus and minus this [rad/s].
    sensitivity : float
        Counts per rate of the output word [LSB s/rad].
    word_bits : int
        Length of the output word, two's complement [-].
    """

    numerator: Coefficients | None = None
    denominator: Coefficients | None = None
    corner: Frequency | None = None
    damping: Annotated[float, Field(gt=0.0, allow_inf_nan=False)] = 0.5**0.5
    range: Range
    sensitivity: WordSensitivity
    word_bits: Annotated[int, Field(strict=True, ge=2, le=32)] = 32

    @model_validator(mode="after")
    def _one_low_pass(self) -> Self:
        given = [self.numerator is not None, self.denominator is not None]
        if given != [self.corner is None] * 2:
            msg = "expected either numerator and denominator or corner"
            raise ValueError(msg)
        numerator, denominator = self.transfer_function
        if len(numerator) > len(denominator) or not denominator[0]:
            msg = f"numerator: expected at most the denominator's degree, got {len(numerator) - 1}"
            raise ValueError(msg)
        if np.any(np.roots(denominator).real >= 0.0):
            msg = "denominator: expected roots with negative real parts, got an unstable low-pass"
            raise ValueError(msg)
        return self

    @property
    def transfer_function(self) -> tuple[tuple[float, ...], tuple[float, ...]]:
        """Numerator and denominator of the low-pass in s [rad/s], highest power first."""
        if self.numerator is not None and self.denominator is not None:
            return self.numerator, self.denominator
        natural = 2.0 * np.pi * (self.corner or 0.0)
        return (natural**2,), (1.0, 2.0 * self.damping * natural, natural**2)

    def response(self, freq_hz: ArrayLike) -> ComplexArray:
        """Return indicated over true rate, the low-pass alone.

        Parameters
        ----------
        freq_hz : array_like, shape (n_freq,)
            Frequency [Hz].

        Returns
        -------
        ndarray of complex, shape (n_freq,)
            Response [-].
        """
        numerator, denominator = self.transfer_function
        return transfer(np.array(numerator), np.array(denominator), np.asarray(freq_hz, dtype=np.float64))

    def full_scale(self) -> float:
        """Return the largest rate that it can read [rad/s]."""
        return float(min(self.range, (2 ** (self.word_bits - 1) - 1) / self.sensitivity))

    def input_noise_psd(self, freq_hz: FloatArray) -> FloatArray:
        """Return the noise referred to the true rate, its terms at 20 kHz; see `Sensor.input_noise_psd`."""
        rounding = rounding_psd(1.0 / self.sensitivity, self.sample_rate)
        density: FloatArray = self.noise_psd(freq_hz, _INPUT_RATE_HZ) + rounding / np.abs(self.response(freq_hz)) ** 2
        return density

    def start(self, input_rate_hz: float, seed: int, name: str) -> MemsGyroStage:
        """Return the gyro at rest; see `Sensor.start`."""
        return MemsGyroStage(self, input_rate_hz, seed, name)


class MemsGyroStage:
    """A MEMS gyro in time; made by `MemsGyro.start`."""

    def __init__(self, gyro: MemsGyro, input_rate_hz: float, seed: int, name: str) -> None:
        self._decimator = Decimator(rate_ratio(input_rate_hz, gyro.sample_rate))
        self._noise = NoiseStage(gyro.noise_terms(input_rate_hz, seed, name) if gyro.noise else {})
        numerator, denominator = gyro.transfer_function
        self._low_pass = LinearFilter(list(numerator), list(denominator), input_rate_hz)
        self._converter = Converter(1.0 / gyro.sensitivity, gyro.word_bits, gyro.range, rounding=gyro.noise)

    def process(self, true_rate: FloatArray) -> FloatArray:
        """Return the readings [rad/s] that fall into a block of the true rate [rad/s]."""
        sensed = self._low_pass.process(true_rate + self._noise.process(true_rate.size))
        return self._converter.process(self._decimator.process(sensed))
