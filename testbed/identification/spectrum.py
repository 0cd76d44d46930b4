"""Fourier transforms of channels whose clocks differ, at the same true frequencies."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from scipy.signal import ZoomFFT

if TYPE_CHECKING:
    from testbed.signals import ComplexArray, FloatArray


@dataclass(frozen=True)
class Series:
    """Even samples of a channel.

    Parameters
    ----------
    values : ndarray, shape (n_time,)
        Rate [rad/s] or angle [rad], finite, of mean zero.
    start : float
        When the first one was taken, by the channel's own clock, from the beginning of the record on [s].
    sample_rate_hz : float
        By the channel's own clock [Hz].
    is_angle : bool, optional
        The rate is its derivative.
    """

    values: FloatArray
    start: float
    sample_rate_hz: float
    is_angle: bool = False

    @property
    def end(self) -> float:
        """When the next sample would be taken [s]."""
        return self.start + self.values.size / self.sample_rate_hz


@dataclass(frozen=True)
class RecordGrid:
    """The frequencies that a record of some length tells apart: multiples of its inverse.

    Parameters
    ----------
    start, length : float
        Part of the record, by the clock of the reference [s].
    n_freq : int
        Their number, from 1/length on.
    """

    start: float
    length: float
    n_freq: int

    @property
    def freq_hz(self) -> FloatArray:
        """Frequencies [Hz], shape (n_freq,)."""
        freq: FloatArray = np.arange(1, self.n_freq + 1) / self.length
        return freq


def spectrum(series: Series, grid: RecordGrid, clock: float = 0.0) -> tuple[ComplexArray, ComplexArray]:
    r"""Return the Fourier transform of a rate over a part of the record, and its derivative by the clock.

    .. math:: X(f) = (1 + e) T \sum_k x_k e^{-2 \pi i f t_k}, \quad t_k = (1 + e) t'_k

    with t' the times by the channel's own clock, which counts 1 s in (1 + e) s of the reference's; dX/de without the
    factor before the sum is :math:`-2 \pi i f` times the transform of t' x. By the chirp z-transform, so that two
    channels of any rates and clocks meet at the same frequencies without interpolation. No window: what that leaks is
    smooth in frequency, and the local fit takes it for the transient that it is. Of an angle it is 2 pi i f times the
    transform of the angle; what the ends add is as smooth.

    Parameters
    ----------
    series : Series
        Of the channel.
    grid : RecordGrid
        Part of the record and frequencies.
    clock : float, optional
        e [-].

    Returns
    -------
    X, slope : ndarray of complex, shapes (n_freq,), (n_freq,)
        Transform of the rate [rad] and its derivative by e [rad].

    References
    ----------
    L. R. Rabiner, R. W. Schafer, C. M. Rader (1969), Bell Syst. Tech. J. 48:1249-1292.
    """
    step = (1.0 + clock) / series.sample_rate_hz
    first = max(0, int(np.ceil((grid.start / (1.0 + clock) - series.start) * series.sample_rate_hz - 1e-9)))
    n_time = min(series.values.size - first, round(grid.length / step))
    own = series.start + np.arange(first, first + n_time) / series.sample_rate_hz
    values = series.values[first : first + n_time]
    freq = grid.freq_hz
    turn = np.exp(-2j * np.pi * freq * ((1.0 + clock) * own[0] - grid.start))
    transform = ZoomFFT(n_time, np.array([1, grid.n_freq + 1]) / grid.length, grid.n_freq, fs=1.0 / step)
    factor = step * turn * (2j * np.pi * freq if series.is_angle else 1.0)
    X: ComplexArray = factor * transform(values)
    return X, -2j * np.pi * freq * factor * transform(own * values)
