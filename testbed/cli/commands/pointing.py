"""The line of sight of a finished run."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from testbed.cli.options import Output, PluginModules, RunDir, expanded


@expanded
def pointing(
    run_dir: RunDir,
    output: Output,
    pointing: Annotated[
        Path | None,
        typer.Option("--pointing", metavar="FILE.yaml", help="Tracker, mirror, windows, link; default the run's own."),
    ] = None,
    plugin: PluginModules = None,
) -> None:
    """Print what is left of the line of sight when a finished run's estimates feed a mirror."""
    from testbed.chain.sight import line_of_sight
    from testbed.cli.console import terminal
    from testbed.cli.sights import print_sights

    found = line_of_sight(run_dir, pointing, plugins=plugin or ())
    document = {"pointing": {name: sight.to_dict() for name, sight in found.items()}}
    output.show(document, lambda: print_sights(terminal(), found))
