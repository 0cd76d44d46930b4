"""The Rerun recording of a run, written block by block into one file that opens with its own layout."""

from __future__ import annotations

import contextlib
import shutil
import threading
import time
from pathlib import Path
from typing import TYPE_CHECKING, Any, Self

import numpy as np
import rerun as rr
from rerun.chunk import RrdReader

from testbed.errors import RunError
from testbed.pages.palette import series_colors
from testbed.recording.channel import Channel
from testbed.recording.layout import LOG, blueprint
from testbed.recording.marks import PREFIX, GateMarks
from testbed.recording.shown import ShownRate
from testbed.recording.stream import Clock, Recording, Signal
from testbed.recording.target import Target
from testbed.recording.world import World
from testbed.runs.attributes import unit_of
from testbed.runs.block import POSE_STRIDE, PlayedBlock, clock_of

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence
    from types import TracebackType

    import mujoco
    from numpy.typing import NDArray

    from testbed.runs.block import RunBlock
    from testbed.signals import FloatArray
    from testbed.units import RateUnit

APPLICATION = "testbed"
FULL = 1 << 20  # bytes; with less room than this a disk is called full
LET_GO_TIMEOUT = 2.0  # s; closing takes milliseconds
FLUSH_TIMEOUT = 60.0  # s; a disk slower than this for the last few MB is taken for a failure


