"""The figures of an audit in data-sheet units, as they stand in audit.json and in the tables."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any

import numpy as np

from testbed.compensation.model_only import START_MARGIN
from testbed.drift.findings import DRIFT_PERIOD
from testbed.judging.allan_analysis import TERMS
from testbed.units import DEG_H

if TYPE_CHECKING:
    from testbed.allan.fit import AllanFit
    from testbed.drift.findings import Audit
    from testbed.drift.quality import Quality

# Letters of the coefficients that papers on fibre-optic gyros print.
LETTERS = ("Q", "N", "B")


def audit_summary(audit: Audit) -> dict[str, Any]:
    """Return the figures of an audit; None where they are not known or mean nothing.

    Parameters
    ----------
    audit : Audit
        To put in words.

    Returns
    -------
    dict
        With the units in the names; `before`, `after`, `low_passed` and `oracle` as `quality_summary` gives them.
    """
    return {
        "passed": audit.passed,
        "leaks": list(audit.leaks),
        "excess": list(audit.excess),
        "trained_on_this_record": audit.seen,
        "drift_reduction": _finite(audit.drift_reduction),
        "oracle_ratio_1h": _finite(audit.oracle_ratio),
        "block_std_over_oracle": audit.block_std_ratio,
        "bandwidth_hz": audit.bandwidth_hz,
        "least_gain_in_drift_band": min(line.gain for line in audit.gains if line.period >= DRIFT_PERIOD),
        "step_gain": audit.step_gain,
        "earth_rate_gain": audit.earth_gain,
        "temperature_rate_gain": audit.heat_gain,
        "gains": [
            {"period_s": line.period, "gain": line.gain, "phase_deg": math.degrees(line.phase)} for line in audit.gains
        ],
        **{
            name: None if quality is None else quality_summary(quality)
            for name, quality in (
                ("before", audit.before),
                ("after", audit.after),
                ("low_passed", audit.low_passed),
                ("oracle", audit.oracle),
            )
        },
    }


def start_summary(distance: float | None) -> dict[str, Any]:
    """Return how far from the trained ones a record starts [K], and whether that is too far; None if nothing is known.

    Parameters
    ----------
    distance : float or None
        Of `DriftModel.start_distance` [K].
    """
    return {
        "start_distance_k": distance,
        "starts_elsewhere": None if distance is None else distance > START_MARGIN,
    }


def quality_summary(quality: Quality) -> dict[str, Any]:
    """Return block std and Allan deviation at 1 h [deg/h], and each coefficient that the curve supports with its
    limits.

    Parameters
    ----------
    quality : Quality
        Of a record.

    Returns
    -------
    dict
        `coefficients` is None where the noise model does not describe the curve; a term that the record does not
        identify has the value None and an upper limit.
    """
    hour = quality.hour_deviation
    return {
        "block_std_100s_deg_h": quality.block_std / DEG_H,
        "allan_deviation_1h_deg_h": None if hour is None else hour / DEG_H,
        "fitted_to_s": quality.fitted_to,
        "coefficients": None if quality.fit is None else _coefficients(quality.fit),
    }


def _coefficients(fit: AllanFit) -> dict[str, Any]:
    return {term.letter: term.summary(fit) for term in TERMS if term.letter in LETTERS}


def _finite(value: float | None) -> float | None:
    return value if value is not None and np.isfinite(value) else None
