"""The audit of a compensation: what it removes, what survives of true rate, whether it learned what it should keep."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from testbed.allan import allan_deviation
from testbed.drift.injection import (
    PERIODS,
    cutoff,
    earth_turns,
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
    from collections.abc import Callable, Iterator

    from testbed.compensation.record import GyroRecord
    from testbed.drift.injection import Compensate, LineGain
    from testbed.drift.quality import Quality
    from testbed.signals import FloatArray

# Periods from which on a rate could pass for thermal drift: the shortest thermal lag of a coil.
DRIFT_PERIOD = 900.0  # s
LEAST_GAIN = 0.9
LEAST_ORACLE_RATIO = 0.7
# Fast sines are small against the noise of a reading (0.047 deg/h at 1 Hz), so that a method that adapts to the noise
# does not take them for it; slow ones and the step are about the size of the drift.
FAST_SINE, SLOW_SINE, STEP = 0.01 * DEG_H, 0.05 * DEG_H, 0.05 * DEG_H  # rad/s


@dataclass(frozen=True)
class Audit:
    """What a compensation does to one record.

    Parameters
    ----------
    before, after : Quality
        Of the record and of the compensated one.
    low_passed : Quality or None
        Of the record through a plain low-pass of the compensation's bandwidth; None if the compensation does not cut
        the band.
    oracle : Quality or None
        Of the record less its true drift, which only a simulation knows.
    gains : tuple of LineGain
        What survives of sines, by rising period.
    step_gain, earth_gain : float or None
        What survives of a step and of Earth-rate steps [-]; None if the compensation fails on them.
    bandwidth_hz : float or None
        Where short periods begin to be lost [Hz]; None if they are not.
    drift_reduction : float or None
        Std of the 100 s means of the true drift over those of what is left of it [-]; None where the drift is not
        known.
    seen : bool, optional
        Whether this very record was trained on before: a frozen model passes every known rate, whatever it learned of
        the record's own.
    """

    before: Quality
    after: Quality
    low_passed: Quality | None
    oracle: Quality | None
    gains: tuple[LineGain, ...]
    step_gain: float | None
    earth_gain: float | None
    bandwidth_hz: float | None
    drift_reduction: float | None
    seen: bool = False

    @property
    def oracle_ratio(self) -> float | None:
        """Allan deviation at 1 h over that of the oracle [-]; None where either is not known."""
        if self.oracle is None or self.oracle.hour_deviation is None or self.after.hour_deviation is None:
            return None
        return self.after.hour_deviation / self.oracle.hour_deviation

    @property
    def block_std_ratio(self) -> float | None:
        """Std of the 100 s means over that of the oracle [-]; None where that is not known or zero."""
        if self.oracle is None or not self.oracle.block_std > 0.0:
            return None
        return self.after.block_std / self.oracle.block_std

    @property
    def leaks(self) -> tuple[str, ...]:
        """Why the result cannot be believed; empty if nothing speaks against it."""
        seen = ("the model was trained on this very record: audit it on another cycle",) if self.seen else ()
        return (*seen, *self._lost_rates(), *self._better_than_possible())

    def _lost_rates(self) -> Iterator[str]:
        slow = {
            f"a true rate with a period of {line.period:g} s": line.gain
            for line in self.gains
            if line.period >= DRIFT_PERIOD
        }
        for name, gain in {**slow, "a step": self.step_gain, "Earth-rate steps": self.earth_gain}.items():
            if gain is None:
                yield f"with {name} added the compensation fails"
            elif gain < LEAST_GAIN:
                yield f"of {name} only {gain:.1%} survives, expected at least {LEAST_GAIN:.0%}"

    def _better_than_possible(self) -> Iterator[str]:
        ratio = self.oracle_ratio
        if ratio is not None and ratio < LEAST_ORACLE_RATIO:
            yield (
                f"the Allan deviation at 1 h is {ratio:.2f} of what removing the true drift leaves, expected at least "
                f"{LEAST_ORACLE_RATIO}: noise or true rate went along with the drift"
            )


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
        If the record is too short to hold two periods of a rate in the drift band, has less than a reading in 100 s, or
        no noise.
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
    gains, step_gain, earth_gain = _survival(compensate, record, plain, periods, tell)
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
        bandwidth_hz=bandwidth,
        drift_reduction=None if drift is None else _reduction(drift, plain - (record.rate - drift), fs),
    )


def _survival(
    compensate: Compensate,
    record: GyroRecord,
    plain: FloatArray,
    periods: tuple[float, ...],
    tell: Callable[[str], None],
) -> tuple[tuple[LineGain, ...], float | None, float | None]:
    """Return what survives of sines, of a step and of Earth-rate steps."""
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

    return gains, share("a known step", step(t, STEP)), share("Earth-rate steps", earth_turns(t))


def _reduction(drift: FloatArray, rest: FloatArray, sample_rate_hz: float) -> float:
    left = block_std(rest, sample_rate_hz)
    return block_std(drift, sample_rate_hz) / left if left > 0.0 else np.inf
