"""What the reader of a report zooms into: the whole run in more intervals than a printed figure has room for."""

from __future__ import annotations

import base64
from typing import TYPE_CHECKING, Any

from testbed.pages.axes import DEGREE

if TYPE_CHECKING:
    from collections.abc import Mapping

    from testbed.pages.envelope import Envelope
    from testbed.report.digest import Digest
    from testbed.report.figures import Unit


def closer_views(digest: Digest, colors: Mapping[str, str], unit: Unit) -> list[dict[str, Any]]:
    """Return what can be looked at: the sensors and the filters, each over the truth, and the filters' errors, each in
    a chart of its own, for they would hide each other.

    Parameters
    ----------
    digest : Digest
        Traces of the run.
    colors : Mapping
        Group (``truth``, ``sensors/mhd_ars``, ...) to color.
    unit : tuple of str and float
        Unit of the rates, and what deg/s is multiplied by for it.
    """
    rates = {group: trace.close for group, trace in digest.rates.items()}
    shown_errors = digest.filter_errors if digest.has_truth else {}
    errors = {f"fusion/{name}": trace.close for name, trace in shown_errors.items() if trace.close is not None}
    views = [
        ("Sensors", f"rate [{unit[0]}]", [_over_truth(rates, "sensors/")]),
        ("Filters", f"rate [{unit[0]}]", [_over_truth(rates, "fusion/")]),
        ("Errors of the filters", f"error [{unit[0]}]", [{group: one} for group, one in errors.items()]),
    ]
    return [
        {
            "title": title,
            "label": words,
            "charts": [
                [_trace(group, one, colors[group], unit[1] * DEGREE) for group, one in shown.items()]
                for shown in charts
            ],
        }
        for title, words, charts in views
        if any(set(shown) - {"truth"} for shown in charts)
    ]


def _over_truth(rates: Mapping[str, Envelope], kind: str) -> dict[str, Envelope]:
    beside = {"truth": rates["truth"]} if "truth" in rates else {}
    return beside | {group: one for group, one in rates.items() if group.startswith(kind)}


def _trace(group: str, envelope: Envelope, color: str, scale: float) -> dict[str, Any]:
    time = envelope.time
    return {
        "name": group.split("/", 1)[-1],
        "color": color,
        "start": float(time[0]),
        "step": float((time[-1] - time[0]) / max(time.size - 1, 1)),
        "low": _packed(scale * envelope.low),
        "high": _packed(scale * envelope.high),
    }


def _packed(values: Any) -> str:
    """Return the values as 32-bit floats, lowest byte first, in base 64."""
    return base64.b64encode(values.astype("<f4").tobytes()).decode()
