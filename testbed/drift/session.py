"""Drift compensation from files to files: what `testbed compensate` does."""

from __future__ import annotations

import json
from dataclasses import replace
from inspect import getdoc
from itertools import islice
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from pydantic import ValidationError

from testbed._version import __version__
from testbed.compensation import LITERATURE
from testbed.compensation.document import ModelDocument, sealed
from testbed.compensation.model_only import METHODS, DriftModel, train
from testbed.document import findings
from testbed.drift.leak import find_leaks
from testbed.drift.page import Audited, write_audit
from testbed.drift.records import ThermalRecord, check_options, read_thermal
from testbed.drift.summary import start_summary
from testbed.errors import Problem, ScenarioError, UnknownNameError, shortened
from testbed.inputs.files import read_bytes
from testbed.parts import resolve
from testbed.runs.atomic import write_text
from testbed.runs.folder import RunFolder, failing_as_run_error
from testbed.units import DEG_H

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from testbed.drift.columns import Columns

# A rate taken for a temperature moves by less, and so does an oven that was not switched on.
LEAST_SPAN = 1.0  # K
_MOST_BYTES = 1 << 22
_MOST_FINDINGS = 100


def train_model(
    sources: Sequence[Path], columns: Columns, method: str, out: Path, tell: Callable[[str], None]
) -> dict[str, Any]:
    """Train a model on thermal cycles and write it.

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
    tell : callable
        Is told what is being done.

    Returns
    -------
    dict
        Method, the cycles' names and the error of the cross-validation, noise of the means included.

    Raises
    ------
    ScenarioError
        If a source cannot be read, the method is unknown or the cycles do not fit together.
    """
    if method not in METHODS:
        raise ScenarioError([Problem(str(UnknownNameError("method", method, METHODS)), key="--method")])
    check_options(sources, columns)
    _check_file(out)
    cycles: list[ThermalRecord] = []
    for source in sources:
        cycle = read_thermal(source, columns)
        _check_cycle(source, cycle, cycles)
        cycles.append(cycle)
        tell(f"cycle: {cycle}")
    tell(f"training {method} ...")
    try:
        model = train([cycle.record for cycle in cycles], method=method)
    except ValueError as error:
        raise ScenarioError([Problem(str(error), file=", ".join(map(str, sources)))]) from error
    document = sealed({**model.to_dict(), "trained_on": {cycle.fingerprint: cycle.name[:300] for cycle in cycles}})
    with failing_as_run_error(str(out)):
        out.parent.mkdir(parents=True, exist_ok=True)
        write_text(out, json.dumps(document, allow_nan=False) + "\n")
    return {
        "method": method,
        "cycles": [cycle.name for cycle in cycles],
        "blocked_error_deg_h": model.blocked_error / DEG_H,
    }


def _check_cycle(source: Path, cycle: ThermalRecord, before: Sequence[ThermalRecord]) -> None:
    """Refuse a cycle without heat, and one that was there before."""
    span = float(np.ptp(cycle.record.temperature))
    if span < LEAST_SPAN:
        msg = f"expected a temperature that moves by at least {LEAST_SPAN:g} K, got {span:.3g} K; name its column"
        raise ScenarioError([Problem(msg, key="--temperature", file=str(source))])
    if cycle.fingerprint in {other.fingerprint for other in before}:
        raise ScenarioError([Problem("expected different cycles, got this one twice", file=str(source))])


def _check_file(out: Path) -> None:
    if out.is_dir():
        raise ScenarioError([Problem("expected a file to write, got a folder", key="--out", file=str(out))])


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
    return _read_document(path)[0]


def _read_document(path: Path) -> tuple[DriftModel, dict[str, str]]:
    """Return a model, and the names of the cycles that it was trained on by their fingerprints."""
    document = _read_json(path)
    try:
        model = DriftModel.from_dict(document)
    except ValidationError as error:
        wrong = [
            Problem(message, ".".join(map(str, key)), str(path))
            for key, message in islice(findings(error, ModelDocument, document), _MOST_FINDINGS)
        ]
        raise ScenarioError(wrong) from error
    except ValueError as error:
        raise _no_model(path, str(error)) from error
    if not document.get("trained_on"):
        raise _no_model(path, "trained_on: expected the digests of the cycles that it was trained on, got none")
    return model, dict(document["trained_on"])


