"""The folder of an audit: audit.json, the curves as CSV, and a page to read."""

from __future__ import annotations

import json
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from testbed.drift.figures import drift_figure, gain_figure, residual_allan_figure
from testbed.drift.summary import audit_summary, start_summary
from testbed.drift.table_2 import ORIGINAL, PIPELINE, TABLE_2
from testbed.pages.template import render
from testbed.units import DEG_H

if TYPE_CHECKING:
    from pathlib import Path

    from testbed.drift.findings import Audit
    from testbed.drift.quality import Quality
    from testbed.drift.records import ThermalRecord
    from testbed.signals import FloatArray


@dataclass(frozen=True)
class Audited:
    """An audit and what it was of.

    Parameters
    ----------
    method : str
        What compensated.
    thermal : ThermalRecord
        What went in, with its true drift if a simulation knows it.
    compensated : ndarray, shape (n_time,)
        What came out [rad/s].
    audit : Audit
        The findings.
    extrapolated : float, optional
        Share of samples outside the trained range [-].
    start_distance : float, optional
        From the first temperature to the nearest start of a training cycle [K].
    trained_on : tuple of str, optional
        Names of the cycles that it was trained on before.
    """

    method: str
    thermal: ThermalRecord
    compensated: FloatArray
    audit: Audit
    extrapolated: float | None = None
    start_distance: float | None = None
    trained_on: tuple[str, ...] = ()


def write_audit(audited: Audited, folder: Path) -> Path:
    """Write audit.json, allan.csv, gains.csv and audit.html.

    Parameters
    ----------
    audited : Audited
        To write.
    folder : Path
        Made if it does not exist; whoever wants it whole or not at all writes it beside its place (`RunFolder`).

    Returns
    -------
    Path
        The page.
    """
    texts = {
        "audit.json": json.dumps(audit_document(audited), indent=2, allow_nan=False) + "\n",
        "gains.csv": _gains(audited.audit),
        "allan.csv": _allan(curves(audited.audit)),
        "audit.html": _page(audited, audit_summary(audited.audit)),
    }
    folder.mkdir(parents=True, exist_ok=True)
    for name, text in texts.items():
        (folder / name).write_text(text, encoding="utf-8")
    return folder / "audit.html"


def audit_document(audited: Audited) -> dict[str, Any]:
    """Return the content of audit.json: what was audited, and its figures with the units in their names."""
    return {
        "method": audited.method,
        "trained_on": list(audited.trained_on),
        "record": audited.thermal.name,
        "extrapolated": audited.extrapolated,
        **start_summary(audited.start_distance),
        **audit_summary(audited.audit),
    }


def curves(audit: Audit) -> dict[str, Quality]:
    """Return the qualities of an audit that are known, by the name of their curve."""
    named = {
        "record": audit.before,
        "compensated": audit.after,
        "equal low-pass": audit.low_passed,
        "oracle": audit.oracle,
    }
    return {name: quality for name, quality in named.items() if quality is not None}


def _gains(audit: Audit) -> str:
    rows = [f"{line.period!r},{line.gain!r},{line.phase!r}" for line in audit.gains]
    return "\n".join(["period_s,gain,phase_rad", *rows]) + "\n"


def _allan(qualities: dict[str, Quality]) -> str:
    rows = ["record,tau_s,deviation_deg_h,lower_deg_h,upper_deg_h"]
    for name, quality in qualities.items():
        curve = quality.curve
        columns = zip(curve.tau, curve.deviation / DEG_H, curve.lower / DEG_H, curve.upper / DEG_H, strict=True)
        rows += [f"{name},{tau:.9g},{middle:.9g},{low:.9g},{high:.9g}" for tau, middle, low, high in columns]
    return "\n".join(rows) + "\n"


def _page(audited: Audited, figures: dict[str, object]) -> str:
    record = audited.thermal.record
    drawn = {
        "drift": drift_figure(record, audited.compensated, audited.thermal.drift),
        "allan": residual_allan_figure(curves(audited.audit)),
        "gain": gain_figure(audited.audit),
    }
    return render(
        "audit.html.j2",
        drawn,
        method=audited.method,
        record=audited.thermal.name,
        hours=record.rate.size / record.sample_rate_hz / 3600.0,
        sample_rate_hz=record.sample_rate_hz,
        audit=figures,
        extrapolated=audited.extrapolated,
        start=start_summary(audited.start_distance),
        trained_on=audited.trained_on,
        paper={name: TABLE_2[name] for name in (ORIGINAL, PIPELINE)},
    )
