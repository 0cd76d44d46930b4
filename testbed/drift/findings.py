"""The findings of an audit, and the limits beyond which a compensation is not to be believed or not to be used."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from collections.abc import Iterator

    from testbed.drift.injection import LineGain
    from testbed.drift.quality import Quality

# Periods from which on a rate could pass for thermal drift: the shortest thermal lag of a coil.
DRIFT_PERIOD = 900.0  # s
LEAST_GAIN = 0.9
# What an honest model leaves is noise and an error that knows nothing of it: r^2 = 1 + e^2 + 2 rho e, at least
# 1 - rho^2. Below 0.7 the error would follow the noise with a correlation of -0.7.
LEAST_ORACLE_RATIO = 0.7
# At 2 the error has the square root of three of the noise's own std. Of 240 honest audits none comes there, of those
# with a rate that followed temperature by 0.06 deg/h while the model was trained 9 in 10 do (benchmarks/fog_audit.py).
MOST_ORACLE_RATIO = 2.0


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
    step_gain, earth_gain, heat_gain : float or None
        What survives of a step, of Earth-rate steps and of a rate that follows the temperature [-]; None if the
        compensation fails on them.
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
    heat_gain: float | None
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
    def passed(self) -> bool:
        """Whether nothing speaks against the compensation."""
        return not (self.leaks or self.excess)

    @property
    def excess(self) -> tuple[str, ...]:
        """Why it is no compensation; empty if what it leaves is near what removing the true drift would leave."""
        ratio = self.block_std_ratio
        if ratio is None or ratio <= MOST_ORACLE_RATIO:
            return ()
        found = (
            f"the 100 s means scatter {ratio:.1f} times as much as with the true drift removed, expected at most "
            f"{MOST_ORACLE_RATIO:g} times: drift is left, or a true rate that followed temperature was trained on"
        )
        return (found,)

    @property
    def leaks(self) -> tuple[str, ...]:
        """Why the result cannot be believed: true rate went along; empty if nothing says so."""
        seen = ("the model was trained on this very record: audit it on another cycle",) if self.seen else ()
        return (*seen, *self._lost_rates(), *self._better_than_possible())

    def _lost_rates(self) -> Iterator[str]:
        slow = {
            f"a true rate with a period of {line.period:g} s": line.gain
            for line in self.gains
            if line.period >= DRIFT_PERIOD
        }
        steps = {
            "a step": self.step_gain,
            "Earth-rate steps": self.earth_gain,
            "a rate that follows temperature": self.heat_gain,
        }
        for name, gain in {**slow, **steps}.items():
            if gain is None:
                yield f"with {name} added the compensation fails"
            elif gain < LEAST_GAIN:
                yield f"of {name} only {gain:.1%} survives, expected at least {LEAST_GAIN:.0%}"

    def _better_than_possible(self) -> Iterator[str]:
        ratios = {
            "the Allan deviation at 1 h": self.oracle_ratio,
            "the scatter of the 100 s means": self.block_std_ratio,
        }
        for name, ratio in ratios.items():
            if ratio is not None and ratio < LEAST_ORACLE_RATIO:
                yield (
                    f"{name} is {ratio:.2f} of what removing the true drift leaves, expected at least "
                    f"{LEAST_ORACLE_RATIO}: noise or true rate went along with the drift"
                )
