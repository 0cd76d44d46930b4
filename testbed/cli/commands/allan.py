"""Allan deviation of a record or of a run."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from testbed.cli.options import Output, expanded
from testbed.logs.selection import Selection, TextOptions


@expanded
def allan(
    source: Annotated[Path, typer.Argument(metavar="FILE_OR_RUN", help="Recording of any format, or run folder.")],
    output: Output,
    wanted: Selection,
    text: TextOptions,
    out: Annotated[Path | None, typer.Option(help="Plot (.svg, .png, .pdf); default runs/allan_<name>.svg.")] = None,
    sensor: Annotated[str | None, typer.Option(help="Sensor of a run; default all.")] = None,
    imu: Annotated[Path | None, typer.Option(metavar="IMU.yaml", help="Noise of the gyroscope for Kalibr.")] = None,
    min_tau: Annotated[str | None, typer.Option(metavar="TIME", help="Shortest averaging time of the fit.")] = None,
    max_tau: Annotated[str | None, typer.Option(metavar="TIME", help="Longest averaging time of the fit.")] = None,
) -> None:
    """Print the Allan coefficients of recorded rates or of a run's sensors, and draw the deviation."""
    from testbed.cli.allan import print_allan
    from testbed.judging.allan_analysis import allan_figure, analyse, figure_format, write_figure
    from testbed.judging.allan_records import read
    from testbed.judging.allan_words import write_imu
    from testbed.logs.options import quantity

    if out is not None:
        figure_format(out)
    shortest = None if min_tau is None else quantity(min_tau, "s", "10 s", "--min-tau")
    longest = None if max_tau is None else quantity(max_tau, "s", "10 s", "--max-tau")
    analyses = [analyse(record, shortest, longest) for record in read(source, wanted, text, sensor)]
    name = analyses[0].record.name if len(analyses) == 1 else source.resolve().with_suffix("").name
    figure = write_figure(allan_figure(analyses), out or Path("runs") / f"allan_{name}.svg")
    document = {"records": [analysis.summary() for analysis in analyses], "written": str(figure)}
    if imu is not None:
        write_imu(imu, analyses)
    output.show(document, lambda: print_allan(analyses, figure))
    if imu is not None:
        output.say(f"wrote {imu}")
