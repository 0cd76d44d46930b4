"""A recording through the filters, block by block."""

from __future__ import annotations

from typing import TYPE_CHECKING

from testbed.errors import Problem, RunError, ScenarioError
from testbed.fusion import FILTERS
from testbed.fusion.checked import CheckedFilter
from testbed.inputs.plugins import PluginError
from testbed.runs.block import PlayedBlock, first_due
from testbed.signals import BLOCK

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping

    from testbed.playback.lineup import Lineup
    from testbed.scenario.model import FilterSpec
    from testbed.signals import FloatArray


def start_filters(specs: Mapping[str, FilterSpec], lineup: Lineup) -> dict[str, CheckedFilter]:
    """Return the filters at their beginning, under watch.

    Parameters
    ----------
    specs : mapping of str to FilterSpec
        What they are.
    lineup : Lineup
        The sensors that all of them read.

    Raises
    ------
    ScenarioError
        If belief, clocks and parameters do not fit together: every filter that says so.
    RunError
        If one is a plug-in's and raises anything.
    """
    rates = {name: lineup.rates[name] for name in lineup.sensors}
    started, problems = {}, []
    for name, spec in specs.items():
        try:
            inner = spec.start(rates)
        except PluginError as error:
            msg = f"filter {name}: {error}"
            raise RunError(msg) from error
        except ValueError as error:
            problems.append(Problem(str(error), name))
        else:
            started[name] = CheckedFilter(name, inner, lineup.rates["base"], shipped=spec.type in FILTERS)
    if problems:
        raise ScenarioError(problems)
    return started


def play_through(lineup: Lineup, filters: Mapping[str, CheckedFilter], length: int = BLOCK) -> Iterator[PlayedBlock]:
    """Yield what the filters make of a recording, block by block; the result does not depend on their length.

    Parameters
    ----------
    lineup : Lineup
        The recording.
    filters : mapping of str to CheckedFilter
        From `start_filters`.
    length : int, optional
        Samples of the base clock in a block.
    """
    base = lineup.rates["base"]
    for start in range(0, lineup.n_time, length):
        stop = min(start + length, lineup.n_time)
        spans = {
            name: (first_due(start, base, lineup.rates[name]), first_due(stop, base, lineup.rates[name]))
            for name in lineup.sensors
        }
        readings: dict[str, FloatArray] = {name: lineup.readings[name][slice(*span)] for name, span in spans.items()}
        yield PlayedBlock(
            start,
            stop - start,
            {name: first for name, (first, _) in spans.items()},
            None if lineup.reference is None else lineup.reference[start:stop],
            readings,
            {name: stage.process(readings) for name, stage in filters.items()},
        )
