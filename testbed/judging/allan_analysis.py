"""What an Allan deviation says: coefficients in data-sheet units or why there are none, and the log-log plot."""

from __future__ import annotations

import io
import warnings
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import matplotlib as mpl
import numpy as np
from matplotlib.figure import Figure

from testbed import units
from testbed.allan import AllanCurve, AllanFit, allan_deviation, fit_allan
from testbed.allan.fit import judge_fit, term_variance
from testbed.errors import Problem, ScenarioError
from testbed.judging.allan_words import data_sheet, remarks_on
from testbed.judging.faulty_readings import without_faults
from testbed.judging.rounding import is_rounding, rounding_text, without_rounding
from testbed.pages.axes import marked
from testbed.pages.numbers import significant
from testbed.pages.palette import FILTERS, SENSORS, SOLID, Mark
from testbed.pages.svg import INK, STYLE

if TYPE_CHECKING:
    from collections.abc import Sequence
    from pathlib import Path

    from matplotlib.axes import Axes

    from testbed.allan import Coefficient
    from testbed.judging.allan_records import RateRecord

FORMATS = ("svg", "png", "pdf")
_PANEL_IN = (5.0, 4.2)
_LEAST_POINTS = 8
# A narrower range is proposed only where the model holds comfortably, and shorter by a factor of two: where the
# departure begins to drown in the spread of the estimates, it still bends them.
_COMFORT = 0.05
_MARGIN = 3


@dataclass(frozen=True)
class Term:
    """A term of the model: its name in `AllanFit`, its letter, its data-sheet unit and the SI unit, its color."""

    name: str
    letter: str
    unit: str
    si: str
    color: str

    def in_unit(self, value: float) -> float:
        """Return an SI value in the data-sheet unit."""
        return value / units.parse(f"1 {self.unit}", self.si)

    def text(self, value: float) -> str:
        """Return an SI value as a number in the data-sheet unit."""
        return significant(self.in_unit(value), 4)

    def summary(self, fit: AllanFit) -> dict[str, Any]:
        """Return the coefficient of a fit in the data-sheet unit; a term that is not identified has no value."""
        found: Coefficient = getattr(fit, self.name)
        return {
            "value": self.in_unit(found.value) if found.identified else None,
            "lower": self.in_unit(found.lower),
            "upper": self.in_unit(found.upper),
            "unit": self.unit,
        }


TERMS = (
    Term("quantization", "Q", "urad", "rad", FILTERS[1]),
    Term("angle_random_walk", "N", "deg/sqrt(h)", "rad*s^-0.5", FILTERS[0]),
    Term("bias_instability", "B", "deg/h", "rad/s", FILTERS[2]),
    Term("rate_random_walk", "K", "deg/h/sqrt(h)", "rad*s^-1.5", FILTERS[3]),
    Term("rate_ramp", "R", "deg/h/h", "rad/s^2", FILTERS[4]),
)


@dataclass(frozen=True)
class Analysis:
    """A record, its curve, the part of it that was fitted, and the fit."""

    record: RateRecord
    curve: AllanCurve
    fitted: AllanCurve
    fit: AllanFit

    def coefficient(self, term: Term) -> Coefficient:
        """Return the fitted coefficient of a term, in SI."""
        coefficient: Coefficient = getattr(self.fit, term.name)
        return coefficient

    @property
    def given(self) -> bool:
        """Whether the coefficients mean something."""
        return self.fit.goodness.accepted and not is_rounding(self.record)

    def verdict(self) -> str:
        """Return what the goodness of fit says, in a sentence."""
        if is_rounding(self.record):
            return rounding_text(self.record)
        worth = self.fit.goodness
        low, high = self.fitted.tau[[0, -1]]
        numbers = (
            f"reduced chi-square {worth.reduced_chi_square:.2f} with {worth.freedom:.1f} degrees of freedom, "
            f"p = {worth.p_value:.2g}"
        )
        if worth.accepted:
            return f"The five terms describe the curve from {low:g} s to {high:g} s: {numbers}."
        return (
            f"The five terms do NOT describe the curve from {low:g} s to {high:g} s ({numbers}; "
            f"worst at {worth.worst_tau:g} s), so no coefficient is given. {self._advice()}"
        )

    def summary(self) -> dict[str, Any]:
        """Return curve and coefficients with units in their names, coefficients None where the terms fail."""
        curve, worth = self.curve, self.fit.goodness
        columns = {name: (getattr(curve, name) / units.DEG_H).tolist() for name in ("deviation", "lower", "upper")}
        return {
            "name": self.record.name,
            "content": self.record.content,
            "n_time": curve.n_time,
            "sample_rate_hz": curve.sample_rate_hz,
            "fitted_from_s": float(self.fitted.tau[0]),
            "fitted_to_s": float(self.fitted.tau[-1]),
            "reduced_chi_square": worth.reduced_chi_square,
            "freedom": worth.freedom,
            "p_value": worth.p_value,
            "worst_tau_s": worth.worst_tau,
            "coefficients": self._coefficients() if self.given else None,
            "verdict": self.verdict(),
            "remarks": remarks_on(self),
            "n_missing": int(np.count_nonzero(np.isnan(self.record.rate))),
            "curve": {"tau_s": curve.tau.tolist(), **{f"{name}_deg_h": values for name, values in columns.items()}},
        }

    def _coefficients(self) -> dict[str, dict[str, Any]]:
        sheet = data_sheet(self)
        return {term.letter: {**term.summary(self.fit), **sheet.get(term.letter, {})} for term in TERMS}

    def _advice(self) -> str:
        """Propose the widest range, cut at one end, over which the model holds, with a margin."""
        tau = self.fitted.tau
        for n_cut in range(1, tau.size - _LEAST_POINTS - _MARGIN + 1):
            if _holds(self.fitted, float(tau[n_cut]), float(tau[-1])):
                low = tau[n_cut + _MARGIN]
                return f"They may from {low:.3g} s on: --min-tau {low:.3g}."
            if _holds(self.fitted, float(tau[0]), float(tau[-1 - n_cut])):
                high = tau[-1 - n_cut - _MARGIN]
                return f"They may up to {high:.3g} s: --max-tau {high:.3g}."
        return "Nor over a shorter range cut at one end: there is something else in the record."