def _read_json(path: Path) -> dict[str, Any]:
    content = read_bytes(path, _MOST_BYTES, "a drift model")
    try:
        document = json.loads(content.decode("utf-8"), object_pairs_hook=_unrepeated)
    except (ValueError, RecursionError) as error:
        raise _no_model(path, f"not JSON: {shortened(str(error))}") from error
    if not isinstance(document, dict):
        raise _no_model(path, "expected a mapping")
    return document


def _unrepeated(pairs: list[tuple[str, Any]]) -> dict[str, Any]:
    found = dict(pairs)
    if len(found) < len(pairs):
        msg = "a key is repeated"
        raise ValueError(msg)
    return found


def _no_model(path: Path, reason: str) -> ScenarioError:
    msg = f"expected a model that `testbed compensate train` wrote: {reason}"
    return ScenarioError([Problem(msg, file=str(path))])


def apply_model(path: Path, source: Path, columns: Columns, out: Path, tell: Callable[[str], None]) -> dict[str, Any]:
    """Compensate a record and write it as a text file.

    Parameters
    ----------
    path : Path
        Model file.
    source : Path
        Run folder or text file.
    columns : Columns
        How to read it.
    out : Path
        Text file to write: time [s], compensated rate and drift [deg/h], and whether the temperature was outside the
        trained range.
    tell : callable
        Is told what is being done.

    Returns
    -------
    dict
        Method, name of the record, the share of its samples outside the trained range and how far from the trained
        ones it starts.

    Raises
    ------
    ScenarioError
        If model or record cannot be read.
    """
    check_options([source], columns)
    _check_file(out)
    model, thermal = read_model(path), read_thermal(source, columns)
    tell(f"record: {thermal}")
    try:
        block = model.apply(thermal.record)
    except ValueError as error:
        raise ScenarioError([Problem(str(error), file=str(source))]) from error
    t = np.arange(block.rate.size) / thermal.record.sample_rate_hz
    rows = zip(t, block.rate / DEG_H, block.drift / DEG_H, block.extrapolated, strict=True)
    lines = [f"{time:.9g},{rate:.9g},{drift:.9g},{outside:d}" for time, rate, drift, outside in rows]
    with failing_as_run_error(str(out)):
        out.parent.mkdir(parents=True, exist_ok=True)
        write_text(out, "\n".join(["time_s,rate_deg_h,drift_deg_h,extrapolated", *lines]) + "\n")
    return {
        "method": model.method,
        "record": thermal.name,
        "extrapolated": float(block.extrapolated.mean()),
        **start_summary(model.start_distance(thermal.record)),
    }


def audit_model(model: str, source: Path, columns: Columns, out: Path, tell: Callable[[str], None]) -> Audited:
    """Audit a compensation on a record and write the folder of the audit.

    Parameters
    ----------
    model : str
        Model file, or a name of `LITERATURE`, which works on the record that it corrects.
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
        If model or record cannot be read, the record is too short, or `out` cannot be written or holds something else.
    RunError
        If the disk is full.
    """
    check_options([source], columns)
    trained = None if model in LITERATURE else _read_document(Path(model))
    thermal = read_thermal(source, columns)
    with RunFolder(out) as folder, failing_as_run_error(str(out)):
        tell(f"compensating {thermal}")
        try:
            audited = (
                _audit_published(model, thermal, tell)
                if trained is None
                else _audit_trained(Path(model), *trained, thermal, tell)
            )
        except ValueError as error:
            raise ScenarioError([Problem(str(error), file=str(source))]) from error
        write_audit(audited, folder.path)
        folder.finish({"audited": audited.method, "version": __version__})
    return audited


def _audit_published(name: str, thermal: ThermalRecord, tell: Callable[[str], None]) -> Audited:
    """Audit a method of the literature; the first line of its docstring says what it is."""
    compensate = resolve("method", name, LITERATURE)
    compensated = compensate(thermal.record)
    found = find_leaks(compensate, thermal.record, compensated, thermal.drift, tell)
    summary = (getdoc(compensate) or name).splitlines()[0].rstrip(".")
    return Audited(summary, thermal, compensated, found)


def _audit_trained(
    path: Path, model: DriftModel, trained_on: dict[str, str], thermal: ThermalRecord, tell: Callable[[str], None]
) -> Audited:
    block = model.apply(thermal.record)
    found = find_leaks(lambda record: model.apply(record).rate, thermal.record, block.rate, thermal.drift, tell)
    found = replace(found, seen=thermal.fingerprint in trained_on)
    name, outside = f"frozen {model.method} model {path.name}", float(block.extrapolated.mean())
    away = model.start_distance(thermal.record)
    return Audited(name, thermal, block.rate, found, outside, away, tuple(trained_on.values()))
