"""A recording through the filters, block by block."""

from __future__ import annotations

from typing import TYPE_CHECKING

from testbed.errors import Problem, RunError, ScenarioError
from testbed.fusion import FILTERS
from testbed.fusion.checked import CheckedFilter
from testbed.inputs.plugins import PluginError
from testbed.runs.block import PlayedBlock
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
            checked = CheckedFilter(name, inner, lineup.rates["base"], shipped=spec.type in FILTERS)
            if lineup.stamps_ns is not None:
                checked.check_clocks()
        except PluginError as error:
            msg = f"filter {name}: {error}"
            raise RunError(msg) from error
        except ValueError as error:
            problems.append(Problem(str(error), name))
        else:
            started[name] = checked
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
    for start in range(0, lineup.n_time, length):
        stop = min(start + length, lineup.n_time)
        spans = {name: slice(lineup.first(name, start), lineup.first(name, stop)) for name in lineup.sensors}
        readings: dict[str, FloatArray] = {name: lineup.readings[name][span] for name, span in spans.items()}
        stamps = lineup.stamps_ns and {name: lineup.stamps_ns[name][span] for name, span in spans.items()}
        yield PlayedBlock(
            start,
            stop - start,
            {name: span.start for name, span in spans.items()},
            None if lineup.references is None else lineup.references["base"][start:stop],
            readings,
            {name: stage.process(readings, stamps) for name, stage in filters.items()},
        )
