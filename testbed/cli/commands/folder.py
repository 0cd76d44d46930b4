"""What is done with a run folder: look at its recording, write its report again."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from testbed.cli.options import Output, RunDir, expanded
from testbed.cli.status import FAILED, OK
from testbed.errors import Problem, ScenarioError


@expanded
def view(run_dir: RunDir) -> None:
    """Open the recording of a run in the Rerun viewer."""
    from testbed.recording.viewer import open_viewer

    raise typer.Exit(FAILED if open_viewer(run_dir) else OK)


@expanded
def report(
    run_dir: RunDir,
    output: Output,
    other: Annotated[
        Path | None, typer.Argument(metavar="OTHER_RUN", help="Another run folder, to be held against the first.")
    ] = None,
    figures: Annotated[
        bool, typer.Option("--figures", help="Write each figure as SVG, PDF and PNG into the run folder too.")
    ] = False,
    out: Annotated[
        Path | None, typer.Option(help="Page of two runs; default runs/<first>_against_<second>.html.")
    ] = None,
) -> None:
    """Write the static report of a run again, or a page that shows two runs side by side."""
    from testbed.report import save_figures, write_report
    from testbed.report.comparison import write_comparison
    from testbed.runs.folder import failing_as_run_error

    if other is None and out is not None:
        raise ScenarioError(
            [Problem("says where the page of two runs goes; name the second run, or leave it out", "--out")]
        )
    if other is not None and figures:
        raise ScenarioError([Problem("writes the figures of one run; leave the other run out", "--figures")])
    with failing_as_run_error(str(run_dir)):
        if other is None:
            page = write_report(run_dir)
        else:
            names = (run_dir.resolve().name, other.resolve().name)
            page = write_comparison(run_dir, other, out or Path("runs") / f"{names[0]}_against_{names[1]}.html")
        drawn = save_figures(run_dir) if figures else []
    known = {"written": str(page), "figures": [str(path) for path in drawn]}
    output.show(known, lambda: typer.echo("\n".join(f"wrote {path}" for path in (page, *drawn))))
