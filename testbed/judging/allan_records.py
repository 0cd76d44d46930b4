"""Rate records to look at: columns of a recording, or what the sensors of a run read beyond the motion."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from testbed.errors import UnknownNameError
from testbed.logs.choice import select
from testbed.logs.inspection import remarks, word_of
from testbed.logs.options import refusal
from testbed.logs.selection import Selection

if TYPE_CHECKING:
    from pathlib import Path

    from testbed.logs.channel import LogChannel
    from testbed.logs.selection import TextOptions
    from testbed.runs.results import RunRecord
    from testbed.scenario.model import Scenario
    from testbed.signals import FloatArray


@dataclass(frozen=True)
class RateRecord:
    """A rate record.

    Parameters
    ----------
    name : str
        For titles and file names.
    rate : ndarray, shape (n_time,)
        Rate [rad/s]; NaN where a sample is lost.
    sample_rate_hz : float
        Its sample rate [Hz].
    content : str
        What it is, for the reader.
    notes : tuple of str
        What the reader found, took for granted or left out.
    word : float
        To what the rate is rounded [rad/s]; 0 if not known.
    signal : str
        ``sensors/<name>``, ``fusion/<name>``, ``truth`` or ``commanded`` of a run; empty of a recording.
    """

    name: str
    rate: FloatArray
    sample_rate_hz: float
    content: str
    notes: tuple[str, ...] = ()
    word: float = 0.0
    signal: str = ""


def read(
    source: Path, wanted: Selection | None = None, text: TextOptions | None = None, sensor: str | None = None
) -> list[RateRecord]:
    """Return the records that the command line asks for.

    Parameters
    ----------
    source : Path
        Recording or run folder.
    wanted : Selection, optional
        Which columns of a recording, and what they mean.
    text : TextOptions, optional
        How a text file is written.
    sensor : str, optional
        Of a run, as `read_run`.

    Raises
    ------
    ScenarioError
        If something is missing, not understood or belongs to the other kind of source.
    """
    wanted = wanted or Selection()
    if source.is_dir():
        given = ["--column"] * bool(wanted.column) + wanted.of_files
        if given:
            raise refusal(source, "expected a file with it; a run folder knows its signals", given[0])
        return read_run(source, sensor)
    if sensor is not None:
        raise refusal(source, "expected a run folder with it", "--sensor")
    if not source.is_file():
        raise refusal(source, "expected a recording or a run folder, got neither")
    channels = select(source, wanted, text)
    return [as_record(channel, source.stem if len(channels) == 1 else channel.name) for channel in channels]


def as_record(channel: LogChannel, name: str) -> RateRecord:
    """Return a channel of a recording as a record: on an even grid, lost samples NaN.

    Parameters
    ----------
    channel : LogChannel
        A rate, or increments or an angle.
    name : str
        For titles and file names.

    Raises
    ------
    ScenarioError
        If its samples are not even.
    """
    rate = channel.rate()
    content = f"{channel.label} of {channel.table.path} ({'; '.join([channel.table.format, *channel.assumed])})"
    # The rounding of increments and angles is no noise of its own in each sample of the rate.
    word = word_of(channel) if channel.kind == "rate" else 0.0
    return RateRecord(name, rate.even(), rate.rate_hz, content, tuple(remarks(channel)), word)


def read_run(folder: Path, sensor: str | None = None) -> list[RateRecord]:
    """Return what each sensor of a run read after settling, less what it reads of the same truth without noise.

    So neither the motion nor the sensor's dynamics show, on a moving table as at standstill. Of a replayed recording,
    whose truth nobody knows so well, it is what was read.

    Parameters
    ----------
    folder : Path
        Run folder.
    sensor : str, optional
        Only this one.

    Returns
    -------
    list of RateRecord
        In the order of the scenario.

    Raises
    ------
    ScenarioError
        If it is no run folder, or the sensor is not in it or was never read.
    """
    from testbed.runs.results import RunRecord
    from testbed.scenario.loader import load_instruments

    run = RunRecord.open(folder)
    if run.metrics.replay is not None:
        return _read_replay(folder, run, sensor)
    scenario = load_instruments(folder / "scenario.yaml")
    if sensor is not None and sensor in run.sensors and sensor not in scenario.sensors:
        msg = "is of a plug-in's type: its noise-free reading would need the plug-in, which reading a run never loads"
        raise refusal(folder, msg, f"sensors.{sensor}")
    if sensor is not None and sensor not in scenario.sensors:
        raise refusal(folder, str(UnknownNameError("sensor", sensor, scenario.sensors)), "--sensor")
    records = []
    for name in scenario.sensors if sensor is None else [sensor]:
        instrument = scenario.sensors[name]
        noise = run.sensors[name].rate - _silent_readings(scenario, name, run.truth[f"{name}_rate"])
        noise = noise[math.ceil(scenario.frame.settle * instrument.sample_rate) :]
        if not np.isfinite(noise).any():
            raise refusal(folder, "expected readings, got none", f"sensors.{name}")
        content = f"{name} of {scenario.name}, less its noise-free reading, from {scenario.frame.settle:g} s on"
        records.append(
            RateRecord(f"{scenario.name}_{name}", noise, instrument.sample_rate, content, signal=f"sensors/{name}")
        )
    return records


def _read_replay(folder: Path, run: RunRecord, sensor: str | None) -> list[RateRecord]:
    if sensor is not None and sensor not in run.sensors:
        raise refusal(folder, str(UnknownNameError("sensor", sensor, run.sensors)), "--sensor")
    settle, records = run.metrics.settle_s, []
    for name in run.metrics.sensors if sensor is None else [sensor]:
        signals = run.sensors[name]
        rate = signals.rate[math.ceil(settle * signals.sample_rate_hz) :]
        if not np.isfinite(rate).any():
            raise refusal(folder, "expected readings, got none", f"sensors.{name}")
        content = f"{name} of {run.metrics.scenario}, as recorded, from {settle:g} s on"
        title = f"{run.metrics.scenario}_{name}"
        records.append(RateRecord(title, rate, signals.sample_rate_hz, content, signal=f"sensors/{name}"))
    return records


def _silent_readings(scenario: Scenario, name: str, true_rate: FloatArray) -> FloatArray:
    """Return what a sensor reads of the true rate without noise, level, at the temperature of the run."""
    from testbed.sensors.stages import ExposedStage, Surroundings

    instrument, base = scenario.sensors[name], scenario.base_rate_hz
    if true_rate.size != scenario.n_time:
        # A sensor of a plug-in, which is not read here, asked for another clock.
        base = true_rate.size / scenario.frame.duration
    stage = instrument.model_copy(update={"noise": False}).start(base, scenario.frame.seed, name)
    if not isinstance(stage, ExposedStage):
        return stage.process(true_rate)
    temperature = scenario.frame.temperature.at(0, true_rate.size, base)
    return stage.process_in(true_rate, Surroundings(temperature=temperature))
