"""What there is to choose from."""

from __future__ import annotations

from enum import StrEnum
from typing import Annotated

import typer

from testbed.cli.options import Output, PluginModules, expanded


class Choice(StrEnum):
    """What can be listed by itself."""

    parts = "parts"


@expanded
def list_parts(
    output: Output,
    what: Annotated[
        Choice | None, typer.Argument(metavar="KIND", help="Only 'parts': the shipped instruments beside each other.")
    ] = None,
    plugin: PluginModules = None,
) -> None:
    """List motions, sensors, filters, presets, beliefs, bands, drift methods and papers; or the parts' figures."""
    if what is Choice.parts:
        from testbed.cli.part_figures import part_figures, print_part_figures

        figures = part_figures()
        output.show(figures, lambda: print_part_figures(figures))
        return
    from testbed.cli.catalogue import catalogue, print_catalogue

    found = catalogue(plugin or ())
    output.show(found, lambda: print_catalogue(found))
