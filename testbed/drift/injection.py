"""Known rates added to a record, and how much of them comes out of a compensation.

The compensation runs twice, on the record and on the record plus a known rate; the difference of the two outputs is
what survives of that rate, noise and drift cancelling as far as the compensation is linear. A compensation that trains
on the record it corrects trains anew both times.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from testbed.models.turntable.earth import SPEED
from testbed.signals import sample_times

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from testbed.compensation.record import GyroRecord
    from testbed.signals import ComplexArray, FloatArray

    Compensate = Callable[[GyroRecord], FloatArray]

PERIODS = (10.0, 20.0, 40.0, 60.0, 100.0, 200.0, 400.0, 600.0, 1000.0, 2000.0, 3600.0, 7200.0, 21600.0)  # s
# Samples per period below which a sine says nothing about the compensation, and periods per record below which it
# cannot be told from a trend.
_SAMPLES, _CYCLES = 4.0, 2.0
# Of golden-angle phases: the sum of many sines stays low.
_TURN = np.pi * (3.0 - np.sqrt(5.0))


@dataclass(frozen=True)
class LineGain:
    """What survives of a sine.

    Parameters
    ----------
    period : float
        [s].
    gain : float
        Amplitude out over amplitude in [-].
    phase : float
        Of the output against the input, lead positive [rad].
    """

    period: float
    gain: float
    phase: float


def usable_periods(n_time: int, sample_rate_hz: float, periods: Sequence[float] = PERIODS) -> tuple[float, ...]:
    """Return the periods [s] that a record of `n_time` samples resolves: four samples each, two periods in the record.

    Parameters
    ----------
    n_time : int
        Number of samples.
    sample_rate_hz : float
        Their rate [Hz].
    periods : sequence of float, optional
        To choose from [s].
    """
    duration = n_time / sample_rate_hz
    return tuple(p for p in periods if p * sample_rate_hz >= _SAMPLES and _CYCLES * p <= duration)


def sines(t: FloatArray, periods: Sequence[float], amplitudes: Sequence[float]) -> FloatArray:
    r"""Return the sum of sines :math:`\sum_k A_k \sin(2 \pi t / T_k + k \varphi)`, with golden-angle phases.

    Parameters
    ----------
    t : ndarray, shape (n_time,)
        Time [s].
    periods : sequence of float
        T_k [s].
    amplitudes : sequence of float
        A_k [rad/s].

    Returns
    -------
    ndarray, shape (n_time,)
        Rate [rad/s].
    """
    rate = np.zeros(t.size)
    for k, (period, amplitude) in enumerate(zip(periods, amplitudes, strict=True)):
        rate += amplitude * np.sin(2.0 * np.pi * t / period + k * _TURN)
    return rate


def step(t: FloatArray, size: float) -> FloatArray:
    """Return zero in the first half of the record and `size` [rad/s] from the middle on, shape (n_time,).

    Parameters
    ----------
    t : ndarray, shape (n_time,)
        Time [s].
    size : float
        [rad/s].
    """
    return np.where(np.arange(t.size) >= t.size // 2, size, 0.0)


def earth_turns(t: FloatArray, latitude: float = np.pi / 4.0) -> FloatArray:
    r"""Return the Earth rate about an axis that a table turns by 90 degrees eight times over the record.

    The axis points up, level east, down, level west, and so on: :math:`\Omega \sin\phi` times 1, 0, -1, 0.

    Parameters
    ----------
    t : ndarray, shape (n_time,)
        Time [s].
    latitude : float, optional
        [rad].

    Returns
    -------
    ndarray, shape (n_time,)
        Rate [rad/s].
    """
    turn = 8 * np.arange(t.size) // t.size
    rate: FloatArray = SPEED * np.sin(latitude) * np.array([1.0, 0.0, -1.0, 0.0])[turn % 4]
    return rate


def heat_rate(temperature: FloatArray, std: float) -> FloatArray:
    """Return a rate [rad/s], shape (n_time,), proportional to the temperature about its mean.

    Parameters
    ----------
    temperature : ndarray, shape (n_time,)
        One that moves [K].
    std : float
        Standard deviation of the rate [rad/s].
    """
    heat = temperature - temperature.mean()
    rate: FloatArray = std / heat.std() * heat
    return rate


def survivor(compensate: Compensate, record: GyroRecord, plain: FloatArray, injected: FloatArray) -> FloatArray:
    """Return what comes out of `injected` [rad/s], shape (n_time,): the output with it minus the output without.

    Parameters
    ----------
    compensate : callable
        Takes a record, returns the compensated rate [rad/s], shape (n_time,).
    record : GyroRecord
        Without the injected rate.
    plain : ndarray, shape (n_time,)
        Its compensated rate [rad/s].
    injected : ndarray, shape (n_time,)
        [rad/s].
    """
    return compensate(replace(record, rate=record.rate + injected)) - plain


def line_gains(
    survived: FloatArray, sample_rate_hz: float, periods: Sequence[float], amplitudes: Sequence[float]
) -> tuple[LineGain, ...]:
    """Return gain and phase of each sine of `sines` in what survived, all fitted together with a constant.

    Parameters
    ----------
    survived : ndarray, shape (n_time,)
        [rad/s].
    sample_rate_hz : float
        [Hz].
    periods : sequence of float
        [s].
    amplitudes : sequence of float
        Of the sines that went in [rad/s].
    """
    t = sample_times(0, survived.size, sample_rate_hz)
    angles = [2.0 * np.pi * t / period + k * _TURN for k, period in enumerate(periods)]
    columns = np.stack([f(angle) for angle in angles for f in (np.sin, np.cos)] + [np.ones(t.size)], axis=1)
    solution: FloatArray = np.linalg.lstsq(columns, survived, rcond=None)[0]
    gains: ComplexArray = (solution[:-1:2] + 1j * solution[1:-1:2]) / np.asarray(amplitudes)
    return tuple(
        LineGain(period, float(abs(gain)), float(np.angle(gain))) for period, gain in zip(periods, gains, strict=True)
    )


def pattern_gain(survived: FloatArray, injected: FloatArray) -> float:
    """Return the share [-] of a pattern such as `step` that survived: the slope of the regression of output on input.

    Parameters
    ----------
    survived, injected : ndarray, shape (n_time,)
        Output and input [rad/s].
    """
    centred = injected - injected.mean()
    return float(centred @ (survived - survived.mean()) / (centred @ centred))


def cutoff(gains: Sequence[LineGain]) -> float | None:
    """Return the bandwidth [Hz]: where the gain, coming from the shortest period, first reaches 1/sqrt(2).

    Interpolated in the logarithms between two lines; None if the shortest period passes already, or none does.

    Parameters
    ----------
    gains : sequence of LineGain
        In the order of rising period.
    """
    passing = next((k for k, line in enumerate(gains) if line.gain >= np.sqrt(0.5)), None)
    if not passing:
        return None
    below, above = gains[passing - 1], gains[passing]
    low, high = np.log(max(below.gain, 1e-6)), np.log(above.gain)
    share = (0.5 * np.log(0.5) - low) / (high - low)
    return float(1.0 / (below.period * (above.period / below.period) ** share))
