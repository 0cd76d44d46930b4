"""Broadband vibration of a platform, given by its spectrum."""

from __future__ import annotations

from typing import TYPE_CHECKING, Annotated, Any, ClassVar, Literal

import numpy as np
from pydantic import Field, model_validator

from testbed.models.motion import Motion, RateFunction
from testbed.models.turntable.realisation import SPLINE_COST, gaussian_rate
from testbed.parts import Part
from testbed.units import Frequency, Quantity

if TYPE_CHECKING:
    from typing import Self

    from testbed.signals import FloatArray

PositiveRatePsd = Annotated[float, Quantity("rad^2/s", "1e-6 (deg/s)^2/Hz", above=0.0, cycle_is_number=True)]
# Angle, one-sided [rad^2/Hz], and corner [Hz], as quoted for ESA's specification of SILEX after flight data of Olympus
# (Wittig et al. 1990, doi 10.1117/12.18234): 160 urad^2/Hz / (1 + (f / 1 Hz)^2), 16 urad rms.
_OLYMPUS_ANGLE, _OLYMPUS_CORNER = 160e-12, 1.0


class SpectrumPoint(Part):
    """One point of a spectrum.

    Parameters
    ----------
    frequency : float
        Frequency [Hz].
    psd : float
        Two-sided density of the rate there [rad^2/s = (rad/s)^2/Hz].
    """

    frequency: Frequency
    psd: PositiveRatePsd


class PlatformPsd(Motion):
    r"""Gaussian random rate with a given two-sided spectrum in a band and nothing outside.

    With `points` the density is a power law between neighbours, straight in log-log,
    :math:`S(f) = S_i (f/f_i)^{\ln(S_{i+1}/S_i) / \ln(f_{i+1}/f_i)}`, in the band from the first to the last. With
    `spectrum` olympus it is :math:`S(f) = (2\pi f)^2 \cdot \tfrac12 \cdot 160\,\mu rad^2/Hz / (1 + (f/1\,Hz)^2)` from
    `low` to `high`. One realisation of `testbed.models.turntable.realisation.gaussian_rate`; the variance is twice the
    integral of S over the band.

    Parameters
    ----------
    points : tuple of SpectrumPoint, optional
        At least two, by rising frequency; exactly one of `points` and `spectrum` is given.
    spectrum : {"olympus"}, optional
        A spectrum by name.
    low, high : float, optional
        Edges of the band of a named spectrum [Hz].

    Raises
    ------
    ValueError
        If neither or both spectra are given, frequencies do not rise or the edges do not fit.
    """

    example: ClassVar[dict[str, Any]] = {"spectrum": "olympus", "low": "10 Hz", "high": "50 Hz"}

    points: Annotated[tuple[SpectrumPoint, ...], Field(min_length=2)] | None = None
    spectrum: Literal["olympus"] | None = None
    low: Frequency | None = None
    high: Frequency | None = None

    @model_validator(mode="after")
    def _consistent(self) -> Self:
        if (self.points is None) == (self.spectrum is None):
            msg = "expected exactly one of points (frequency and psd each) and spectrum (olympus)"
            raise ValueError(msg)
        if (self.spectrum is None) == (self.low is not None) or (self.low is None) != (self.high is None):
            msg = "expected low and high with a named spectrum, and neither with points, which bring their band"
            raise ValueError(msg)
        freq = self._band() if self.points is None else tuple(point.frequency for point in self.points)
        if not all(np.diff(freq) > 0.0):
            msg = f"expected rising frequencies, got {', '.join(f'{f:g} Hz' for f in freq)}"
            raise ValueError(msg)
        return self

    def density(self, freq_hz: FloatArray) -> FloatArray:
        """Return the two-sided density of the rate [rad^2/s] at frequencies within the band.

        Parameters
        ----------
        freq_hz : ndarray, shape (n_freq,)
            Frequencies [Hz].

        Returns
        -------
        ndarray, shape (n_freq,)
            Density [rad^2/s].
        """
        if self.points is None:
            angle = 0.5 * _OLYMPUS_ANGLE / (1.0 + (freq_hz / _OLYMPUS_CORNER) ** 2)
            psd: FloatArray = (2.0 * np.pi * freq_hz) ** 2 * angle
            return psd
        freq, value = np.array([(point.frequency, point.psd) for point in self.points]).T
        interpolated: FloatArray = np.exp(np.interp(np.log(freq_hz), np.log(freq), np.log(value)))
        return interpolated

    def start(self, duration: float, rng: np.random.Generator) -> RateFunction:
        """Return the rate [rad/s] as a function of time [s]."""
        return gaussian_rate(self.density, self._band(), duration, rng)

    def n_term(self) -> int:
        """Return how many sines cost as much time as the spline."""
        return SPLINE_COST

    def top_frequency(self) -> float:
        """Return the upper edge of the band [Hz]."""
        return self._band()[1]

    def _band(self) -> tuple[float, float]:
        if self.points is None:
            return self.low or 0.0, self.high or 0.0
        return self.points[0].frequency, self.points[-1].frequency
