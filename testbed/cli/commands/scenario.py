"""What is done with a scenario file: run it, check it, and describe it to an editor."""

from __future__ import annotations

import json
from contextlib import ExitStack
from pathlib import Path
from typing import Annotated

import typer

from testbed.cli.loading import loading
from testbed.cli.options import AllowOutside, Output, PluginModules, ScenarioFile, WantedOutputs, expanded
from testbed.cli.status import MISSED
from testbed.errors import Problem, RunError, ScenarioError


@expanded
def run(
    scenario: ScenarioFile,
    output: Output,
    out: Annotated[Path | None, typer.Option(help="Run folder to write; default runs/<scenario name>.")] = None,
    seed: Annotated[int | None, typer.Option(min=0, max=2**63 - 1, help="Instead of the scenario's seed.")] = None,
    block: Annotated[
        str | None, typer.Option(metavar="TIME", help="Length of a block; the result does not depend on it.")
    ] = None,
    outputs: WantedOutputs = None,
    view: Annotated[bool, typer.Option("--view", help="Open the recording afterwards.")] = False,
    live: Annotated[bool, typer.Option("--live", help="Open the viewer now and watch the run in it.")] = False,
    plugin: PluginModules = None,
    allow_outside: AllowOutside = False,
) -> None:
    """Run a scenario, print its errors and write the run folder."""
    with loading():
        from testbed.chain.forecast import forecast
        from testbed.chain.runner import run as run_scenario
        from testbed.cli.check_page import size_words, warnings
        from testbed.cli.terminal import print_metrics
        from testbed.logs.options import quantity
        from testbed.runs.outputs import chosen
        from testbed.scenario.loader import load_scenario

    wanted = chosen(None if outputs is None else [name.strip() for name in outputs.split(",")])
    if (view or live) and "recording" not in wanted:
        shows = "--live" if live else "--view"
        raise ScenarioError([Problem(f"{shows} shows the recording: add recording", "outputs")])
    length = None if block is None else quantity(block, "s", "20 ms", "--block")
    with loading():
        loaded = load_scenario(scenario, plugins=plugin or (), allow_outside=allow_outside)
    output.warn(warnings(loaded))
    with loading():
        size = forecast(loaded, wanted)
    output.note(f"{loaded.name}: {size_words(size)}")
    target = out or Path("runs") / loaded.name
    with ExitStack() as stack:
        address, window = None, None
        if live:
            from testbed.recording.viewer import live_window

            address, window = stack.enter_context(live_window())
        with output.progress(loaded.name, loaded.frame.duration) as tick:
            result = run_scenario(
                loaded, out=target, seed=seed, outputs=wanted, block=length, progress=tick, live=address
            )
        document = {**result.metrics.to_dict(), "written": str(target)}
        output.show(document, lambda: print_metrics(result.metrics, target))
        if window is not None:
            window.wait()
    if view and not live:
        from testbed.recording.viewer import open_viewer

        open_viewer(target)
    if not all(bound.met for bound in result.metrics.expectations):
        raise typer.Exit(MISSED)


@expanded
def check(
    scenario: ScenarioFile,
    output: Output,
    everything: Annotated[bool, typer.Option("--all", help="Print every key, as written and in SI.")] = False,
    plugin: PluginModules = None,
    allow_outside: AllowOutside = False,
) -> None:
    """Validate a scenario and print what was understood."""
    with loading():
        from testbed.chain.forecast import forecast
        from testbed.cli.check_page import print_page, size_document, warnings
        from testbed.cli.understood import print_scenario, scenario_document
        from testbed.judging.table_facts import table_facts
        from testbed.scenario.departures import departures
        from testbed.scenario.loader import load_scenario

        loaded = load_scenario(scenario, plugins=plugin or (), allow_outside=allow_outside)
    output.warn(warnings(loaded))
    try:
        with loading():
            size = forecast(loaded)
    except RunError as error:
        raise ScenarioError([Problem(f"the run would fail at its beginning: {error}", file=loaded.file)]) from error
    facts = table_facts(loaded, size.step)
    document = {
        **scenario_document(loaded, facts),
        "differs": departures(loaded),
        "forecast": size_document(size),
    }
    show = (lambda: print_scenario(loaded, facts)) if everything else lambda: print_page(loaded, facts, size)
    output.show(document, show)


def schema() -> None:
    """Print the JSON schema of a scenario, for editors."""
    from testbed.scenario.schema import schema as scenario_schema

    typer.echo(json.dumps(scenario_schema(), indent=2))
