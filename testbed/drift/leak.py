"""The audit of a compensation: what it removes, what survives of true rate, whether it learned what it should keep."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from testbed.allan import allan_deviation
from testbed.drift.findings import DRIFT_PERIOD, Audit
from testbed.drift.injection import (
    PERIODS,
    cutoff,
    earth_turns,
    heat_rate,
    line_gains,
    pattern_gain,
    sines,
    step,
    survivor,
    usable_periods,
)
from testbed.drift.quality import BLOCK, assess, block_std, described_to, smoothed
from testbed.signals import sample_times
from testbed.units import DEG_H

if TYPE_CHECKING:
    from collections.abc import Callable

    from testbed.compensation.record import GyroRecord
    from testbed.drift.injection import Compensate, LineGain
    from testbed.signals import FloatArray

# Fast sines are small against the noise of a reading (0.047 deg/h at 1 Hz), so that a method that adapts to the noise
# does not take them for it; slow ones, the step and what follows temperature are about the size of the drift.
FAST_SINE, SLOW_SINE, STEP = 0.01 * DEG_H, 0.05 * DEG_H, 0.05 * DEG_H  # rad/s
HEAT_STD = 0.05 * DEG_H  # rad/s


def find_leaks(
    compensate: Compensate,
    record: GyroRecord,
    plain: FloatArray,
    drift: FloatArray | None = None,
    tell: Callable[[str], None] = lambda _: None,
) -> Audit:
    """Return what a compensation does to a record and to known rates added to it.

    Parameters
    ----------
    compensate : callable
        Takes a record, returns the compensated rate [rad/s], shape (n_time,). A method that trains on the record that
        it corrects trains inside.
    record : GyroRecord
        To correct.
    plain : ndarray, shape (n_time,)
        Its compensated rate [rad/s].
    drift : ndarray, shape (n_time,), optional
        Its true thermal drift [rad/s], if a simulation knows it.
    tell : callable, optional
        Is told what is being done, for a terminal that waits.

    Returns
    -------
    Audit
        Figures and leaks.

    Raises
    ------
    ValueError
        If the record is too short to hold two periods of a rate in the drift band, has less than a reading in 100 s,
        no noise, or a temperature that never moves.
    """
    fs = record.sample_rate_hz
    if fs * BLOCK < 1.0:
        msg = f"sample_rate_hz: expected at least one reading in {BLOCK:g} s, got {fs:g} Hz"
        raise ValueError(msg)
    periods = usable_periods(record.rate.size, fs)
    if not periods or periods[-1] < DRIFT_PERIOD:
        least = 2.0 * next(period for period in PERIODS if period >= DRIFT_PERIOD)
        msg = (
            f"record: expected at least {least:g} s, so that a slow rate can be told from drift, "
            f"got {record.rate.size / fs:g} s"
        )
        raise ValueError(msg)
    if not np.ptp(record.temperature) > 0.0:
        msg = f"temperature: expected one that moves, got {record.temperature[0]:g} K throughout: nothing to compensate"
        raise ValueError(msg)
    gains, (step_gain, earth_gain, heat_gain) = _survival(compensate, record, plain, periods, tell)
    tell("fitting Allan curves")
    bandwidth, fitted_to = cutoff(gains), described_to(allan_deviation(record.rate, fs))
    return Audit(
        before=assess(record.rate, fs, fitted_to),
        after=assess(plain, fs, fitted_to),
        low_passed=None if bandwidth is None else assess(smoothed(record.rate, fs, bandwidth), fs, fitted_to),
        oracle=None if drift is None else assess(record.rate - drift, fs, fitted_to),
        gains=gains,
        step_gain=step_gain,
        earth_gain=earth_gain,
        heat_gain=heat_gain,
        bandwidth_hz=bandwidth,
        drift_reduction=None if drift is None else _reduction(drift, plain - (record.rate - drift), fs),
    )


def _survival(
    compensate: Compensate,
    record: GyroRecord,
    plain: FloatArray,
    periods: tuple[float, ...],
    tell: Callable[[str], None],
) -> tuple[tuple[LineGain, ...], tuple[float | None, float | None, float | None]]:
    """Return what survives of sines; and of a step, of Earth-rate steps and of a rate that follows temperature."""
    t = sample_times(0, record.rate.size, record.sample_rate_hz)
    tell("compensating it with known sines added")
    amplitudes = [SLOW_SINE if period >= DRIFT_PERIOD else FAST_SINE for period in periods]
    survived = survivor(compensate, record, plain, sines(t, periods, amplitudes))
    gains = line_gains(survived, record.sample_rate_hz, periods, amplitudes)

    def share(name: str, known: FloatArray) -> float | None:
        tell(f"compensating it with {name} added")
        try:
            return pattern_gain(survivor(compensate, record, plain, known), known)
        except ValueError as error:
            tell(f"it fails: {error}")
            return None

    return gains, (
        share("a known step", step(t, STEP)),
        share("Earth-rate steps", earth_turns(t)),
        share("a rate that follows temperature", heat_rate(record.temperature, HEAT_STD)),
    )


def _reduction(drift: FloatArray, rest: FloatArray, sample_rate_hz: float) -> float:
    left = block_std(rest, sample_rate_hz)
    return block_std(drift, sample_rate_hz) / left if left > 0.0 else np.inf
