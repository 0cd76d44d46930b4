"""What a sensor is, from a record of it beside a reference."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from testbed.cli.options import Output, expanded
from testbed.logs.selection import TextOptions


@expanded
def identify(
    log: Annotated[Path, typer.Argument(metavar="LOG", help="Recording of any format, or the map of one.")],
    output: Output,
    text: TextOptions,
    input_: Annotated[
        str, typer.Option("--input", metavar="CHANNEL", help="Reference: encoder, laser or quieter sensor.")
    ],
    outputs: Annotated[
        list[str],
        typer.Option(
            "--output", metavar="CHANNEL", help="Sensor; with two or more the noise of each is told from the others'."
        ),
    ],
    map_: Annotated[
        Path | None, typer.Option("--map", metavar="LOG.yaml", help="Map to read it by; default what its words say.")
    ] = None,
    out: Annotated[Path | None, typer.Option(metavar="BELIEF.yaml", help="Belief to write; default none.")] = None,
    figure: Annotated[
        Path | None, typer.Option(help="Figure (.svg, .png, .pdf); default runs/identify_<name>.svg.")
    ] = None,
    one_clock: Annotated[
        bool, typer.Option("--one-clock", help="One clock sampled all channels; default: each output's is fitted.")
    ] = False,
) -> None:
    """Print the frequency response of sensors to a reference, fit it, and write what filters may believe of them."""
    from testbed.cli.identified import asking_for_a_map, identified_document, print_identified
    from testbed.identification.belief_text import belief_text
    from testbed.identification.figure import response_figure
    from testbed.identification.session import check_names, identify_channels
    from testbed.judging.allan_analysis import figure_format, write_figure
    from testbed.logs.choice import select
    from testbed.logs.selection import Selection
    from testbed.runs.atomic import write_bytes
    from testbed.runs.folder import failing_as_run_error

    if figure is not None:
        figure_format(figure, "--figure")
    check_names(input_, outputs)
    with asking_for_a_map(log, given=map_ is not None):
        # Means of samples have a response of their own.
        reference, *sensors = select(log, Selection(column=[input_, *outputs], map=map_, average=1), text)
        found = identify_channels(reference, sensors, one_clock=one_clock)
    drawn = write_figure(response_figure(found), figure or Path("runs") / f"identify_{log.resolve().stem}.svg")
    if out is not None:
        with failing_as_run_error(str(out)):
            write_bytes(out, belief_text(found, f"{', '.join(outputs)} beside {input_} of {log.name}").encode())
    document = identified_document(found, str(drawn), None if out is None else str(out))
    output.show(document, lambda: print_identified(found, drawn))
    if out is not None:
        output.say(f"wrote {out}")
