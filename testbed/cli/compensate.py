"""Command line of the drift compensation: train, apply, audit. Imports here are light, as in `testbed.cli.app`."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from testbed.compensation import PAPER

if TYPE_CHECKING:
    from testbed.drift.records import Columns

app = typer.Typer(
    name="compensate",
    help="Compensate the temperature drift of a fibre-optic gyro: train a model, apply it, audit it.",
    no_args_is_help=True,
)

LEAK = 1

Source = Annotated[Path, typer.Argument(metavar="SOURCE", help="Run folder, or text file with rate and temperature.")]
Sources = Annotated[list[Path], typer.Argument(metavar="SOURCE...", help="Thermal cycles: run folders or text files.")]
Model = Annotated[Path, typer.Argument(metavar="MODEL", help="Trained model (JSON).")]
Column = Annotated[str, typer.Option(help="Column of the rate, by name or number from 1 on.")]
Unit = Annotated[str | None, typer.Option(help="Unit of the rate; default that in the file, or deg/h.")]
Temperature = Annotated[str, typer.Option(help="Column of the temperature.")]
TemperatureUnit = Annotated[
    str | None, typer.Option(help="Unit of the temperature; default that in the file, or degC.")
]
Rate = Annotated[str | None, typer.Option(help="Sample rate of a file, as 1 or '1 Hz'.")]
Time = Annotated[str | None, typer.Option(help="Column of the time, instead of the sample rate.")]
TimeUnit = Annotated[str | None, typer.Option(help="Unit of the time; default that in the file, or s.")]
Sensor = Annotated[str | None, typer.Option(help="Sensor of a run folder that has several with a thermometer.")]


def _columns(
    column: str,
    unit: str | None,
    temperature: str,
    temperature_unit: str | None,
    rate: str | None,
    time: str | None,
    time_unit: str | None,
    sensor: str | None,
) -> Columns:
    from testbed.drift.records import Columns

    return Columns(column, temperature, unit, temperature_unit, rate, time, time_unit, sensor)


@app.command()
def train(
    sources: Sources,
    out: Annotated[Path, typer.Option(help="Model file to write.")] = Path("drift_model.json"),
    method: Annotated[str, typer.Option(help="Kind of regression; see docs/compensation_models.md.")] = "gradient",
    column: Column = "rate",
    unit: Unit = None,
    temperature: Temperature = "temperature",
    temperature_unit: TemperatureUnit = None,
    rate: Rate = None,
    time: Time = None,
    time_unit: TimeUnit = None,
    sensor: Sensor = None,
) -> None:
    """Train a drift model on thermal cycles, for use on others."""
    from testbed.drift.session import train_model

    columns = _columns(column, unit, temperature, temperature_unit, rate, time, time_unit, sensor)
    for line in train_model(sources, columns, method, out):
        typer.echo(line)


@app.command()
def apply(
    model: Model,
    source: Source,
    out: Annotated[Path, typer.Option(help="Text file to write.")] = Path("compensated.csv"),
    column: Column = "rate",
    unit: Unit = None,
    temperature: Temperature = "temperature",
    temperature_unit: TemperatureUnit = None,
    rate: Rate = None,
    time: Time = None,
    time_unit: TimeUnit = None,
    sensor: Sensor = None,
) -> None:
    """Compensate a record with a trained model: time, rate, what was removed, and a flag outside the trained range."""
    from testbed.drift.session import apply_model

    columns = _columns(column, unit, temperature, temperature_unit, rate, time, time_unit, sensor)
    for line in apply_model(model, source, columns, out):
        typer.echo(line)


@app.command()
def audit(
    model: Annotated[
        str, typer.Argument(metavar="MODEL", help=f"Trained model (JSON), or {PAPER}: the paper's own protocol.")
    ],
    source: Source,
    out: Annotated[Path, typer.Option(help="Folder to write.")] = Path("runs/audit"),
    column: Column = "rate",
    unit: Unit = None,
    temperature: Temperature = "temperature",
    temperature_unit: TemperatureUnit = None,
    rate: Rate = None,
    time: Time = None,
    time_unit: TimeUnit = None,
    sensor: Sensor = None,
) -> None:
    """Find out what a compensation removes and how much true rate survives; status 1 if it leaks."""
    from testbed.cli.audit import print_audit
    from testbed.drift.session import audit_model

    columns = _columns(column, unit, temperature, temperature_unit, rate, time, time_unit, sensor)
    audited = audit_model(model, source, columns, out, lambda text: typer.echo(f"{text} ...", err=True))
    print_audit(audited, out)
    if audited.audit.leaks:
        raise typer.Exit(LEAK)
