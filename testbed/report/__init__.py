"""The static report of a run: one HTML page with table, figures, scenario and definitions, that needs nothing else."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

from testbed.pages.palette import series_colors
from testbed.pages.svg import FORMATS, figure_bytes
from testbed.pages.template import render
from testbed.report.bode import bode_figure, powered, shows
from testbed.report.budget import band_rows, budget_figure, line_error, line_optima
from testbed.report.closer import closer_views
from testbed.report.digest import N_CLOSE, Digest, digest_run
from testbed.report.figures import errors_figure, rates_figure, spectrum_figure, thermal_figure
from testbed.report.pointing import inside_rows, sight_budget_figure, sight_curves_figure, sight_rows
from testbed.report.still_figures import allan_curves, errors_allan_figure, profile_figure
from testbed.report.within_figures import adapted_figure, whiteness_figure
from testbed.report.words import METRICS, RATIOS, claims, finding_text, further, honesty, over_bound, summary
from testbed.runs.manifest import rewrite
from testbed.runs.metrics import read_text
from testbed.runs.results import RunRecord
from testbed.runs.table import error_unit, metric_text

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from testbed.runs.metrics import RunMetrics

REPORT = "report.html"
FIGURES = "figures"


def write_report(run_dir: Path) -> Path:
    """Write ``report.html`` from ``run.nc``, ``metrics.json`` and ``scenario.yaml`` of a finished run folder.

    Signals are read in blocks, so that memory does not grow with the duration. The page is written beside and renamed:
    an earlier one stays whole until the new one is. The folder's manifest follows it.

    Parameters
    ----------
    run_dir : Path
        Run folder.

    Returns
    -------
    Path
        The report.

    Raises
    ------
    ScenarioError
        If the folder lacks a file, or a file is damaged; names it and what was expected.
    """
    run_dir = Path(run_dir)
    run = RunRecord.open(run_dir)
    scenario = read_text(run_dir / "scenario.yaml", "the resolved scenario (YAML text)")
    rewrite(run_dir, REPORT, _render(run.metrics, scenario, digest_run(run)).encode())
    return run_dir / REPORT


def save_figures(run_dir: Path) -> list[Path]:
    """Write the figures of the report for papers and slides: ``figures/<name>.svg``, ``.pdf`` and ``.png``.

    Each is written beside and renamed, and the folder's manifest follows it; equal runs give equal files.

    Parameters
    ----------
    run_dir : Path
        Run folder.

    Returns
    -------
    list of Path
        What was written.

    Raises
    ------
    ScenarioError
        As for `write_report`.
    """
    run_dir = Path(run_dir)
    written = []
    for name, figure in run_figures(RunRecord.open(run_dir)).items():
        for kind in FORMATS:
            place = f"{FIGURES}/{name}.{kind}"
            rewrite(run_dir, place, figure_bytes(figure, kind))
            written.append(run_dir / place)
    return written


def run_figures(run: RunRecord) -> dict[str, Figure]:
    """Return the figures of a run by name, as the report shows them.

    Parameters
    ----------
    run : RunRecord
        In memory or on disk.
    """
    return _figures(run.metrics, digest_run(run))


def _render(metrics: RunMetrics, scenario: str, digest: Digest) -> str:
    unit, scale = error_unit(metrics)
    return render(
        "report.html.j2",
        _figures(metrics, digest),
        unit=unit,
        scale=scale,
        ratios=RATIOS,
        over_bound=over_bound,
        honesty=honesty,
        finding_text=finding_text,
        line_error=line_error,
        metrics=metrics,
        names=_shown_metrics(metrics),
        line_sources=_line_sources(metrics),
        further=further(metrics),
        claims=claims(metrics),
        summary=summary(metrics, digest),
        scenario=scenario,
        digest=digest,
        powered=powered(digest.transfers),
        closer=closer_views(digest, _colors(metrics), (unit, scale)),
        closer_bins=N_CLOSE,
        bands=band_rows(metrics.budget, digest) if metrics.budget else [],
        line_optima=line_optima(metrics),
        sight_rows=sight_rows(metrics),
        sight_metrics=[row.metric for row in metrics.expectations if _of_pointing(row.metric)],
        inside_rows=inside_rows,
        metric_text=metric_text,
    )


def _of_pointing(metric: str) -> bool:
    return "_urad" in metric or metric in {"delay_us", "outage", "mean_loss_db"}


def _shown_metrics(metrics: RunMetrics) -> dict[str, str]:
    """Return the columns of the error table: those in which some source has a value, and the error where there may be
    one.
    """
    sources = [*metrics.sensors.values(), *metrics.fusion.values()]
    known = {key for key in METRICS if any(getattr(source, RATIOS.get(key, key)) is not None for source in sources)}
    always = set() if "mean_deg_s" in known else {"rmse_deg_s"}
    return {key: name for key, name in METRICS.items() if key in always | known}


def _line_sources(metrics: RunMetrics) -> dict[str, dict[float, Any]]:
    """Return the lines of each source that has any, by frequency [Hz]."""
    sources = {**metrics.sensors, **metrics.fusion}
    return {
        name: {line.frequency_hz: line for line in source.lines} for name, source in sources.items() if source.lines
    }


def _colors(metrics: RunMetrics) -> dict[str, str]:
    return series_colors(list(metrics.sensors), list(metrics.fusion))


def _figures(metrics: RunMetrics, digest: Digest) -> dict[str, Figure]:
    colors, unit = _colors(metrics), error_unit(metrics)
    drawn = {}
    if metrics.pointing:
        drawn["sight_budget"] = sight_budget_figure(metrics.pointing)
        drawn["sight_curves"] = sight_curves_figure(metrics.pointing, colors)
    drawn["rates"] = rates_figure(digest, colors, unit)
    if digest.filter_errors and digest.has_truth:
        drawn["errors"] = errors_figure(digest, colors, unit)
    if metrics.sources:
        drawn["spectrum"] = spectrum_figure(digest, colors, metrics.floor_density, unit)
    if allan_curves(digest):
        drawn["allan"] = errors_allan_figure(digest, colors, unit)
    if shows(metrics, digest.transfers):
        drawn["bode"] = bode_figure(metrics, digest.transfers, colors)
    if digest.correlations:
        drawn["whiteness"] = whiteness_figure(digest.correlations, colors)
    if digest.adapted:
        drawn["adapted"] = adapted_figure(digest.adapted, colors, digest.duration_s, digest.settle_s, unit)
    if metrics.profiles:
        drawn["profile"] = profile_figure(metrics.profiles, colors, unit)
    if digest.thermal:
        drawn["thermal"] = thermal_figure(digest, colors, unit)
    if metrics.budget is not None:
        drawn["budget"] = budget_figure(metrics.budget, colors, unit)
    return drawn
