"""The frequency response of a sensor to a reference, with 95 % intervals, whatever moved both."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from scipy.stats import t as student

from testbed.identification.matching import Matched, OutputClock, match

if TYPE_CHECKING:
    from testbed.identification.local import LocalFit
    from testbed.identification.spectrum import RecordGrid, Series
    from testbed.signals import ComplexArray, FloatArray

# The chance of an answer where there is none, over all parts, and over the clocks and lags that were tried beforehand.
_CHANCE, _TRIALS = 1e-6, 1e9


@dataclass(frozen=True)
class FrequencyResponse:
    """Indicated over true rate at the frequencies that the reference moved at.

    Parameters
    ----------
    freq_hz : ndarray, shape (n_freq,)
        Frequencies [Hz], rising.
    response : ndarray of complex, shape (n_freq,)
        Output over reference, at equal times by the reference's clock from its first sample on [-].
    variance : ndarray, shape (n_freq,)
        Mean square of its error by the noise, both parts together [-].
    freedom : ndarray, shape (n_freq,)
        Degrees of freedom of that [-].
    slope : ndarray of complex, shape (n_freq,)
        Derivative of the response by the clock's error [-].
    coherence : ndarray, shape (n_freq,)
        Share of the output there that follows the reference [-].
    clock : OutputClock
        Of the output.
    length : float
        Of the record [s].
    """

    freq_hz: FloatArray
    response: ComplexArray
    variance: FloatArray
    freedom: FloatArray
    slope: ComplexArray
    coherence: FloatArray
    clock: OutputClock
    length: float

    @property
    def gain(self) -> FloatArray:
        """Gain [-], shape (n_freq,)."""
        return np.abs(self.response)

    @property
    def phase(self) -> FloatArray:
        """Phase [rad], shape (n_freq,)."""
        return np.angle(self.response)

    @property
    def half_widths(self) -> tuple[FloatArray, FloatArray]:
        r"""Half the 95 % intervals of gain [-] and phase [rad], shapes (n_freq,), (n_freq,).

        .. math:: \sigma_{gain}^2 = \sigma^2 / 2 + (\mathrm{Re}\, u^* g_e)^2 \sigma_e^2, \quad
            \sigma_{phase}^2 = (\sigma^2 / 2 + (\mathrm{Im}\, u^* g_e)^2 \sigma_e^2) / |g|^2

        u = g/|g|, by Student's t.
        """
        along = np.conj(self.response) / self.gain * self.slope * self.clock.std
        quantile = student.ppf(0.975, 2.0 * self.freedom)
        gain = quantile * np.sqrt(self.variance / 2.0 + along.real**2)
        phase = quantile * np.sqrt(self.variance / 2.0 + along.imag**2) / self.gain
        return gain, phase


@dataclass(frozen=True)
class NoiseFloor:
    """What the output has beside what follows the reference.

    Parameters
    ----------
    freq_hz : ndarray, shape (n_freq,)
        Frequencies [Hz], rising.
    density : ndarray, shape (n_freq,)
        Two-sided density [rad^2/s].
    freedom : ndarray, shape (n_freq,)
        Degrees of freedom of a value [-].
    """

    freq_hz: FloatArray
    density: FloatArray
    freedom: FloatArray

    def joined(self, other: NoiseFloor) -> NoiseFloor:
        """Return the values of both."""
        rows = [np.stack([one.freq_hz, one.density, one.freedom]) for one in (self, other)]
        both = np.concatenate(rows, axis=1)
        return NoiseFloor(*both[:, np.argsort(both[0], kind="stable")])


@dataclass(frozen=True)
class Measured:
    """What a record says of an output beside a reference.

    Parameters
    ----------
    response : FrequencyResponse
        Where the output follows; no frequency if it does so nowhere.
    followed, quiet : NoiseFloor
        Of the output: where it follows, with the noise that the reference has there; and where it does not, its own.
    lag : float
        Delay that was taken off before the fits [s].
    unfollowed, mains : tuple of float
        Lines of the reference that the output does not follow, and lines at the mains' frequencies that both have and
        nothing tells from hum [Hz].
    """

    response: FrequencyResponse
    followed: NoiseFloor
    quiet: NoiseFloor
    lag: float
    unfollowed: tuple[float, ...]
    mains: tuple[float, ...]

    @property
    def noise(self) -> NoiseFloor:
        """Noise of the output at all frequencies."""
        return self.followed.joined(self.quiet)


def measure_response(reference: Series, output: Series, *, one_clock: bool = False) -> Measured:
    """Return the response of an output to a reference.

    Parameters
    ----------
    reference, output : Series
        Channels; their clocks agree at time zero.
    one_clock : bool, optional
        Both were sampled by one clock.

    Raises
    ------
    ValueError
        If they have too little time in common.
    """
    found = match(reference, output, one_clock=one_clock)
    limit = chance_limit(len(found.fits))
    sure = [one.chance < limit for one in found.fits]
    follows = [one for one, is_sure in zip(found.fits, sure, strict=True) if is_sure]
    idle = [one for one, is_sure in zip(found.fits, sure, strict=True) if not is_sure]
    mains = _mains(follows, found.grid)
    used = [one for one in follows if one.freq_hz not in mains]
    unfollowed = [one.freq_hz for one in idle if one.is_line]
    others = [(one.noise_hz, one.power, one.freedom) for one in idle]
    others += [(one.noise_hz, one.noise, one.freedom) for one in found.quiet]
    return Measured(
        _response(used, found),
        _floor([(one.noise_hz, one.noise, one.freedom) for one in follows], found.grid.length),
        # All is noise where nothing follows.
        _floor(others, found.grid.length),
        found.lag,
        tuple(unfollowed),
        tuple(mains),
    )


def chance_limit(n_part: int) -> float:
    """Return the logarithm of the chance below which an output follows the reference in one of so many parts."""
    return float(np.log(_CHANCE / (_TRIALS * max(n_part, 1))))


def _response(used: list[LocalFit], found: Matched) -> FrequencyResponse:
    freq = np.array([one.freq_hz for one in used])
    late = np.exp(-2j * np.pi * freq * found.lag)
    return FrequencyResponse(
        freq_hz=freq,
        response=late * np.array([one.response for one in used], dtype=complex),
        variance=np.array([one.variance for one in used]),
        freedom=np.array([one.freedom for one in used], dtype=float),
        slope=late * np.array([one.slope for one in used], dtype=complex),
        coherence=np.array([one.coherence for one in used]),
        clock=found.clock,
        length=found.grid.length,
    )


def _floor(levels: list[tuple[float, float, int]], length: float) -> NoiseFloor:
    """Return the noise of frequencies, levels and degrees of freedom, in the order of frequency."""
    freq, level, freedom = np.array(sorted(levels), dtype=float).reshape(-1, 3).T
    return NoiseFloor(freq, level / length, freedom)


# Lines off the mains' frequencies from which on those at them are excitation too; how far the mains wander.
_OTHERS, _WANDER, _MOST_HARMONICS = 3, 2e-3, 20


def _mains(follows: list[LocalFit], grid: RecordGrid) -> list[float]:
    """Return lines at multiples of 50 and 60 Hz where the rest of the excitation is no lines."""
    suspect = [one.freq_hz for one in follows if one.is_line and _is_mains(one.freq_hz, grid.length)]
    others = sum(one.is_line for one in follows) - len(suspect)
    return [] if others >= _OTHERS else suspect


def _is_mains(freq_hz: float, length: float) -> bool:
    near = [
        abs(freq_hz - round(freq_hz / one) * one)
        for one in (50.0, 60.0)
        if 1 <= round(freq_hz / one) <= _MOST_HARMONICS
    ]
    return any(distance < max(_WANDER * freq_hz, 1.0 / length) for distance in near)
