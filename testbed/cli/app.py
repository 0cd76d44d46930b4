"""Command line. Imports here are light: each command loads what it needs."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Annotated

import typer

from testbed.cli import compensate as cli_compensate
from testbed.cli.status import FAILED, MISSED, OK
from testbed.errors import ScenarioError

app = typer.Typer(
    name="testbed",
    help="Physics testbed for wide-band angular-rate sensing.",
    no_args_is_help=True,
    add_completion=False,
    pretty_exceptions_enable=False,
)

app.add_typer(cli_compensate.app)


ScenarioFile = Annotated[Path, typer.Argument(metavar="SCENARIO.yaml", help="Scenario file.")]
PluginModules = Annotated[
    list[str] | None,
    typer.Option(
        "--plugin",
        metavar="MODULE",
        help="Module, dotted or as the path of a .py, to load first: it runs with your rights. May be repeated.",
    ),
]
AllowOutside = Annotated[
    bool, typer.Option("--allow-outside", help="Let a recorded motion lie outside the scenario's folder.")
]
RunDir = Annotated[Path, typer.Argument(metavar="RUN_DIR", help="Run folder.")]


@app.command()
def run(
    scenario: ScenarioFile,
    out: Annotated[Path | None, typer.Option(help="Run folder to write; default runs/<scenario name>.")] = None,
    seed: Annotated[int | None, typer.Option(min=0, max=2**63 - 1, help="Instead of the scenario's seed.")] = None,
    block: Annotated[
        float | None, typer.Option(help="Length of a block in seconds; the result does not depend on it.")
    ] = None,
    view: Annotated[bool, typer.Option("--view", help="Open the recording afterwards.")] = False,
    plugin: PluginModules = None,
    allow_outside: AllowOutside = False,
) -> None:
    """Run a scenario, print its errors and write the run folder."""
    from testbed.chain.runner import run as run_scenario
    from testbed.cli.terminal import print_metrics, progress
    from testbed.scenario.loader import load_scenario

    if block is not None and not 0.0 < block < math.inf:
        problem = f"--block: expected more than 0 s, and finite, got {block}"
        raise ScenarioError(problem)
    loaded = load_scenario(scenario, plugins=plugin or (), allow_outside=allow_outside)
    target = out or Path("runs") / loaded.name
    with progress(loaded.name, loaded.frame.duration) as tick:
        result = run_scenario(loaded, out=target, seed=seed, block=block, progress=tick)
    print_metrics(result.metrics, target)
    if view:
        from testbed.recording.viewer import open_viewer

        open_viewer(target)
    if not all(bound.met for bound in result.metrics.expectations):
        raise typer.Exit(MISSED)


@app.command()
def check(
    scenario: ScenarioFile,
    plugin: PluginModules = None,
    allow_outside: AllowOutside = False,
) -> None:
    """Validate a scenario and print what was understood."""
    from testbed.cli.terminal import print_scenario
    from testbed.judging.table_facts import table_facts
    from testbed.scenario.loader import load_scenario

    loaded = load_scenario(scenario, plugins=plugin or (), allow_outside=allow_outside)
    print_scenario(loaded, table_facts(loaded))


@app.command("list")
def list_parts(plugin: PluginModules = None) -> None:
    """List motions, sensors, presets, filters, beliefs, bands and papers."""
    from testbed.cli.catalogue import catalogue
    from testbed.cli.terminal import print_catalogue

    print_catalogue(catalogue(plugin or ()))


@app.command()
def schema() -> None:
    """Print the JSON schema of a scenario, for editors."""
    import json

    from testbed.scenario.schema import schema as scenario_schema

    typer.echo(json.dumps(scenario_schema(), indent=2))


@app.command()
def view(run_dir: RunDir) -> None:
    """Open the recording of a run in the Rerun viewer."""
    from testbed.recording.viewer import open_viewer

    raise typer.Exit(FAILED if open_viewer(run_dir) else OK)


@app.command()
def report(run_dir: RunDir) -> None:
    """Write the static report of a run again."""
    from testbed.report import write_report
    from testbed.runs.folder import failing_as_run_error

    with failing_as_run_error(str(run_dir)):
        typer.echo(f"wrote {write_report(run_dir)}")


@app.command()
def allan(
    source: Annotated[Path, typer.Argument(metavar="FILE_OR_RUN", help="Text file with a rate record, or run folder.")],
    column: Annotated[str | None, typer.Option(help="Column of a file by name, or by number from 1 on.")] = None,
    unit: Annotated[str | None, typer.Option(help="Unit of the column, such as deg/s.")] = None,
    rate: Annotated[str | None, typer.Option(metavar="HZ", help="Sample rate of a file.")] = None,
    time: Annotated[str | None, typer.Option(help="Column of the time, instead of --rate.")] = None,
    time_unit: Annotated[str, typer.Option(help="Unit of the time.")] = "s",
    sensor: Annotated[str | None, typer.Option(help="Sensor of a run; default all.")] = None,
    min_tau: Annotated[float | None, typer.Option(metavar="S", help="Shortest averaging time of the fit.")] = None,
    max_tau: Annotated[float | None, typer.Option(metavar="S", help="Longest averaging time of the fit.")] = None,
    out: Annotated[Path | None, typer.Option(help="Plot (.svg, .png, .pdf); default allan_<name>.svg here.")] = None,
) -> None:
    """Print the Allan coefficients of a record or of a run's sensors, and draw the deviation."""
    from testbed.cli.terminal import print_allan
    from testbed.judging.allan_analysis import allan_figure, analyse, figure_format, write_figure
    from testbed.judging.allan_records import read

    if out is not None:
        figure_format(out)
    options = {"column": column, "unit": unit, "rate": rate, "time": time, "sensor": sensor}
    analyses = [analyse(record, min_tau, max_tau) for record in read(source, time_unit=time_unit, **options)]
    name = analyses[0].record.name if len(analyses) == 1 else source.resolve().name
    print_allan(analyses, write_figure(allan_figure(analyses), out or Path(f"allan_{name}.svg")))


@app.command()
def reproduce(
    paper: Annotated[str, typer.Argument(metavar="PAPER", help="Which paper: paper1, paper2, paper3.")],
    seeds: Annotated[
        int | None, typer.Option(min=1, help="Seeds to take the median over; default 10 for paper1, 1 for the others.")
    ] = None,
    out: Annotated[Path | None, typer.Option(help="Folder for tables and figures; default runs/<paper>.")] = None,
) -> None:
    """Repeat the measurements of a paper and print its numbers beside ours."""
    from testbed.reproduce import run_paper

    for line in run_paper(paper, seeds, out or Path("runs") / paper):
        typer.echo(line)