def _holds(curve: AllanCurve, low: float, high: float) -> bool:
    return judge_fit(curve.between(low * 0.999, high * 1.001)).p_value >= _COMFORT


def analyse(record: RateRecord, min_tau: float | None = None, max_tau: float | None = None) -> Analysis:
    """Return curve and fit of a record.

    Parameters
    ----------
    record : RateRecord
        From `allan_records`, or made of an array.
    min_tau, max_tau : float, optional
        Averaging times between which to fit [s].

    Returns
    -------
    Analysis
        Curve over all averaging times, fit over the range; of the record without readings that stand still or far off
        their neighbours, as its notes tell.

    Raises
    ------
    ScenarioError
        If the record is too short or constant, or the range too narrow.
    """
    said, record = len(record.notes), without_faults(record)
    try:
        curve = without_rounding(allan_deviation(record.rate, record.sample_rate_hz), record)
    except ValueError as error:
        why = "; ".join([str(error), *record.notes[said:]])
        raise ScenarioError([Problem(why, file=record.content)]) from error
    if not np.all(curve.deviation > 0.0) and is_rounding(record):
        raise ScenarioError([Problem(rounding_text(record), file=record.content)])
    if np.nanmin(record.rate) == np.nanmax(record.rate):
        what = f"all readings are {np.degrees(np.nanmin(record.rate)):g} deg/s"
        msg = (
            f"expected noise, {what}: rounded to words above the noise, or not moving at all; record with a finer range"
        )
        raise ScenarioError([Problem(msg, file=record.content)])
    if not np.all(curve.deviation > 0.0):
        silent = curve.tau[np.argmin(curve.deviation)]
        raise ScenarioError([Problem(f"expected noise, got no deviation at all at {silent:g} s", file=record.content)])
    fitted = curve.between(min_tau or 0.0, np.inf if max_tau is None else max_tau)
    if fitted.tau.size < len(TERMS):
        msg = (
            f"expected at least {len(TERMS)} averaging times, got {fitted.tau.size} of those "
            f"from {curve.tau[0]:g} s to {curve.tau[-1]:g} s"
        )
        raise ScenarioError([Problem(msg, key="--min-tau, --max-tau", file=record.content)])
    try:
        return Analysis(record, curve, fitted, fit_allan(fitted))
    except ValueError as error:
        raise ScenarioError([Problem(str(error), file=record.content)]) from error


def allan_figure(analyses: Sequence[Analysis]) -> Figure:
    """Draw each curve with its 95 % band, the fitted sum and its terms.

    Parameters
    ----------
    analyses : sequence of Analysis
        One panel each.

    Returns
    -------
    Figure
        Allan deviation [deg/h] against averaging time [s], both logarithmic.
    """
    with mpl.rc_context(STYLE):
        figure = Figure(figsize=(_PANEL_IN[0] * len(analyses), _PANEL_IN[1]), layout="constrained")
        panels = figure.subplots(1, len(analyses), squeeze=False)[0]
        for axes, analysis in zip(panels, analyses, strict=True):
            _draw(axes, analysis)
    return figure


