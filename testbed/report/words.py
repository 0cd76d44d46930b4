"""The run in words: the summary on top of a report and the names of its metrics."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from testbed.pages.numbers import plain, significant
from testbed.runs.table import error_unit
from testbed.units import DEG

if TYPE_CHECKING:
    from collections.abc import Mapping

    from testbed.report.digest import Digest
    from testbed.runs.metrics import FindingMetrics, RunMetrics, SourceMetrics

METRICS = {
    "rmse_deg_s": "RMSE",
    "rmse_aligned_deg_s": "aligned RMSE",
    "peak_error_deg_s": "peak error",
    "floor_rmse_deg_s": "noise floor",
    "ratio": "RMSE / floor",
    "optimum_rmse_deg_s": "optimum of this run",
    "optimum_settled_deg_s": "settled optimum",
    "optimum_ratio": "RMSE / optimum",
    "mean_std_deg_s": "claimed std",
    "mean_deg_s": "mean",
    "spread_deg_s": "spread",
}
# Columns that are the RMSE over a bound.
RATIOS = {"ratio": "floor_rmse_deg_s", "optimum_ratio": "optimum_rmse_deg_s"}

# A unit of a finding -> how it is shown: factor and unit.
_UNITS = {"s": (1e3, "ms"), "rad/s": (1.0 / DEG, "deg/s"), "1": (1.0, "")}

_SHOWN = {*METRICS, "inside_2_std"}


def _best(sources: Mapping[str, SourceMetrics]) -> str | None:
    rmse = {name: source.rmse_deg_s for name, source in sources.items() if source.rmse_deg_s is not None}
    return min(rmse, key=lambda name: rmse[name]) if rmse else None


def over_bound(source: SourceMetrics, column: str) -> float | None:
    """Return RMSE over the bound of a column of RATIOS [-], None where either is undefined or the bound is zero."""
    return source.over(getattr(source, RATIOS[column]))


def summary(metrics: RunMetrics, digest: Digest) -> str:
    """Return the paragraph that says what came out: the best filter, against the sensors and the floor, its honesty,
    the expectations.
    """
    what = "run" if metrics.replay is None else "recording"
    parts = [
        f"The {what} lasted {plain(metrics.duration_s)} s; everything is judged from {plain(metrics.settle_s)} s on.",
        *_stands(metrics),
        *(_accuracy(metrics) if digest.has_truth else _self_consistency(metrics)),
        *_honesty(metrics, digest),
        *([_expectations(metrics)] if metrics.replay is None else []),
    ]
    return " ".join(parts)


def _stands(metrics: RunMetrics) -> list[str]:
    """Return what the verdict says of a recording: what stands against it."""
    if metrics.replay is None:
        return []
    standing = [f"{one.kind} of {one.sensor}" for one in metrics.findings if not one.fixed]
    fixed = [f"{one.kind} of {one.sensor}" for one in metrics.findings if one.fixed]
    words = [f"Against it stands: {', '.join(standing)}; read every number below in that light."] if standing else []
    return [*words, *([f"Put right before the filters ran: {', '.join(fixed)}."] if fixed else [])]


def _self_consistency(metrics: RunMetrics) -> list[str]:
    """Return what is said of the filters of a recording without a reference."""
    parts = ["It has no reference, so no error is known."]
    for name, source in metrics.fusion.items():
        verdict = None if source.consistency is None else source.consistency.verdict
        if verdict == "consistent":
            parts.append(f"The readings are what {name} expects of them, in size.")
        elif verdict is not None:
            parts.append(f"{name}: {verdict}, so its belief does not describe these sensors.")
    return parts


def finding_text(finding: FindingMetrics) -> str:
    """Return value and interval of a finding with their unit, as a page shows them.

    Parameters
    ----------
    finding : FindingMetrics
        As metrics.json has it, in SI.
    """
    factor, unit = (1e6, "ppm") if finding.kind == "rate" else _UNITS.get(finding.unit, (1.0, finding.unit))
    if finding.value is None:
        return "—"
    value = significant(factor * finding.value)
    if finding.lower is None or finding.upper is None:
        return f"{value} {unit}".rstrip()
    return f"{value} {unit} ({significant(factor * finding.lower)} to {significant(factor * finding.upper)})".replace(
        "  ", " "
    )


def _accuracy(metrics: RunMetrics) -> list[str]:
    best, sensor = _best(metrics.fusion), _best(metrics.sensors)
    unit, scale = error_unit(metrics)
    if best is None:
        if metrics.fusion or sensor is None:
            return ["No filter has a defined error."]
        error = metrics.sensors[sensor].rmse_deg_s or 0.0
        among = "The most accurate sensor is" if len(metrics.sensors) > 1 else "The sensor is"
        return [f"{among} {sensor}: its error is {significant(scale * error)} {unit} rms. No filter was run."]
    rmse = metrics.fusion[best].rmse_deg_s or 0.0
    among = (
        f"Of {len(metrics.fusion)} filters {best} is the most accurate"
        if len(metrics.fusion) > 1
        else f"The filter {best} was run"
    )
    text = [f"{among}: its error is {significant(scale * rmse)} {unit} rms, phase included."]
    alone = metrics.sensors[sensor].rmse_deg_s if sensor else None
    if alone and rmse > 0:
        factor = alone / rmse
        which = f"the best sensor alone ({sensor}," if len(metrics.sensors) > 1 else f"the sensor alone ({sensor},"
        compared = f"{significant(factor)} times smaller" if factor >= 1 else f"{significant(1 / factor)} times larger"
        text.append(f"That is {compared} than the error of {which} {significant(scale * alone)} {unit}).")
    ratio, to_optimum = (over_bound(metrics.fusion[best], column) for column in RATIOS)
    if ratio is not None:
        known = (
            "which no filter of an unknown signal can get below"
            if ratio >= 1
            else "so what it assumes of the signal pays here"
        )
        text.append(f"It is {significant(ratio)} times the noise floor, {known}.")
    if to_optimum is not None:
        text.append(
            f"It is {significant(to_optimum)} times the optimum, the best linear filter of this signal and start."
        )
    return text


def _honesty(metrics: RunMetrics, digest: Digest) -> list[str]:
    best = _best(metrics.fusion)
    inside = digest.filter_errors[best].inside if best else None
    if inside is None:
        return []
    share = f"{100 * inside:.1f} % of its errors lie inside ±2 std, 95.4 % would if they were Gaussian with that std"
    return [f"Its own standard deviation {honesty(inside)}: {share}."]


def honesty(inside: float) -> str:
    """Return what a share `inside` of errors within two standard deviations says about a filter's own std (95.4 % if
    Gaussian).
    """
    if inside < 0.90:
        return "is too small for the error it makes"
    if inside > 0.99:
        return "is larger than the error it makes"
    return "agrees with the error it makes"


def claims(metrics: RunMetrics) -> dict[str, dict[str, Any]]:
    """Return by filter the rows of the table of consistency: sensor -> value and bound of NIS and whiteness, of filters
    that have a verdict.
    """
    rows = {}
    for name, source in metrics.fusion.items():
        if source.consistency is not None and source.consistency.verdict is not None:
            extra = source.consistency.model_extra or {}
            keys = ("nis", "nis_bounds", "whiteness", "whiteness_bound")
            rows[name] = {sensor: {key: extra.get(f"{key}_{sensor}") for key in keys} for sensor in metrics.sensors}
    return rows


def _expectations(metrics: RunMetrics) -> str:
    n_all, n_met = len(metrics.expectations), sum(item.met for item in metrics.expectations)
    if n_all == 0:
        return "The scenario states no expectation."
    if n_met == n_all:
        return (
            "The one expectation of the scenario was met."
            if n_all == 1
            else f"{'Both' if n_all == 2 else f'All {n_all}'} expectations of the scenario were met."
        )
    missed = ", ".join(f"{item.subject} {item.metric} {item.bound}" for item in metrics.expectations if not item.met)
    return f"{n_all - n_met} of {n_all} expectations of the scenario missed: {missed}."


def further(metrics: RunMetrics) -> dict[str, dict[str, Any]]:
    """Return the numbers of ``metrics.json`` that the tables do not show, by source."""
    found = {}
    table = {} if metrics.turntable is None else {"turntable": metrics.turntable}
    for name, source in {**table, **metrics.sensors, **metrics.fusion}.items():
        numbers = {
            key: value
            for key, value in source.items()
            if isinstance(value, int | float) and not isinstance(value, bool) and key not in _SHOWN
        }
        if numbers:
            found[name] = numbers
    return found
