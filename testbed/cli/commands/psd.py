"""Spectral densities of recordings and of runs."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from testbed.cli.options import Output, expanded
from testbed.logs.selection import Selection, TextOptions


def _methods(incomplete: str) -> list[str]:
    from testbed.judging.density import METHODS

    return [name for name in METHODS if name.startswith(incomplete)]


@expanded
def psd(
    source: Annotated[Path, typer.Argument(metavar="FILE_OR_RUN", help="Recording of any format, or run folder.")],
    output: Output,
    wanted: Selection,
    text: TextOptions,
    out: Annotated[Path | None, typer.Option(help="Figure (.svg, .png, .pdf); default runs/psd_<name>.svg.")] = None,
    minus: Annotated[
        str | None, typer.Option(metavar="COLUMN", help="Column, or signal of a run, to take off each.")
    ] = None,
    method: Annotated[str, typer.Option(help="Either welch or multitaper.", autocompletion=_methods)] = "welch",
    segment: Annotated[str | None, typer.Option(metavar="TIME", help="Segment of Welch's method.")] = None,
    two_sided: Annotated[bool, typer.Option("--two-sided", help="Half of the one-sided density.")] = False,
    bands: Annotated[
        str | None, typer.Option(metavar="FREQUENCIES", help="Edges such as '0.1, 1, 100 Hz'; default decades.")
    ] = None,
) -> None:
    """Print the rms of recorded rates in bands, as a rate and as an angle, and draw their densities."""
    from testbed.cli.recordings import print_densities
    from testbed.judging.allan_analysis import figure_format, write_figure
    from testbed.judging.density import band_edges, densities
    from testbed.judging.density_figure import density_figure
    from testbed.logs.options import quantity

    if out is not None:
        figure_format(out)
    length = None if segment is None else quantity(segment, "s", "10 s", "--segment")
    edges = None if bands is None else band_edges(bands)
    found = densities(source, wanted, text, minus, method=method, segment=length, two_sided=two_sided)
    name = found[0].record.name if len(found) == 1 else source.resolve().with_suffix("").name
    figure = write_figure(density_figure(found), out or Path("runs") / f"psd_{name}.svg")
    document = {"densities": [one.summary(edges or one.decades()) for one in found], "written": str(figure)}
    output.show(document, lambda: print_densities(found, edges, figure))
