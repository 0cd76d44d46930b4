"""What every filter shares: schedule, gaps and blocks. A method adds its `Parameters`, its state and `_advance`."""

from __future__ import annotations

import math
from abc import abstractmethod
from copy import copy, deepcopy
from dataclasses import dataclass
from typing import TYPE_CHECKING, Annotated, Any, ClassVar, NamedTuple, Self

import numpy as np
from pydantic import Field

from testbed.errors import quoted
from testbed.fusion.belief import check_belief
from testbed.fusion.gate import Gate
from testbed.fusion.kernels.covariance import HEADER_ROWS, RATE, STD
from testbed.fusion.kernels.merging import show_steps
from testbed.fusion.schedule import Schedule, odd_sensor
from testbed.fusion.stamps import Stamps, Timing
from testbed.fusion.start import StartKind
from testbed.fusion.transitions import EVEN, Steps, steps_of
from testbed.parts import Part
from testbed.units import Rate

if TYPE_CHECKING:
    from collections.abc import Iterable, Mapping

    from numpy.typing import ArrayLike, NDArray

    from testbed.fusion.analysis.finding import Finding
    from testbed.fusion.analysis.indicator import FrequencyRows
    from testbed.fusion.belief import SensorBelief
    from testbed.signals import FloatArray

# Steps between stamps that are taken at a time.
_PART = 4000
# YAML gives the words.
Switch = Annotated[bool, Field(json_schema_extra={"type": ["boolean", "string"], "enum": [True, False, "on", "off"]})]

_UNITS = {
    "innovation": "rad/s",
    "innovation_variance": "rad^2/s^2",
    "R": "rad^2/s^2",
    "N": "rad^2/s^2",
    "Q_rate": "rad^2/s^2",
    "delay": "s",
    "frequency": "Hz",
}


def diagnostic_unit(name: str) -> str:
    """Return the SI unit of the diagnostic `name` of an `EstimateBlock` ("1" for bands, factors and counts)."""
    stem = next((key for key in sorted(_UNITS, key=len, reverse=True) if name == key or name.startswith(key + "_")), "")
    return _UNITS.get(stem, "1")


@dataclass(frozen=True)
class EstimateBlock:
    """Estimate over a block, at the fastest sensor rate.

    Parameters
    ----------
    rate, std : ndarray, shape (n_time,)
        Estimated rate and its reported standard deviation [rad/s].
    diagnostics : dict of str to ndarray, shape (n_time,)
        As far as the filter has them, NaN where undefined (such as between the readings of a slow sensor). Innovations
        are those of (11), before any sensor of that instant is used, and their variance is H P_prior H' + R of (33).
        R_<sensor> is the value in force for that reading, before the factor S_<sensor> of (36). N_<sensor> is N_k / dT
        of (30) [rad^2/s^2]; band_<sensor> 0 low, 1 mid, 2 high; Q_rate the variance that a step adds to the rate;
        guard_hits counts how often a bound held R or Q so far; frequency_<sensor> [Hz] is what `FrequencyRows` reads
        off that sensor. Of readings with stamps, what belongs to one of another sensor stands at the next stamp of the
        fastest one, and late_<sensor> counts those that came too late so far.
    time_ns : ndarray of int, shape (n_time,), optional
        Stamps of the fastest sensor [ns], of readings that have some; those that came too late are left out.
    findings : tuple of Finding, optional
        What stands against the readings, where `estimate` looked (`testbed.fusion.analysis.verdict`).
    """

    rate: FloatArray
    std: FloatArray
    diagnostics: dict[str, FloatArray]
    time_ns: NDArray[np.int64] | None = None
    findings: tuple[Finding, ...] = ()


class Received(NamedTuple):
    """The readings of a block as a filter sees them.

    Parameters
    ----------
    Z, gated : ndarray, shape (n_sensor, n_step)
        Readings [rad/s], read-only: NaN where none is due, infinite where one is missing; counts of those struck out.
    timing : Timing, optional
        When they came, of readings that do not come at regular steps.
    """

    Z: FloatArray
    gated: FloatArray
    timing: Timing | None = None


