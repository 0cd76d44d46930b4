"""What every filter shares: schedule, gaps and blocks. A method adds its `Parameters`, its state and `_advance`."""

from __future__ import annotations

import math
from abc import abstractmethod
from copy import copy, deepcopy
from dataclasses import dataclass
from typing import TYPE_CHECKING, Annotated, Any, ClassVar, NamedTuple, Self

import numpy as np
from pydantic import Field

from testbed.fusion.belief import check_belief
from testbed.fusion.gate import Gate
from testbed.fusion.kernels.covariance import HEADER_ROWS, RATE, STD
from testbed.fusion.schedule import Schedule
from testbed.fusion.start import StartKind
from testbed.parts import Part
from testbed.units import Rate

if TYPE_CHECKING:
    from collections.abc import Mapping

    from numpy.typing import ArrayLike

    from testbed.fusion.analysis.finding import Finding
    from testbed.fusion.belief import SensorBelief
    from testbed.signals import FloatArray

# YAML gives the words.
Switch = Annotated[bool, Field(json_schema_extra={"type": ["boolean", "string"], "enum": [True, False, "on", "off"]})]

_UNITS = {
    "innovation": "rad/s",
    "innovation_variance": "rad^2/s^2",
    "R": "rad^2/s^2",
    "N": "rad^2/s^2",
    "Q_rate": "rad^2/s^2",
    "delay": "s",
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
        guard_hits counts how often a bound held R or Q so far.
    findings : tuple of Finding, optional
        What stands against the readings, where `estimate` looked (`testbed.fusion.analysis.verdict`).
    """

    rate: FloatArray
    std: FloatArray
    diagnostics: dict[str, FloatArray]
    findings: tuple[Finding, ...] = ()


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
        Rate of each sensor [Hz]; the fastest is an integer multiple of every other.
    parameters : Part
        The method's `Parameters`.

    Raises
    ------
    ValueError
        If a sensor has no belief, or a rate does not divide the fastest one.
    """

    Parameters: ClassVar[type[Part]]
    rows: Rows = Rows()
    # What a method promises; the contract tests hold every method to what it says here (docs/filters.md).
    needs_both: ClassVar[bool] = False
    """It divides the band between two sensors, and refuses one alone or three."""
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

    def __init__(
        self, belief: Mapping[str, SensorBelief], sample_rate_hz: Mapping[str, float], parameters: Part
    ) -> None:
        check_belief(belief, sample_rate_hz)
        if self.needs_both and len(sample_rate_hz) != 2:
            msg = f"belief: expected two sensors to divide the band between, got {list(sample_rate_hz)}"
            raise ValueError(msg)
        self.schedule = Schedule(sample_rate_hz)
        self._bias = np.array([[belief[name].bias] for name in self.schedule.sensors])
        self._gate = Gate(belief, self.schedule) if getattr(parameters, "gate", True) else None

    def __deepcopy__(self, memo: dict[int, Any]) -> Self:
        """Return a filter that goes on from here by itself; compiled functions are shared."""
        twin = copy(self)
        for name, value in vars(self).items():
            setattr(twin, name, value if callable(value) else deepcopy(value, memo))
        return twin

    @abstractmethod
    def _advance(self, Z: FloatArray, out: FloatArray) -> None:
        """Filter a block of any length, from the state that the last one left.

        Parameters
        ----------
        Z : ndarray, shape (n_sensor, n_time)
            Readings at the fastest rate [rad/s], read-only: NaN where none is due, infinite where one is missing.
        out : ndarray, shape (n_row, n_time)
            To be filled: rate, std [rad/s], then `rows`; NaN where undefined, as it comes.
        """

    def process(self, readings: Mapping[str, ArrayLike]) -> EstimateBlock:
        """Filter the next block.

        Parameters
        ----------
        readings : mapping of str to array_like, shape (n_sensor_samples,)
            Readings that are due in the block [rad/s]; not finite means predict only.

        Returns
        -------
        EstimateBlock
            At the fastest rate, shape (n_time,).

        Raises
        ------
        ValueError
            If a sensor is missing, unknown or has not as many readings as are due.
        """
        return self.estimated(*self.received(readings))

    def received(self, readings: Mapping[str, ArrayLike]) -> tuple[FloatArray, FloatArray]:
        """Return the readings of the next block as the filter sees them, and how many were struck out so far.

        Parameters
        ----------
        readings : mapping of str to array_like, shape (n_sensor_samples,)
            As for `process`.

        Returns
        -------
        Z, gated : ndarray, shape (n_sensor, n_time)
            Readings at the fastest rate [rad/s], NaN where none is due, infinite where one is missing; counts.
        """
        Z = self.schedule.spread(readings)
        gated = np.zeros_like(Z) if self._gate is None else self._gate.process(Z)
        # Only now: range and repetitions are those of the readings as they come.
        if self._bias.any():
            Z -= self._bias
        Z.flags.writeable = False
        return Z, gated

    def estimated(self, Z: FloatArray, gated: FloatArray) -> EstimateBlock:
        """Return the estimate over a block that was `received`; arguments as it returns them."""
        out = self._rows_of(Z.shape[1])
        self._advance(Z, out)
        return self._shown(out, gated)

    def blank(self, n_time: int) -> EstimateBlock:
        """Return a block in which everything is undefined: what the filter gives, without the work.

        Parameters
        ----------
        n_time : int
            Its length, at the fastest rate.
        """
        return self._shown(self._rows_of(n_time), np.zeros((len(self.schedule.sensors), n_time)))

    @property
    def step_seconds(self) -> float:
        """About how long a step takes, compiled, on a core of 2020 [s]; `benchmarks/bench_forecast.py` prints it."""
        return 3e-7

    def _rows_of(self, n_time: int) -> FloatArray:
        return np.full((HEADER_ROWS + len(self.rows.names(self.schedule.sensors)), n_time), np.nan)

    def _shown(self, out: FloatArray, gated: FloatArray) -> EstimateBlock:
        sensors = self.schedule.sensors
        rows = zip(self.rows.names(sensors), out[HEADER_ROWS:], strict=True)
        shown = {name: row for name, row in rows if name is not None}
        shown |= {f"gated_{name}": count for name, count in zip(sensors, gated, strict=True)}
        return EstimateBlock(out[RATE], out[STD], shown)
