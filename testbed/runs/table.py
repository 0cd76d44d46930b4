"""The error table of a run in text cells, for the terminal and the notebook alike."""

from __future__ import annotations

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from testbed.runs.metrics import RunMetrics, SourceMetrics
    from testbed.units import RateUnit

HEADINGS = ("RMSE", "aligned", "claimed std", "x floor", "x optimum", "mean", "spread")
NOTHING = "-"
# What the arithmetic of a run leaves of a rate is below this [deg/s].
_RESOLUTION = 1e-12


def error_title(metrics: RunMetrics) -> str:
    """Return what the table shows: scenario, unit, span and seed."""
    unit, _ = error_unit(metrics)
    span = f"{metrics.settle_s:.6g} s to {metrics.duration_s:.6g} s"
    if metrics.replay is None:
        return f"{metrics.scenario}: error against the truth in {unit}, {span}, seed {metrics.seed}"
    shown = "error against the reference" if metrics.replay.reference else "mean and spread (there is no reference)"
    return f"{metrics.scenario}, replayed: {shown} in {unit}, {span}"


def error_unit(metrics: RunMetrics) -> tuple[str, float]:
    """Return the unit of every rate that is shown of a run and what deg/s is multiplied by for it."""
    return shown_in(metrics.rate_unit)


def shown_in(unit: RateUnit) -> tuple[str, float]:
    """Return a unit of `testbed.units.rate_unit` and what deg/s is multiplied by for it."""
    return unit, 3600.0 if unit == "deg/h" else 1.0


def error_cells(source: SourceMetrics, scale: float) -> list[str]:
    """Return the cells of one sensor or filter below `HEADINGS`.

    Parameters
    ----------
    source : SourceMetrics
        Its errors.
    scale : float
        What deg/s is multiplied by.
    """
    errors = (source.rmse_deg_s, source.rmse_aligned_deg_s, source.mean_std_deg_s)
    ratios = (source.over(source.floor_rmse_deg_s), source.over(source.optimum_rmse_deg_s))

    def shown(rates: tuple[float | None, ...]) -> list[str]:
        return [number(None if rate is None else scale * rate) for rate in rates]

    return [*shown(errors), *map(ratio_text, ratios), *shown((source.mean_deg_s, source.spread_deg_s))]


def ratio_text(value: float | None) -> str:
    """Return a ratio of two errors in three digits, as the report has it; a dash for None."""
    return NOTHING if value is None else f"{value:.3g}"


def number(value: float | None) -> str:
    """Return a number in four digits, a dash for None."""
    return NOTHING if value is None else f"{value:.4g}"


def window_text(key: str) -> str:
    """Return a window's length [s], as metrics.json names it, in the unit that fits.

    Parameters
    ----------
    key : str
        Such as ``0.001``.
    """
    length = float(key)
    if length >= 1.0:
        return f"{length:g} s"
    return f"{1e3 * length:g} ms" if length >= 1e-3 else f"{1e6 * length:g} us"


def metric_text(metric: str) -> str:
    """Return the name of a metric of pointing in words, such as `RPE over 100 ms`.

    Parameters
    ----------
    metric : str
        Such as ``rpe_urad.0.1`` or ``residual_rms_urad``.
    """
    name, _, window = metric.partition(".")
    words = name.removesuffix("_urad").removesuffix("_us").replace("_", " ")
    return f"{words.upper()} over {window_text(window)}" if window else words


def rate_text(value: float | None, unit: tuple[str, float]) -> str:
    """Return a rate with its unit, or that it is below what the arithmetic resolves.

    Parameters
    ----------
    value : float or None
        Rate [deg/s].
    unit : tuple of str and float
        As `error_unit` returns it.
    """
    name, scale = unit
    if value is not None and abs(value) < _RESOLUTION:
        return f"below {number(scale * _RESOLUTION)} {name}"
    return f"{number(None if value is None else scale * value)} {name}"
