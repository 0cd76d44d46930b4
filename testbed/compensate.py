"""Drift compensation from files to files: what `testbed compensate` does."""

from __future__ import annotations

import json
from typing import TYPE_CHECKING

import numpy as np
from rich.console import Console
from rich.table import Table

from testbed.audit.leak import audit
from testbed.audit.page import Audited, write_audit
from testbed.audit.summary import DEG_H, LETTERS, summary
from testbed.compensation import paper3
from testbed.compensation.model_only import METHODS, DriftModel, train
from testbed.errors import Problem, ScenarioError, UnknownNameError
from testbed.report.numbers import significant
from testbed.store import failing_as_run_error, write_text
from testbed.thermal_records import Columns, ThermalRecord, read

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator, Sequence
    from pathlib import Path

    from testbed.compensation.record import Record
    from testbed.signals import FloatArray

PAPER = "paper3"


def train_model(sources: Sequence[Path], columns: Columns, method: str, out: Path) -> Iterator[str]:
    """Train a model on thermal cycles, write it, and yield the lines to print.

    Parameters
    ----------
    sources : sequence of Path
        Run folders or text files.
    columns : Columns
        How to read them.
    method : str
        Kind of regression.
    out : Path
        Model file (JSON).

    Yields
    ------
    str
        One line.

    Raises
    ------
    ScenarioError
        If a source cannot be read, the method is unknown or the cycles do not fit together.
    """
    if method not in METHODS:
        raise ScenarioError([Problem(str(UnknownNameError("method", method, METHODS)), key="--method")])
    cycles = []
    for source in sources:
        cycles.append(read(source, columns))
        yield f"cycle: {cycles[-1].name}, {cycles[-1].record.duration / 3600.0:.2f} h at {cycles[-1].record.sample_rate_hz:g} Hz"
    try:
        model = train([cycle.record for cycle in cycles], method=method)
    except ValueError as error:
        raise ScenarioError([Problem(str(error), file=", ".join(map(str, sources)))]) from error
    document = {**model.to_dict(), "trained_on": [cycle.name for cycle in cycles]}
    with failing_as_run_error(str(out)):
        out.parent.mkdir(parents=True, exist_ok=True)
        write_text(out, json.dumps(document, allow_nan=False) + "\n")
    yield f"method {method}; error of the cross-validation {model.blocked_error / DEG_H:.4g} deg/h, noise of the means included"
    yield f"written: {out}"


def read_model(path: Path) -> DriftModel:
    """Return the model that `train_model` wrote.

    Parameters
    ----------
    path : Path
        Model file.

    Raises
    ------
    ScenarioError
        If it is none.
    """
    try:
        document = json.loads(path.read_text(encoding="utf-8"))
        if not isinstance(document, dict):
            msg = f"drift model: expected a JSON object, got {type(document).__name__}"
            raise ScenarioError([Problem(msg, file=str(path))])
        return DriftModel.from_dict(document)
    except (OSError, ValueError) as error:
        msg = f"expected a model that `testbed compensate train` wrote: {error}"
        raise ScenarioError([Problem(msg, file=str(path))]) from error


def apply_model(path: Path, source: Path, columns: Columns, out: Path) -> str:
    """Compensate a record, write it as a text file, and return the line to print.

    Parameters
    ----------
    path : Path
        Model file.
    source : Path
        Run folder or text file.
    columns : Columns
        How to read it.
    out : Path
        Text file to write: time [s], compensated rate and drift [deg/h], and whether the temperature was outside the trained range.

    Raises
    ------
    ScenarioError
        If model or record cannot be read.
    """
    thermal = read(source, columns)
    block = read_model(path).apply(thermal.record)
    t = np.arange(block.rate.size) / thermal.record.sample_rate_hz
    rows = zip(t, block.rate / DEG_H, block.drift / DEG_H, block.extrapolated, strict=True)
    lines = [f"{time:.9g},{rate:.9g},{drift:.9g},{outside:d}" for time, rate, drift, outside in rows]
    with failing_as_run_error(str(out)):
        out.parent.mkdir(parents=True, exist_ok=True)
        write_text(out, "\n".join(["time_s,rate_deg_h,drift_deg_h,extrapolated", *lines]) + "\n")
    return f"{thermal.name}: {block.extrapolated.mean():.2%} of the samples outside the trained range; written: {out}"