def _draw(axes: Axes, analysis: Analysis) -> None:
    hour = units.parse("1 deg/h", "rad/s")
    curve, accepted = analysis.curve, analysis.given
    axes.fill_between(
        curve.tau, curve.lower / hour, curve.upper / hour, color=SENSORS[0], alpha=0.25, linewidth=0, label="95 % band"
    )
    axes.plot(curve.tau, curve.deviation / hour, ".", color=SENSORS[0], markersize=4, label="measured")
    squares = {term: analysis.fit.squares[i] for i, term in enumerate(TERMS)}
    parts = {term: np.sqrt(term_variance(analysis.fitted, term.name, square)) for term, square in squares.items()}
    total = np.sqrt(sum(part**2 for part in parts.values()))
    label = "fitted sum" if accepted else "best sum of five terms: refused"
    axes.plot(
        analysis.fitted.tau, total / hour, color=INK, linewidth=1.2, linestyle="-" if accepted else ":", label=label
    )
    axes.set(xscale="log", yscale="log", xlabel="averaging time τ [s]", ylabel="Allan deviation [deg/h]")
    axes.set_title(analysis.record.name.replace("$", r"\$"), loc="left")
    axes.set_ylim(*_decades(np.concatenate([curve.lower, curve.upper]) / hour))
    if accepted:
        for term, part in parts.items():
            _draw_term(axes, analysis, term, part / hour)
    axes.grid(visible=True, which="major")
    axes.legend(loc="best", fontsize=7.5)


def _draw_term(axes: Axes, analysis: Analysis, term: Term, deviation: np.ndarray) -> None:
    coefficient, tau = analysis.coefficient(term), analysis.fitted.tau
    if coefficient.identified:
        label = f"{term.letter} = {term.text(coefficient.value)} {term.unit}"
        axes.plot(tau, deviation, linewidth=1.0, label=label, **_style(term, (5, 2), tau.size))
    elif deviation.any():
        # In the sum, though too small to be told from nothing.
        label = f"{term.letter} < {term.text(coefficient.upper)} {term.unit}"
        axes.plot(tau, deviation, linewidth=0.8, label=label, **_style(term, (1.2, 1.6), tau.size))


def _style(term: Term, dashes: tuple[float, ...], n_points: int) -> dict[str, Any]:
    turn = TERMS.index(term)
    return {"color": term.color} | marked(Mark((0, dashes), SOLID[turn], turn), term.color, n_points)


def _decades(deviation: np.ndarray) -> tuple[float, float]:
    """Return limits that leave the curve a fifth of its height above and below."""
    low, high = np.log10(deviation.min()), np.log10(deviation.max())
    margin = max(0.2 * (high - low), 0.1)
    return float(10.0 ** (low - margin)), float(10.0 ** (high + margin))


def write_figure(figure: Figure, path: Path) -> Path:
    """Write a figure whole or not at all; the suffix says which format.

    Parameters
    ----------
    figure : Figure
        From `allan_figure`.
    path : Path
        With the suffix svg, png or pdf.

    Returns
    -------
    Path
        `path`.

    Raises
    ------
    ScenarioError
        If the suffix is none of them.
    RunError
        If it cannot be written.
    """
    from testbed.runs.atomic import write_bytes
    from testbed.runs.folder import failing_as_run_error

    kind = figure_format(path)
    buffer = io.BytesIO()
    # Without dates and random ids, so that the same record gives the same file.
    undated = {"svg": {"Date": None}, "pdf": {"CreationDate": None}, "png": {}}[kind]
    with mpl.rc_context({**STYLE, "svg.hashsalt": "allan"}), warnings.catch_warnings():
        # A name may be in any script: what the font lacks is a box in the figure, and whole in the tables.
        warnings.filterwarnings("ignore", message="Glyph .* missing from font")
        figure.savefig(buffer, format=kind, dpi=300, metadata=undated)
    with failing_as_run_error(str(path)):
        path.parent.mkdir(parents=True, exist_ok=True)
        write_bytes(path, buffer.getvalue())
    return path


def figure_format(path: Path, option: str = "--out") -> str:
    """Return the format that the suffix of a path names; ScenarioError, at the option, if it is none of `FORMATS`."""
    kind = path.suffix.lower().removeprefix(".")
    if kind not in FORMATS:
        msg = f"expected a file that ends in {', '.join('.' + name for name in FORMATS)}, got {str(path)!r}"
        raise ScenarioError([Problem(msg, key=option)])
    return kind