class Rows(NamedTuple):
    """Names of the rows of a filter's output in their order, behind rate and std; None is not shown.

    Parameters
    ----------
    once : tuple of str
        Rows that stand there once.
    per_sensor : tuple of str
        Rows that each sensor has, one sensor after the other; shown as ``<name>_<sensor>``.
    """

    once: tuple[str | None, ...] = ()
    per_sensor: tuple[str | None, ...] = ()

    def names(self, sensors: tuple[str, ...]) -> list[str | None]:
        """Return the name of each row for these sensors."""
        return [*self.once, *(name and f"{name}_{sensor}" for sensor in sensors for name in self.per_sensor)]


class CommonParameters(Part):
    """Parameters that every shipped filter has.

    Parameters
    ----------
    start : {"unknown", "rest"}
        What is known before the first reading: nothing, the record may begin in mid-motion, or that everything rests.
    rest_rate : float
        The constant rate of that rest, such as the Earth's share about the axis [rad/s].
    gate : bool
        Strike out readings that are none before the filter sees them (`testbed.fusion.gate`); on or off.
    """

    start: StartKind = "unknown"
    rest_rate: Rate = 0.0
    gate: Switch = True


class BlockFilter:
    """Base of every filter: checks the blocks, spreads their readings over the fastest rate, names what comes out.

    A method gives three things: its `Parameters`; its state, in `__init__`; and `_advance`, which fills the rows of a
    block. What it shows beside rate and std it names in `rows`.

    Parameters
    ----------
    belief : mapping of str to SensorBelief
        What is believed about each sensor.
    sample_rate_hz : mapping of str to float
        Rate of each sensor [Hz]; unless the method says `any_clock`, the fastest is an integer multiple of every other.
    parameters : Part
        The method's `Parameters`.

    Raises
    ------
    ValueError
        If a sensor has no belief, or a rate does not divide the fastest one and the method needs it to.
    """

    Parameters: ClassVar[type[Part]]
    rows: Rows = Rows()
    # What a method promises; the contract tests hold every method to what it says here (docs/filters.md).
    needs_both: ClassVar[bool] = False
    """It divides the band between two sensors, and refuses one alone or three."""
    any_clock: ClassVar[bool] = False
    """It steps from stamp to stamp: rates in any ratio, jitter, late and missing readings."""
    caution: ClassVar[str] = ""
    """Where it does not hold; printed beside its results."""
    start_leaves: ClassVar[tuple[float, float] | None] = None
    """Rms error 10 s after a start in mid-motion, and inside 6 deg/s [rad/s]: at most; None promises nothing."""
    fault_leaves: ClassVar[tuple[float, float]] = (math.radians(1.5), math.radians(0.1))
    """Error while a sensor is lost or lies for a second of 3 Hz, 1 deg/s, and rms 3 s later [rad/s]: at most."""
    departs: ClassVar[Mapping[str, tuple[float, float]]] = {}
    """Ranges of ``nees`` and ``nis_<sensor>`` where its own model is the truth, if it is not consistent even then."""
    dishonest: ClassVar[str] = ""
    """Why the claimed standard deviation is not the error's, if it is not."""
    frequency: FrequencyRows | None = None
    """What its runs show of the frequency of the signal, beside what it estimates; nothing unless it says so."""

    def __init__(
        self, belief: Mapping[str, SensorBelief], sample_rate_hz: Mapping[str, float], parameters: Part
    ) -> None:
        check_belief(belief, sample_rate_hz)
        if self.needs_both and len(sample_rate_hz) != 2:
            msg = f"belief: expected two sensors to divide the band between, got {list(sample_rate_hz)}"
            raise ValueError(msg)
        if not self.any_clock and (odd := odd_sensor(sample_rate_hz)):
            fastest, value = max(sample_rate_hz.values()), sample_rate_hz[odd]
            msg = (
                f"sample_rate_hz: expected {fastest:g} Hz to be an integer multiple of {quoted(odd)} for "
                f"{type(self).__name__}, got {value:g} Hz; `kalman` takes any"
            )
            raise ValueError(msg)
        self.schedule = Schedule(sample_rate_hz, any_ratio=True)
        self._stamps: Stamps | None = None if self.schedule.even else Stamps(sample_rate_hz)
        self._pending: FloatArray | None = None
        self._bias = np.array([[belief[name].bias] for name in self.schedule.sensors])
        self._gate = Gate(belief, self.schedule) if getattr(parameters, "gate", True) else None

    def __deepcopy__(self, memo: dict[int, Any]) -> Self:
        """Return a filter that goes on from here by itself; compiled functions are shared."""
        twin = copy(self)
        for name, value in vars(self).items():
            setattr(twin, name, value if callable(value) else deepcopy(value, memo))
        return twin

    @abstractmethod
    def _advance(self, Z: FloatArray, out: FloatArray, steps: Steps = EVEN) -> None:
        """Filter a block of any length, from the state that the last one left.

        Parameters
        ----------
        Z : ndarray, shape (n_sensor, n_time)
            Readings at the fastest rate [rad/s], read-only: NaN where none is due, infinite where one is missing.
        out : ndarray, shape (n_row, n_time)
            To be filled: rate, std [rad/s], then `rows`; NaN where undefined, as it comes.
        steps : Steps, optional
            How each step is reached; a method that does not say `any_clock` is not given it and need not take it.
        """

    def check_clocks(self) -> None:
        """Raise ValueError if the filter, as it is set, takes no readings with stamps or of odd rates."""
        if not self.any_clock:
            msg = (
                f"time_ns: {type(self).__name__} takes readings at regular steps only, no stamps; "
                "resample them, or take `kalman`"
            )
            raise ValueError(msg)

    def process(
        self, readings: Mapping[str, ArrayLike], time_ns: Mapping[str, ArrayLike] | None = None
    ) -> EstimateBlock:
        """Filter the next block.

        Parameters
        ----------
        readings : mapping of str to array_like, shape (n_sensor_samples,)
            Readings of every sensor in the block [rad/s], those that are due if there are no stamps; not finite means
            predict only.
        time_ns : mapping of str to array_like of int, shape (n_sensor_samples,), optional
            Their stamps [ns], from any epoch that all sensors share; in every block or in none. They need not be
            regular. A reading older than the last one of the block before is dropped and counted (`late_<sensor>`), so
            blocks are best cut at an instant: those of all sensors before it here, the others next.

        Returns
        -------
        EstimateBlock
            At the fastest rate, or at the stamps of the fastest sensor, shape (n_time,).

        Raises
        ------
        ValueError
            If a sensor is missing, unknown or has not as many readings as are due, or the method takes no stamps.
        """
        return self.estimated(*self.received(readings, time_ns))

    def front(self) -> tuple[Any, ...]:
        """Return what `received` depends on beside the readings so far: filters with an equal one receive the same."""
        gate = None if self._gate is None else self._gate.key()
        return self.schedule.sensors, self.schedule.rates_hz, self._bias.tobytes(), gate

    def received(self, readings: Mapping[str, ArrayLike], time_ns: Mapping[str, ArrayLike] | None = None) -> Received:
        """Return the readings of the next block as the filter sees them, and how many were struck out so far.

        Parameters
        ----------
        readings, time_ns : mapping of str to array_like, shape (n_sensor_samples,)
            As for `process`.
        """
        Z, timing = self._spread(readings, time_ns)
        # Of zeros that nobody writes to there is one page, where those of `zeros_like` are all there.
        gated = np.zeros(Z.shape) if self._gate is None else self._gate.process(Z)
        # Only now: range and repetitions are those of the readings as they come.
        if self._bias.any():
            Z -= self._bias
        Z.flags.writeable = False
        return Received(Z, gated, timing)

    def _spread(
        self, readings: Mapping[str, ArrayLike], time_ns: Mapping[str, ArrayLike] | None
    ) -> tuple[FloatArray, Timing | None]:
        if time_ns is None and self._stamps is None:
            return self.schedule.spread(readings), None
        self.check_clocks()
        if self._stamps is None and not self.schedule.begun:
            self._stamps = Stamps(dict(zip(self.schedule.sensors, self.schedule.rates_hz, strict=True)))
        if self._stamps is None or (time_ns is None and self.schedule.even):
            msg = "time_ns: expected stamps in every block or in none"
            raise ValueError(msg)
        return self._stamps.spread(readings, self._stamps.implied(readings) if time_ns is None else time_ns)

    def estimated(self, Z: FloatArray, gated: FloatArray, timing: Timing | None = None) -> EstimateBlock:
        """Return the estimate over a block that was `received`; arguments as it returns them."""
        if timing is None:
            out = self._rows_of(Z.shape[1])
            self._advance(Z, out)
            return self._shown(out, gated)
        if self._pending is None:
            self._pending = np.full(len(self._rows_of(0)), np.nan)
        n_time = timing.time_ns.size
        kept, begin = np.empty((self._pending.size, n_time)), 0
        # In parts that stay in the processor's cache, all in one place, which is undefined whenever one begins.
        room = np.full(self._pending.size * min(_PART, Z.shape[1]), np.nan)
        for first in range(0, Z.shape[1], _PART):
            part = slice(first, first + _PART)
            shown = timing.shown[part]
            out = room[: self._pending.size * shown.size].reshape(self._pending.size, shown.size)
            self._advance(_read_only(Z[:, part]), out, steps_of(timing.length[part]))
            show_steps(out, shown, HEADER_ROWS, self._pending, kept, begin)
            begin += int(np.count_nonzero(shown))
        return self._timed(self._shown(kept, [row[timing.shown] for row in gated]), timing.late, timing.time_ns)

    def _timed(self, block: EstimateBlock, late: NDArray[np.int64], time_ns: NDArray[np.int64]) -> EstimateBlock:
        counts = zip(self.schedule.sensors, late, strict=True)
        late_rows = {f"late_{name}": np.full(time_ns.size, float(count)) for name, count in counts}
        return EstimateBlock(block.rate, block.std, block.diagnostics | late_rows, time_ns)

    def blank(self, n_time: int, *, timed: bool = False) -> EstimateBlock:
        """Return a block in which everything is undefined: what the filter gives, without the work.

        Parameters
        ----------
        n_time : int
            Its length, at the fastest rate.
        timed : bool, optional
            Whether it is one of readings with stamps.
        """
        sensors = self.schedule.sensors
        block = self._shown(self._rows_of(n_time), np.zeros((len(sensors), n_time)))
        if not timed:
            return block
        return self._timed(block, np.zeros(len(sensors), np.int64), np.zeros(n_time, np.int64))

    @property
    def step_seconds(self) -> float:
        """About how long a step takes, compiled, on a core of 2020 [s]; `benchmarks/bench_forecast.py` prints it."""
        return 3e-7

    def _rows_of(self, n_time: int) -> FloatArray:
        return np.full((HEADER_ROWS + len(self.rows.names(self.schedule.sensors)), n_time), np.nan)

    def _shown(self, out: FloatArray, gated: Iterable[FloatArray]) -> EstimateBlock:
        sensors = self.schedule.sensors
        rows = zip(self.rows.names(sensors), out[HEADER_ROWS:], strict=True)
        shown = {name: row for name, row in rows if name is not None}
        shown |= {f"gated_{name}": count for name, count in zip(sensors, gated, strict=True)}
        return EstimateBlock(out[RATE], out[STD], shown)


def _read_only(values: FloatArray) -> FloatArray:
    kept = np.ascontiguousarray(values)
    kept.flags.writeable = False
    return kept
