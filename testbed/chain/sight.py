"""The line of sight of a finished run: the same stage and the same judge, fed from its folder."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from testbed.chain.pointing import LinesOfSight
from testbed.document import Document
from testbed.errors import Problem, ScenarioError
from testbed.inputs.plain import plain_tree
from testbed.judging.sights import pointing_judges
from testbed.pointing.parameters import PointingParameters
from testbed.runs.block import first_due
from testbed.runs.metrics import PointingMetrics
from testbed.runs.results import RunRecord
from testbed.scenario.pointing import check_pointing
from testbed.scenario.recorded import RecordedScenario, load_described
from testbed.signals import BLOCK

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator, Mapping

    from testbed.scenario.model import Scenario
    from testbed.signals import FloatArray

_WHAT = "pointing (tracker, mirror, windows, link, ...)"


def line_of_sight(
    run_dir: str | Path,
    pointing: str | Path | Mapping[str, Any] | None = None,
    *,
    plugins: Iterable[str] = (),
) -> dict[str, PointingMetrics]:
    """Return what is left of the line of sight of a finished run, behind each filter that feeds forward.

    Parameters
    ----------
    run_dir : str or Path
        A run folder.
    pointing : str, Path or mapping, optional
        The keys of a scenario's `pointing`, or a file of them; those of the run if not given.
    plugins : iterable of str, optional
        As for `load_scenario`.

    Returns
    -------
    dict of str to PointingMetrics
        By filter, as metrics.json has it.

    Raises
    ------
    ScenarioError
        If the folder is no run, has no pointing and none is given, or what is given does not fit the run; of a replayed
        recording, if it has no reference throughout, or clocks of no whole ratio.

    Examples
    --------
    >>> line_of_sight("nowhere")
    Traceback (most recent call last):
    testbed.errors.ScenarioError: nowhere: expected a run folder, but nowhere/scenario.yaml, ... is missing
    """
    run = RunRecord.open(run_dir)
    scenario = load_described(Path(run_dir) / "scenario.yaml", plugins=plugins)
    if isinstance(scenario, RecordedScenario):
        _check_recording(run, str(run_dir))
    if pointing is not None:
        scenario = _with_pointing(scenario, pointing)
    if scenario.pointing is None:
        message = "has no 'pointing': give one, --pointing FILE.yaml with tracker, mirror, windows"
        raise ScenarioError([Problem(message, file=str(run_dir))])
    base = run.truth.sample_rate_hz
    rates = {"base": base} | {
        name: one.sample_rate_hz for part in (run.sensors, run.fusion) for name, one in part.items()
    }
    stage, judges = LinesOfSight(scenario, rates), pointing_judges(scenario, base)
    for truth, felt, readings, estimates in _blocks(run, scenario, rates):
        for name, block in stage.process(truth, felt, readings, estimates).items():
            judges[name].process(block, truth)
    return {name: PointingMetrics.model_validate(judge.result()) for name, judge in judges.items()}


def _check_recording(run: RunRecord, folder: str) -> None:
    """Refuse a recording of which the angle that is to be held is not known, or not at whole steps."""
    if "rate" not in run.truth:
        message = "has no reference, so the angle that the mirror has to hold is not known: replay it with one"
        raise ScenarioError([Problem(message, file=folder)])
    if run.truth.stamped:
        raise ScenarioError([Problem("expected clocks in whole ratios for a line of sight, got stamps", file=folder)])
    for start in range(0, run.truth.n_time, BLOCK):
        lost = np.isnan(run.truth.read("rate", start, start + BLOCK))
        if lost.any():
            at = (start + int(np.argmax(lost))) / run.truth.sample_rate_hz
            raise ScenarioError(
                [Problem(f"the reference is not known from {at:.6g} s on: cut the record", file=folder)]
            )


def _with_pointing(scenario: Scenario, given: str | Path | Mapping[str, Any]) -> Scenario:
    """Return the scenario with another pointing, checked against it."""
    tree = plain_tree(given) if not isinstance(given, str | Path) else None
    document = Document("" if tree else Path(str(given)), _WHAT, tree)
    folder = Path() if tree else Path(str(given)).resolve().parent
    keys = document.data.get("pointing", document.data)
    found = document.validate(PointingParameters, keys, ("pointing",) if "pointing" in document.data else (), folder)
    document.refuse()
    other = replace(scenario, pointing=found, expect=())
    check_pointing(other, document)
    document.refuse()
    return other


def _blocks(
    run: RunRecord, scenario: Scenario, rates: Mapping[str, float]
) -> Iterator[tuple[FloatArray, dict[str, FloatArray], dict[str, FloatArray], dict[str, FloatArray]]]:
    """Yield truth, what each sensor feels, readings and estimates, block by block."""
    for start in range(0, run.truth.n_time, BLOCK):
        stop = min(start + BLOCK, run.truth.n_time)

        def due(group: Any, name: str, start: int = start, stop: int = stop) -> FloatArray:
            first, last = (first_due(index, rates["base"], rates[name]) for index in (start, stop))
            values: FloatArray = group[name].read("rate", first, last)
            return values

        # What a sensor of a recording feels is not known apart from the reference.
        own = {name: f"{name}_rate" if f"{name}_rate" in run.truth else "rate" for name in scenario.sensors}
        felt = {name: run.truth.read(signal, start, stop) for name, signal in own.items()}
        readings = {name: due(run.sensors, name) for name in scenario.sensors}
        estimates = {name: due(run.fusion, name) for name in scenario.fusion}
        yield run.truth.read("rate", start, stop), felt, readings, estimates