class RecordingWriter:
    """Write a run to an .rrd file: bodies, rates, errors, temperatures, diagnostics and velocity profiles on the
    timeline `sim_time`.

    Rates are in the unit of the run, which terminal and report show too; all else is in SI but angles, in µrad. A
    signal has real samples only: the two extremes of each 4000th of the run, the first and the last sample,
    and, if it is a rate or an error, every sample inside `detail`. A lost reading leaves a gap in the line (NaN); what
    is NaN in a diagnostic was not due and is left out.

    Parameters
    ----------
    path : Path
        File to be written.
    scenario_name : str
        Name of the recording.
    sample_rate_hz : float
        Base rate [Hz].
    n_time : int
        Number of base samples of the run.
    sensor_rates : mapping of str to float
        Rate of each sensor [Hz], a divisor of the base rate.
    fusion_names : sequence of str
        Filters, whose estimates come at the rate of the fastest sensor.
    model : mujoco.MjModel, optional
        Bodies of the turntable; a recording that is replayed has none.
    unit : {"deg/s", "deg/h"}
        Of every rate, and squared of its variances.
    settle : float
        Start of the part that is judged [s].
    detail : tuple of float, optional
        Start and end of the window recorded sample by sample [s]; by default the 2 s after `settle`.
    pose_stride : int
        Base samples between poses and between profiles.
    times_ns : mapping of str to ndarray, shape (n_time,), optional
        Stamps [ns] of sensors, and of ``base``, that are no multiples of one step.
    live : str, optional
        Address of a viewer that shows it while it is written.

    Raises
    ------
    RunError
        If the file cannot be written.
    """

    def __init__(
        self,
        path: Path,
        *,
        scenario_name: str,
        sample_rate_hz: float,
        n_time: int,
        sensor_rates: Mapping[str, float],
        fusion_names: Sequence[str],
        model: mujoco.MjModel | None,
        unit: RateUnit,
        settle: float,
        detail: tuple[float, float] | None = None,
        pose_stride: int = POSE_STRIDE,
        times_ns: Mapping[str, NDArray[np.int64]] | None = None,
        live: str | None = None,
    ) -> None:
        self._path, self._live = Path(path), live
        self._shown = ShownRate(unit)
        self._model, self._pose_stride, self._times = model, pose_stride, times_ns
        self._strides = {name: round(sample_rate_hz / rate) for name, rate in sensor_rates.items()}
        self._fusion_names = list(fusion_names)
        self._fusion_stride = min(self._strides.values(), default=1)
        self._colors = series_colors(list(sensor_rates), self._fusion_names)
        # The viewer draws in alphabetical order: what comes first is the widest, and is seen beside what hides it.
        self._widths = {name: max(4.0 * 0.7**k, 1.2) for k, name in enumerate(sorted(self._fusion_names))}
        self._stream = rr.RecordingStream(APPLICATION, send_properties=False)
        try:
            if live is None:
                self._stream.save(self._path)
            else:
                self._stream.set_sinks(rr.GrpcSink(live), rr.FileSink(self._path))
        except RuntimeError as error:
            raise self._failure(str(error)) from error
        self._stream.send_recording_name(scenario_name)
        self._recording = Recording(
            self._stream, Clock(sample_rate_hz, n_time, detail or (settle, settle + 2.0)), live=live is not None
        )
        self._signals: dict[str, Signal] = {}
        bodies = {name: self._colors[f"sensors/{name}"] for name in sensor_rates}
        self._world = None if model is None else World(self._recording, model, bodies)
        self._channels: dict[str, Channel] = {}
        self._target: Target | None = None
        self._marks: dict[str, GateMarks] = {}
        self._settle = settle
        self._moved = self._laid_out = False
        self._open = True

    def write(self, block: RunBlock | PlayedBlock) -> None:
        """Add the next block of the run."""
        if isinstance(block, PlayedBlock):
            self._write_rates(block.sensors, block.reference)
            self._write_estimates(block, block.reference)
        else:
            self._write_run(block)
        if self._live is not None and not self._laid_out:
            # What there is to see is known now; somebody is looking.
            self._stream.send_blueprint(self._blueprint(live=True))
            self._laid_out = True

    def _write_run(self, block: RunBlock) -> None:
        truth = block.truth.rate
        self._moved |= bool(np.any(block.command.rate))
        self._add_rate("/commanded/rate", block.command.rate[: truth.size], 1, "commanded", width=1.0)
        self._write_rates(block.sensors, truth)
        for name, temperature in block.temperatures.items():
            key = f"sensors/{name}"
            self._add(f"/{key}/temperature", temperature, self._strides[name], key, detailed=False)
            self._add_rate(f"/truth/{name}/drift", block.drifts[name], 1, key, detailed=False)
        self._write_estimates(block, truth[-block.start % self._fusion_stride :: self._fusion_stride])
        self._write_sights(block)
        self._write_poses(block)

    def _write_rates(self, sensors: Mapping[str, FloatArray], truth: FloatArray | None) -> None:
        if truth is not None:
            self._add_rate("/truth/rate", truth, 1, "truth")
        for name, readings in sensors.items():
            self._add_rate(f"/sensors/{name}/rate", readings, self._strides[name], f"sensors/{name}", width=1.0)

    def _write_estimates(self, block: RunBlock | PlayedBlock, reference: FloatArray | None) -> None:
        stride = self._fusion_stride
        for name, estimate in block.fusion.items():
            key = f"fusion/{name}"
            self._add_rate(f"/{key}/rate", estimate.rate, stride, key, width=self._widths[name])
            if reference is not None:
                self._add_rate(f"/{key}/error", estimate.rate - reference, stride, key, width=1.0)
            self._add_rate(f"/{key}/std", estimate.std, stride, key, detailed=False)
            for series, values in estimate.diagnostics.items():
                self._write_diagnostic(key, series, self._shown.of(values, unit_of(key, series)))
                if series.startswith("gated_"):
                    self._mark(block.start, name, series.removeprefix("gated_"), values, estimate.rate)

    def _write_diagnostic(self, key: str, series: str, values: FloatArray) -> None:
        shown = {series: values}
        if series.startswith(("R_", "Q_", "N_", "innovation_variance_")):
            shown[LOG + series] = _log10(values)
        for each, row in shown.items():
            self._add(f"/{key}/{each}", row, self._fusion_stride, key, detailed=False, gaps=False)

    def close(self) -> None:
        """Finish the file and read it back; closing twice is allowed.

        Raises
        ------
        RunError
            If it is not on the disk as a whole.
        """
        if not self._open:
            return
        self._open = False
        for signal in self._signals.values():
            signal.finish()
        for channel in self._channels.values():
            channel.finish()
        if self._target is not None:
            self._target.finish()
        if self._world is not None:
            self._world.finish()
        self._stream.send_blueprint(self._blueprint())
        try:
            # Only flush reports a full disk; disconnect is silent about it.
            self._flush()
            self._stream.disconnect()
            RrdReader(self._path).store()
        except (RuntimeError, OSError, ValueError) as error:
            failure = self._failure(str(error))
            self.abort()
            raise failure from error

    def abort(self) -> None:
        """Give the recording up and remove its file."""
        self._open = False
        self._let_go()
        with contextlib.suppress(OSError):
            self._path.unlink(missing_ok=True)

    def _flush(self) -> None:
        """Wait until all is written, or until it is clear that it will not be: a writer that met a full disk may answer
        no more.
        """
        deadline = time.monotonic() + FLUSH_TIMEOUT
        while True:
            try:
                self._stream.flush(timeout_sec=LET_GO_TIMEOUT)
            except RuntimeError:
                if self._live is not None and not self._is_full():
                    # The window was closed; the file, which is read back next, goes on without it.
                    return
                if self._is_full() or time.monotonic() > deadline:
                    raise
            else:
                return

    def _is_full(self) -> bool:
        return shutil.disk_usage(self._path.parent).free < FULL

    def _let_go(self) -> None:
        """Close what the library holds, and do not wait for it forever: on a full disk it now and then waits for a
        thread of its own that has ended.
        """
        closing = threading.Thread(target=self._stream.disconnect, daemon=True)
        closing.start()
        closing.join(LET_GO_TIMEOUT)
        if closing.is_alive():
            rr.unregister_shutdown()

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        if error is None:
            self.close()
        else:
            self.abort()

    def _add_rate(self, entity: str, values: FloatArray, stride: int, key: str, **style: Any) -> None:
        """Add a block of a rate [rad/s]; `style` as of `_add`."""
        self._add(entity, self._shown.of(values), stride, key, **style)

    def _add(
        self,
        entity: str,
        values: FloatArray,
        stride: int,
        key: str,
        width: float = 1.5,
        *,
        detailed: bool = True,
        gaps: bool = True,
    ) -> None:
        if entity not in self._signals:
            self._signals[entity] = Signal(
                self._recording,
                entity,
                stride,
                # The unit is in the title of the view.
                name=key.rpartition("/")[2],
                color=self._colors[key],
                width=width,
                detailed=detailed,
                gaps=gaps,
                times_ns=None if self._times is None else self._times.get(clock_of(key)),
                settle=self._settle,
            )
        self._signals[entity].write(values)

    def _mark(self, start: int, name: str, sensor: str, count: FloatArray, rate: FloatArray) -> None:
        """Mark in the line of a filter which readings of a sensor it struck out; only on the clock of the run."""
        if self._times is not None:
            return
        entity, stride = f"/fusion/{name}/{PREFIX}{sensor}", self._fusion_stride
        if entity not in self._marks:
            words = f"{name} struck out {sensor}"
            self._marks[entity] = GateMarks(self._recording, entity, words, self._colors[f"sensors/{sensor}"])
        index = stride * (-(-start // stride) + np.arange(count.size))
        stamps = self._recording.clock.nanoseconds(index)
        self._marks[entity].write(stamps, count, self._shown.of(rate))

    def _write_sights(self, block: RunBlock) -> None:
        if block.pointing and self._target is None:
            self._target = Target(self._recording, {name: self._colors[f"fusion/{name}"] for name in block.pointing})
        first = -block.start % self._pose_stride
        for name, sight in block.pointing.items():
            key = f"fusion/{name}"
            self._add(f"/pointing/{name}/residual", 1e6 * sight.residual, 1, key)
            assert self._target is not None
            residual = sight.residual[first :: self._pose_stride]
            index = block.start + first + self._pose_stride * np.arange(residual.size)
            self._target.write(name, index, residual)

    def _write_poses(self, block: RunBlock) -> None:
        first = -block.start % self._pose_stride
        index = np.arange(block.start + first, block.start + block.truth.rate.size, self._pose_stride)
        assert self._world is not None
        self._world.write(index, block.truth.poses, block.truth.angle[first :: self._pose_stride])
        for name, (heights, profiles) in block.profiles.items():
            if name not in self._channels:
                self._channels[name] = Channel(
                    self._recording, name, heights, self._colors[f"sensors/{name}"], self._shown.unit
                )
            self._channels[name].write(index, self._shown.of(profiles))

    def _blueprint(self, *, live: bool = False) -> rr.blueprint.Blueprint:
        # A command of nothing would only stretch the scale of a table that turns with the Earth.
        hidden = set() if self._moved else {"/commanded/rate"}
        return blueprint(
            entities={entity: signal.settled for entity, signal in self._signals.items() if entity not in hidden},
            marks=[entity for entity, marks in self._marks.items() if marks.n],
            sensors=list(self._strides),
            filters=self._fusion_names,
            channels=list(self._channels),
            model=self._model,
            clock=self._recording.clock,
            unit=self._shown.unit,
            live=live,
        )

    def _failure(self, reason: str) -> RunError:
        try:
            free = shutil.disk_usage(self._path.parent).free
        except OSError:
            place = "its folder cannot be read"
        else:
            place = f"{'its disk is full: ' if free < FULL else ''}{free / 1e6:.1f} MB free"
        return RunError(f"{self._path}: the recording could not be written ({place}): {reason}")


def _log10(values: FloatArray) -> FloatArray:
    """Return the logarithm; NaN of what has none."""
    return np.log10(values, where=values > 0.0, out=np.full(values.shape, np.nan))