def audit_model(model: str, source: Path, columns: Columns, out: Path, tell: Callable[[str], None]) -> Audited:
    """Audit a compensation on a record and write the folder of the audit.

    Parameters
    ----------
    model : str
        Model file, or `PAPER` for the paper's own protocol, which trains on the record that it corrects.
    source : Path
        Run folder or text file.
    columns : Columns
        How to read it.
    out : Path
        Folder.
    tell : callable
        Is told what is being done.

    Raises
    ------
    ScenarioError
        If model or record cannot be read, or the record is too short.
    """
    thermal = read(source, columns)
    try:
        audited = _audit_paper(thermal, tell) if model == PAPER else _audit_file(model, thermal, tell)
    except ValueError as error:
        raise ScenarioError([Problem(str(error), file=str(source))]) from error
    with failing_as_run_error(str(out)):
        write_audit(audited, out)
    return audited


def _audit_paper(thermal: ThermalRecord, tell: Callable[[str], None]) -> Audited:
    def compensate(record: Record) -> FloatArray:
        return paper3.compensate(record).rate

    compensated = compensate(thermal.record)
    found = audit(compensate, thermal.record, compensated, thermal.drift, tell)
    return Audited("the paper's protocol, trained on this record", thermal, compensated, found)


def _audit_file(path: str, thermal: ThermalRecord, tell: Callable[[str], None]) -> Audited:
    from pathlib import Path

    model = read_model(Path(path))
    block = model.apply(thermal.record)
    found = audit(lambda record: model.apply(record).rate, thermal.record, block.rate, thermal.drift, tell)
    name = f"{model.method}, trained on other cycles ({Path(path).name})"
    return Audited(name, thermal, block.rate, found, float(block.extrapolated.mean()))


def print_audit(audited: Audited, folder: Path) -> None:
    """Print the findings of an audit.

    Parameters
    ----------
    audited : Audited
        The audit.
    folder : Path
        Where its page is.
    """
    console, figures = Console(soft_wrap=True), summary(audited.audit)
    table = Table("", "100 s std", "sigma 1 h", *LETTERS, title=f"{audited.thermal.name}: {audited.method}")
    names = {"before": "record", "after": "compensated", "low_passed": "equal low-pass", "oracle": "oracle"}
    for key, label in names.items():
        if figures[key] is not None:
            table.add_row(label, *_row(figures[key]))
    console.print(table)
    console.print("std and sigma in deg/h, Q in urad, N in deg/sqrt(h), B in deg/h; none where the noise model fails")
    shown = {
        "drift reduction": "drift_reduction",
        "sigma at 1 h over the oracle's": "oracle_ratio_1h",
        "100 s std over the oracle's": "block_std_over_oracle",
        "bandwidth left [Hz]": "bandwidth_hz",
        "least gain of a slow true rate": "least_gain_in_drift_band",
        "gain of a step": "step_gain",
    }
    for label, key in shown.items():
        if figures[key] is not None:
            console.print(f"{label}: {significant(figures[key], 4)}")
    for leak in figures["leaks"]:
        console.print(f"LEAK: {leak}", style="red")
    console.print("verdict: " + ("no leak found" if figures["passed"] else "a leak; do not believe this result"))
    console.print(f"written: {folder / 'audit.html'}")


def _row(quality: dict[str, object]) -> list[str]:
    found = quality["coefficients"]
    row = [
        significant(quality[key])  # type: ignore[arg-type]
        for key in ("block_std_100s_deg_h", "allan_deviation_1h_deg_h")
    ]
    if not isinstance(found, dict):
        return [*row, *("-" for _ in LETTERS)]
    return [
        *row,
        *(
            f"< {significant(found[letter]['upper'])}"
            if found[letter]["value"] is None
            else significant(found[letter]["value"], 4)
            for letter in LETTERS
        ),
    ]
