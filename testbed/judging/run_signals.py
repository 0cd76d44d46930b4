"""Signals of a run as records: what a sensor read, what a filter estimated, what was true."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from testbed.errors import Problem, ScenarioError, UnknownNameError
from testbed.judging.allan_records import RateRecord
from testbed.runs.results import RunRecord

if TYPE_CHECKING:
    from collections.abc import Sequence
    from pathlib import Path


def run_records(folder: Path, wanted: Sequence[str]) -> list[RateRecord]:
    """Return signals of a run from the end of settling on.

    Parameters
    ----------
    folder : Path
        Run folder.
    wanted : sequence of str
        Names of sensors and filters, ``truth`` or ``commanded``; empty: all sensors and filters.

    Returns
    -------
    list of RateRecord
        In that order.

    Raises
    ------
    ScenarioError
        If it is no run folder, or a name is not in it.
    """
    run = RunRecord.open(folder)
    signals = {**run.sensors, **run.fusion, "truth": run.truth, "commanded": run.commanded}
    settle = float(run.metrics["settle_s"])
    records = []
    for name in wanted or [*run.sensors, *run.fusion]:
        if name not in signals:
            raise ScenarioError(
                [Problem(str(UnknownNameError("signal", name, signals)), key="--column", file=str(folder))]
            )
        time = np.asarray(signals[name].time)
        rate_hz = (time.size - 1) / float(time[-1] - time[0])
        first = math.ceil(round((settle - float(time[0])) * rate_hz, 6))
        rate = np.asarray(signals[name].rate)[max(first, 0) :]
        group = "sensors/" if name in run.sensors else "fusion/" if name in run.fusion else ""
        records.append(RateRecord(name, rate, rate_hz, f"{name} of {folder}", signal=f"{group}{name}"))
    return records
