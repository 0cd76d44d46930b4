"""Recordings through the filters, and runs as recordings."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from testbed.cli.options import Output, PluginModules, RunDir, WantedOutputs, expanded
from testbed.cli.status import MISSED
from testbed.errors import Problem, ScenarioError, quoted


def _filters(incomplete: str) -> list[str]:
    from testbed.fusion import list_filters

    return [name for name in list_filters() if name.startswith(incomplete)]


def _formats(incomplete: str) -> list[str]:
    from testbed.playback.export import FORMATS

    return [name for name in FORMATS if name.startswith(incomplete)]


@expanded
def replay(
    output: Output,
    log: Annotated[
        list[Path] | None,
        typer.Argument(
            metavar="LOG",
            help="Recording of any format, in consecutive files if there are several; a map; or a run folder. "
            "Default: the files that the map names.",
        ),
    ] = None,
    map_: Annotated[
        Path | None,
        typer.Option("--map", metavar="LOG.yaml", help="Which channel is what; default what the file's words say."),
    ] = None,
    filter_: Annotated[
        list[str] | None,
        typer.Option(
            "--filter",
            metavar="LIST",
            help="Filters by name, such as kalman,wideband. May be repeated.",
            autocompletion=_filters,
        ),
    ] = None,
    fusion: Annotated[
        Path | None,
        typer.Option(
            metavar="FILE.yaml", help="Filters with parameters, as under fusion in a scenario, or a scenario."
        ),
    ] = None,
    belief: Annotated[
        str | None,
        typer.Option(help="What the filters believe: a name, or a file of sensors; default that of --fusion, or eq39."),
    ] = None,
    start: Annotated[
        str | None,
        typer.Option(
            metavar="unknown|rest", help="What the filters know of the start; default that of --fusion, or unknown."
        ),
    ] = None,
    fix: Annotated[
        bool, typer.Option("--fix", help="Put right sign, unit, gain, offset and rate that are found wrong.")
    ] = False,
    settle: Annotated[
        str | None,
        typer.Option(metavar="TIME", help="Judge from here on; default a tenth of the record, at most 10 s."),
    ] = None,
    lines: Annotated[
        str | None,
        typer.Option(metavar="FREQUENCIES", help="What the reference holds, such as '0.5, 10 Hz', for gain and phase."),
    ] = None,
    outputs: WantedOutputs = None,
    out: Annotated[Path | None, typer.Option(help="Run folder to write; default runs/replay_<name>.")] = None,
    plugin: PluginModules = None,
) -> None:
    """Send a recording through filters, say first what stands against it, and write a run folder."""
    from testbed.cli.replays import print_replay, replay_words
    from testbed.logs.options import quantity
    from testbed.playback.replay import check_target, play_back, prepare

    wanted = None if outputs is None else _list(outputs, "--outputs")
    check_target(out, wanted)

    def target(name: str) -> Path:
        return out or Path("runs") / f"replay_{name}"

    length = None if settle is None else 0.0 if settle.strip() == "0" else quantity(settle, "s", "2 s", "--settle")
    made = prepare(
        log or [],
        [name for names in filter_ or () for name in _list(names, "--filter")],
        fusion=fusion,
        map=map_,
        belief=belief,
        start=start,
        fix=fix,
        settle=length,
        lines=[quantity(one, "Hz", "10 Hz", "--lines") for one in _list(lines, "--lines")],
        plugins=plugin or (),
        named=lambda name: check_target(target(name), wanted),
    )
    for words in replay_words(made.name, made.lineup.duration, made.facts):
        output.note(words)
    # Before the estimate: what stands against a recording is worth more than what comes of it.
    output.warn(str(finding) for finding in made.verdict.unfixed)
    folder = target(made.name)
    with output.progress(made.name, made.lineup.duration) as tick:
        run = play_back(made, folder, outputs=wanted, progress=tick)
    document = {**run.metrics.to_dict(), "written": str(folder)}
    output.show(document, lambda: print_replay(run.metrics, made.verdict, folder))
    if made.verdict.unfixed:
        raise typer.Exit(MISSED)


@expanded
def export(
    run_dir: RunDir,
    output: Output,
    format_: Annotated[
        str,
        typer.Option("--format", help="One of csv, hdf5, mcap, mdf, parquet, tdms.", autocompletion=_formats),
    ],
    out: Annotated[Path | None, typer.Option(help="Folder to write; default runs/<name>_<format>.")] = None,
) -> None:
    """Write readings and truth of a run as a recording of another format, with the map that reads it."""
    from testbed.playback.export import export as write

    folder = write(run_dir, format_, out)
    files = sorted(path.name for path in folder.iterdir())
    document = {"format": format_, "files": files, "written": str(folder)}
    output.show(document, lambda: typer.echo(f"wrote {folder}: {', '.join(files)}"))


def _list(text: str | None, option: str) -> list[str]:
    """Return the parts of a list with commas."""
    parts = [part.strip() for part in (text or "").split(",")]
    if len(parts) > 1 and not all(parts):
        raise ScenarioError([Problem(f"expected one or more with commas between them, got {quoted(text)}", option)])
    return [part for part in parts if part]
