"""What one block of a run holds, and the one list of what a run keeps."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping

    import numpy as np
    from numpy.typing import NDArray

    from testbed.fusion.base import EstimateBlock
    from testbed.models.motion import CommandBlock
    from testbed.models.turntable.truth import TruthBlock
    from testbed.pointing.line_of_sight import PointingBlock
    from testbed.signals import FloatArray

# Base samples between poses of the bodies and between profiles of a fluid.
POSE_STRIDE = 400
# Of a line of sight, what a run keeps.
POINTING_SIGNALS = ("residual", "knowledge", "tracker_only", "mirror")


@dataclass(frozen=True)
class Ticked:
    """When a sensor with a clock of its own read in a block.

    Parameters
    ----------
    first : int
        Number of its first reading.
    times, truth : ndarray, shape (n_reading,)
        True instants [s], and the true rate there [rad/s].
    time_ns : ndarray of int, shape (n_reading,)
        What the logger wrote [ns].
    """

    first: int
    times: FloatArray
    truth: FloatArray
    time_ns: NDArray[np.int64]


@dataclass(frozen=True)
class RunBlock:
    """Everything that one block of the chain produced.

    Parameters
    ----------
    start : int
        Index of its first base sample.
    command, truth : CommandBlock, TruthBlock
        What was commanded and what happened.
    sensors : mapping
        Readings [rad/s] by sensor, those that fall due in the block.
    fusion : mapping
        Estimates by filter.
    profiles : mapping
        By MHD sensor: heights [m], shape (n_height,), and velocity profiles at the pose samples, shape (n_pose,
        n_height).
    temperatures, drifts : mapping
        By sensor with a thermometer inside: its readings [K], as many as of the rate, and the true thermal bias
        [rad/s].
    pointing : mapping
        What is left of the line of sight, by filter that feeds a mirror forward.
    ticked : mapping
        By sensor with a clock of its own: when it read.
    """

    start: int
    command: CommandBlock
    truth: TruthBlock
    sensors: Mapping[str, FloatArray]
    fusion: Mapping[str, EstimateBlock]
    profiles: Mapping[str, tuple[FloatArray, FloatArray]]
    temperatures: Mapping[str, FloatArray] = field(default_factory=dict)
    drifts: Mapping[str, FloatArray] = field(default_factory=dict)
    pointing: Mapping[str, PointingBlock] = field(default_factory=dict)
    ticked: Mapping[str, Ticked] = field(default_factory=dict)

    @property
    def n_time(self) -> int:
        """Number of base samples."""
        return self.command.n_time


@dataclass(frozen=True)
class PlayedBlock:
    """What the filters made of one block of a recording.

    Parameters
    ----------
    start, n_time : int
        First sample of the base clock, which is that of the fastest sensor, and how many there are.
    first : mapping of str to int
        Index of the first reading of each sensor in the block.
    reference : ndarray, shape (n_time,), optional
        What is taken for the truth [rad/s], NaN where it is not known; None if the recording has none.
    sensors : mapping
        Readings [rad/s] by sensor.
    fusion : mapping
        Estimates by filter, on the base clock.
    """

    start: int
    n_time: int
    first: Mapping[str, int]
    reference: FloatArray | None
    sensors: Mapping[str, FloatArray]
    fusion: Mapping[str, EstimateBlock]


Column = tuple[str, str, int, float, "FloatArray"]


def columns(block: RunBlock | PlayedBlock, rates: Mapping[str, float]) -> Iterator[Column]:
    """Yield every signal of a block as (group, name, start index, sample rate [Hz], values): the one list of what a run
    keeps.

    Parameters
    ----------
    block : RunBlock or PlayedBlock
        A block of the chain, or of a recording.
    rates : mapping
        Sample rate [Hz] of ``base`` and of every sensor and filter by its name.
    """
    yield from _played(block, rates) if isinstance(block, PlayedBlock) else _simulated(block, rates)


def _played(block: PlayedBlock, rates: Mapping[str, float]) -> Iterator[Column]:
    if block.reference is not None:
        yield "truth", "rate", block.start, rates["base"], block.reference
    for name, values in block.sensors.items():
        yield f"sensors/{name}", "rate", block.first[name], rates[name], values
    for name, estimate in block.fusion.items():
        yield from _estimated(name, estimate, block.start, rates[name])


def _simulated(block: RunBlock, rates: Mapping[str, float]) -> Iterator[Column]:
    base = rates["base"]
    n = block.n_time
    yield "commanded", "rate", block.start, base, block.command.rate[:n]
    yield "truth", "rate", block.start, base, block.truth.rate
    yield "truth", "angle", block.start, base, block.truth.angle
    for name, values in block.truth.sensor_rate.items():
        yield "truth", f"{name}_rate", block.start, base, values
    for name, values in block.drifts.items():
        yield "truth", f"{name}_drift", block.start, base, values
    for name, values in block.sensors.items():
        start = block.ticked[name].first if name in block.ticked else first_due(block.start, base, rates[name])
        yield f"sensors/{name}", "rate", start, rates[name], values
        if name in block.temperatures:
            yield f"sensors/{name}", "temperature", start, rates[name], block.temperatures[name]
    for name, estimate in block.fusion.items():
        yield from _estimated(name, estimate, first_due(block.start, base, rates[name]), rates[name])
    for name, sight in block.pointing.items():
        for signal in POINTING_SIGNALS:
            yield f"pointing/{name}", signal, block.start, base, getattr(sight, signal)


def _estimated(name: str, estimate: EstimateBlock, start: int, rate: float) -> Iterator[Column]:
    for signal, values in (("rate", estimate.rate), ("std", estimate.std), *estimate.diagnostics.items()):
        yield f"fusion/{name}", signal, start, rate, values


def clock_of(group: str) -> str:
    """Return whose clock a group of a recording has: that of its sensor, or ``base``, that of filters and reference.

    Parameters
    ----------
    group : str
        Such as ``sensors/mems_gyro``.
    """
    kind, _, name = group.partition("/")
    return name if kind == "sensors" else "base"


def first_due(start: int, base_rate_hz: float, sample_rate_hz: float) -> int:
    """Return the index of the first sample of a slower clock that falls on or after base sample `start`."""
    return -(-start // round(base_rate_hz / sample_rate_hz))
