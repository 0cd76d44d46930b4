"""What is done with a run folder: look at its recording, write its report again."""

from __future__ import annotations

from typing import Annotated

import typer

from testbed.cli.options import Output, RunDir, expanded
from testbed.cli.status import FAILED, OK


@expanded
def view(run_dir: RunDir) -> None:
    """Open the recording of a run in the Rerun viewer."""
    from testbed.recording.viewer import open_viewer

    raise typer.Exit(FAILED if open_viewer(run_dir) else OK)


@expanded
def report(
    run_dir: RunDir,
    output: Output,
    figures: Annotated[
        bool, typer.Option("--figures", help="Write each figure as SVG, PDF and PNG into the run folder too.")
    ] = False,
) -> None:
    """Write the static report of a run again."""
    from testbed.report import save_figures, write_report
    from testbed.runs.folder import failing_as_run_error

    with failing_as_run_error(str(run_dir)):
        page = write_report(run_dir)
        drawn = save_figures(run_dir) if figures else []
    known = {"written": str(page), "figures": [str(path) for path in drawn]}
    output.show(known, lambda: typer.echo("\n".join(f"wrote {path}" for path in (page, *drawn))))
