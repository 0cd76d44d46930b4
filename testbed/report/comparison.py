"""Two runs side by side: what differs in their scenarios, and what became of each sensor and filter."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, NamedTuple

from testbed.inputs.tree import read_yaml
from testbed.pages.palette import series_colors
from testbed.pages.template import render
from testbed.report.comparison_figures import errors_beside, spectra_beside
from testbed.report.digest import Digest, digest_run
from testbed.runs.atomic import write_text
from testbed.runs.results import RunRecord
from testbed.runs.table import error_unit

if TYPE_CHECKING:
    from collections.abc import Iterator
    from pathlib import Path

    from matplotlib.figure import Figure

    from testbed.runs.metrics import RunMetrics, SourceMetrics

# Names and files that differ whatever was asked.
_ALWAYS = {"name", "description", "file"}
MOST_KEYS = 200


class Side(NamedTuple):
    """One of the two runs."""

    metrics: RunMetrics
    digest: Digest
    scenario: Any


def write_comparison(first: Path, second: Path, out: Path) -> Path:
    """Write a page that holds two finished runs against each other.

    Parameters
    ----------
    first, second : Path
        Run folders, A and B.
    out : Path
        The page.

    Returns
    -------
    Path
        The page.

    Raises
    ------
    ScenarioError
        If a folder lacks a file, or a file is damaged; names it and what was expected.
    """
    a, b = _side(first), _side(second)
    unit = error_unit(a.metrics)
    common = [name for name in a.metrics.sources if name in b.metrics.sources]
    page = render(
        "comparison.html.j2",
        _figures(a, b, unit),
        titles=(f"A: {first.name}", f"B: {second.name}"),
        sides=(a.metrics, b.metrics),
        unit=unit[0],
        scale=unit[1],
        differs=list(_differs(a.scenario, b.scenario)),
        most=MOST_KEYS,
        common=common,
        alone=[sorted(set(one.metrics.sources) - set(common)) for one in (a, b)],
        ratio=_ratio,
    )
    out.parent.mkdir(parents=True, exist_ok=True)
    write_text(out, page)
    return out


def _side(folder: Path) -> Side:
    run = RunRecord.open(folder)
    scenario = read_yaml(folder / "scenario.yaml", "the resolved scenario").data
    return Side(run.metrics, digest_run(run), scenario)


def _differs(a: Any, b: Any, path: str = "") -> Iterator[tuple[str, Any, Any]]:
    """Yield the dotted key and both values where two trees differ: None where one has no such key; of a whole part that
    only one has, its name.
    """
    if isinstance(a, dict) and isinstance(b, dict):
        for key in {**a, **b}:
            if path or key not in _ALWAYS:
                yield from _differs(a.get(key), b.get(key), f"{path}.{key}" if path else str(key))
    elif isinstance(a, list) and isinstance(b, list) and len(a) == len(b):
        for index, pair in enumerate(zip(a, b, strict=True)):
            yield from _differs(*pair, f"{path}.{index}")
    elif a != b:
        yield path, _brief(a), _brief(b)


def _brief(value: Any) -> Any:
    return "there" if isinstance(value, dict) else value


def _ratio(a: SourceMetrics, b: SourceMetrics) -> float | None:
    return b.rmse_deg_s / a.rmse_deg_s if a.rmse_deg_s and b.rmse_deg_s is not None else None


def _figures(a: Side, b: Side, unit: tuple[str, float]) -> dict[str, Figure]:
    names = list(dict.fromkeys([*a.metrics.fusion, *b.metrics.fusion]))
    sensors = list(dict.fromkeys([*a.metrics.sensors, *b.metrics.sensors]))
    colors = series_colors(sensors, names)
    drawn = {}
    if any(one.digest.filter_errors for one in (a, b)):
        drawn["errors"] = errors_beside((a.digest, b.digest), names, colors, unit)
    shared = [name for name in names if name in a.metrics.fusion and name in b.metrics.fusion]
    if shared:
        floors = (a.metrics.floor_density, b.metrics.floor_density)
        drawn["spectra"] = spectra_beside((a.digest, b.digest), shared, colors, floors, unit)
    return drawn
