"""Drift compensation of a fibre-optic gyro: train, apply, audit."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from testbed.cli.options import Output, expanded
from testbed.cli.status import MISSED
from testbed.compensation import LITERATURE
from testbed.drift.columns import Columns

app = typer.Typer(
    name="compensate",
    help="Compensate the temperature drift of a fibre-optic gyro: train a model, apply it, audit it.",
    no_args_is_help=True,
)

Source = Annotated[Path, typer.Argument(metavar="SOURCE", help="Run folder, or text file with rate and temperature.")]
Sources = Annotated[list[Path], typer.Argument(metavar="SOURCE", help="Thermal cycles: run folders or text files.")]
Model = Annotated[Path, typer.Argument(metavar="MODEL", help="Trained model (JSON).")]


def _methods(incomplete: str) -> list[str]:
    from testbed.compensation import FITS

    return [name for name in FITS if name.startswith(incomplete)]


@app.command()
@expanded
def train(
    sources: Sources,
    output: Output,
    columns: Columns,
    out: Annotated[Path, typer.Option(help="Model file to write.")] = Path("runs/drift_model.json"),
    method: Annotated[
        str, typer.Option(help="Kind of regression; see docs/compensation_models.md.", autocompletion=_methods)
    ] = "gradient",
) -> None:
    """Train a drift model on thermal cycles, for use on others."""
    from testbed.cli.drift import print_training
    from testbed.drift.session import train_model

    found = {**train_model(sources, columns, method, out, output.note), "written": str(out)}
    output.show(found, lambda: print_training(found))


@app.command()
@expanded
def apply(
    model: Model,
    source: Source,
    output: Output,
    columns: Columns,
    out: Annotated[Path, typer.Option(help="Text file to write.")] = Path("runs/compensated.csv"),
) -> None:
    """Compensate a record with a trained model: time, rate, what was removed, and a flag outside the trained range."""
    from testbed.cli.drift import print_application
    from testbed.drift.session import apply_model

    found = {**apply_model(model, source, columns, out, output.note), "written": str(out)}
    output.show(found, lambda: print_application(found))


@app.command()
@expanded
def audit(
    model: Annotated[
        str,
        typer.Argument(
            metavar="MODEL", help=f"Trained model (JSON), or {', '.join(LITERATURE)}: methods of paper 3's Table 2."
        ),
    ],
    source: Source,
    output: Output,
    columns: Columns,
    out: Annotated[Path, typer.Option(help="Folder to write.")] = Path("runs/audit"),
) -> None:
    """Find out what a compensation removes and how much true rate survives; status 1 if it leaks or is none."""
    from testbed.cli.drift import print_audit
    from testbed.drift.page import audit_document
    from testbed.drift.session import audit_model

    audited = audit_model(model, source, columns, out, lambda text: output.note(f"{text} ..."))
    output.show({**audit_document(audited), "written": str(out)}, lambda: print_audit(audited, out))
    if not audited.audit.passed:
        raise typer.Exit(MISSED)
