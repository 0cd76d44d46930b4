"""The rows of a campaign: one for each case, seed and source, in columns that stay the same."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import testbed

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    import pyarrow as pa

    from testbed.campaigns.study import Study, Variation
    from testbed.runs.metrics import RunMetrics, SourceMetrics
    from testbed.scenario.model import Scenario

OK, FAILED = "ok", "failed"
# Of each source, as metrics.json has them.
NUMBERS = (
    "rmse_deg_s",
    "rmse_aligned_deg_s",
    "peak_error_deg_s",
    "mean_std_deg_s",
    "inside_2_std",
    "floor_rmse_deg_s",
    "optimum_rmse_deg_s",
    "optimum_settled_deg_s",
)
# Of each line of sight; the second kind for each window.
RESIDUAL, WINDOWED = "residual_rms_urad", ("rpe_urad", "mpe_urad")
_LINE = ("frequency_hz", "gain", "phase_deg", "error_deg_s", "optimum_deg_s")
_MOST_REASON = 2000


def schema_of(study: Study) -> pa.Schema:
    """Return the columns of a study: numbers where all values of an axis are numbers, else texts.

    Parameters
    ----------
    study : Study
        Whose axes stand between `launch` and the metrics.
    """
    import pyarrow as pa

    axes = []
    for key in study.axes:
        numeric = all(isinstance(in_si(case.scenario, key, case.values[key]), float) for case in study.cases)
        axes.append(pa.field(key, pa.float64() if numeric else pa.string()))
    lines = pa.list_(pa.struct([(name, pa.float64()) for name in _LINE]))
    return pa.schema(
        [
            ("case", pa.int32()),
            ("seed", pa.int64()),
            ("source", pa.string()),
            ("kind", pa.string()),
            ("launch", pa.int32()),
            *axes,
            *((name, pa.float64()) for name in NUMBERS),
            *((name, pa.float64()) for name in pointing_columns(study.cases)),
            ("nees", pa.float64()),
            ("missing", pa.int64()),
            ("lines", lines),
            ("belief", pa.string()),
            ("start", pa.string()),
            ("status", pa.string()),
            ("reason", pa.string()),
            ("scenario_sha256", pa.string()),
            ("version", pa.string()),
        ]
    )


def pointing_columns(cases: Sequence[Variation]) -> list[str]:
    """Return the columns of the line of sight: its residual, RPE and MPE over every window of any case [urad].

    Parameters
    ----------
    cases : sequence of Variation
        Of the study; without pointing the columns are null.
    """
    aimed = [case.scenario.pointing for case in cases if case.scenario.pointing is not None]
    windows = sorted({window.key for pointing in aimed for window in pointing.windows}, key=float)
    return [RESIDUAL, *(f"{kind}.{key}" for kind in WINDOWED for key in windows)]


def in_si(scenario: Scenario, key: str, written: Any) -> float | str | None:
    """Return what stands at a dotted key of a scenario, a quantity in SI.

    Parameters
    ----------
    scenario : Scenario
        The case.
    key : str
        Such as ``motion.0.sine.frequency``.
    written : Any
        What the study has there: returned as text where the parts keep no such value.
    """
    room, *way = key.split(".")
    here: Any = getattr(scenario, room, None) if way else scenario.frame
    if room == "motion" and way:
        here = scenario.motion[int(way[0])][1] if way[0].isdigit() and len(way) > 1 else None
        way = way[2:]
    elif room in ("sensors", "fusion") and way:
        here, way = here.get(way[0]), way[1:]
        here = getattr(here, "parameters", here)
    elif not way:
        way = [room]
    for step in way:
        here = here.get(step) if isinstance(here, dict) else getattr(here, step, None)
    if isinstance(here, int | float) and not isinstance(here, bool) and way:
        return float(here)
    return None if written is None else str(written)


def unit_at(scenario: Scenario, key: str) -> str:
    """Return the SI unit of the quantity at a dotted key of a scenario, a dash for a number without one.

    Parameters
    ----------
    scenario : Scenario
        Any case.
    key : str
        Such as ``motion.0.sine.frequency``.
    """
    here: Any = scenario.resolved()
    for step in key.split("."):
        if isinstance(here, list):
            here = here[int(step)] if step.isdigit() and int(step) < len(here) else None
        else:
            here = here.get(step) if isinstance(here, dict) else None
    return here.partition(" ")[2] if isinstance(here, str) and " " in here else "-"


def rows_of(case: Variation, seed: int, metrics: RunMetrics) -> list[dict[str, Any]]:
    """Return the rows of one case under one seed.

    Parameters
    ----------
    case : Variation
        Which.
    seed : int
        Of its noise.
    metrics : RunMetrics
        What came out.
    """
    found: list[dict[str, Any]] = []
    for kind, sources in (("sensor", metrics.sensors), ("filter", metrics.fusion)):
        for name, one in sources.items():
            sight = _sight(metrics, name) if kind == "filter" else {}
            found.append({**_common(case, seed), "source": name, "kind": kind, **_row(one), **sight})
    return found


def failed_row(case: Variation, seed: int, reason: str) -> dict[str, Any]:
    """Return the row of a case that has failed.

    Parameters
    ----------
    case : Variation
        Which.
    seed : int
        Of its noise.
    reason : str
        Why.
    """
    return {**_common(case, seed), "status": FAILED, "reason": reason[:_MOST_REASON]}


def _common(case: Variation, seed: int) -> dict[str, Any]:
    axes = {key: in_si(case.scenario, key, written) for key, written in case.values.items()}
    return {
        "case": case.number,
        "seed": seed,
        **axes,
        "status": OK,
        "scenario_sha256": case.sha256,
        "version": testbed.__version__,
    }


def _sight(metrics: RunMetrics, name: str) -> dict[str, float | None]:
    sight = metrics.pointing.get(name)
    if sight is None:
        return {}
    windowed = {f"{kind}.{key}": value for kind in WINDOWED for key, value in sight[kind].items()}
    return {RESIDUAL: sight.residual_rms_urad, **windowed}


def _row(source: SourceMetrics) -> dict[str, Any]:
    lines: Sequence[Mapping[str, Any]] = source.lines or []
    return {
        **{name: getattr(source, name) for name in NUMBERS},
        "nees": source.consistency.nees if source.consistency else None,
        "missing": source.missing,
        "lines": [{name: line.get(name) for name in _LINE} for line in lines],
        "belief": source.belief,
        "start": source.start,
    }
