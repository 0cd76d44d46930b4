"""Curves over an axis as an ``<svg>`` of the page, without a drawing library: for a page that is written again and
again while its numbers grow.

A pair of axes costs matplotlib 20 to 40 ms, here 1 ms. Text is text, in the colour and the type of the page.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from markupsafe import Markup, escape

from testbed.pages.palette import marked_every
from testbed.pages.scales import Cells, Scale, scale_over
from testbed.pages.shapes import SHAPES, SOLID_RIM, is_open

if TYPE_CHECKING:
    from collections.abc import Iterable, Sequence

    from testbed.pages.palette import Dash, Mark
    from testbed.signals import FloatArray

WIDTH, FONT = 662.0, 9.0
LEFT, RIGHT, BOTTOM = 60.0, 12.0, 36.0
INK = "currentColor"
_ROW, _GAP = 14.4, 26.0
# Of an entry of the legend: its line with the room around it, and a letter of its name.
_ENTRY, _LETTER = 45.0, 5.8


class ChartLine(NamedTuple):
    """A line over the axis of its panel, with the ends of its intervals where it has some, NaN where there is nothing.

    Without `dash` the points stand alone, and so do their intervals.
    """

    name: str
    color: str
    dash: Dash | None
    mark: Mark | None
    width: float
    x: FloatArray
    y: FloatArray
    low: FloatArray | None = None
    high: FloatArray | None = None


class Panel(NamedTuple):
    """Series over one axis, and what stands beside the upright one."""

    upright: str
    series: Sequence[ChartLine]
    log: bool


def chart(panels: Sequence[Panel], across: str, height: float, *, log: bool) -> Markup:
    """Return panels one below the other, over one axis and below one legend: that of the first one.

    Parameters
    ----------
    panels : sequence of Panel
        From the top on.
    across : str
        What stands below the axis.
    height : float
        Of the figure, whose width is 662.
    log : bool
        Whether the axis is logarithmic.
    """
    legend, top = _legend(panels[0].series)
    each = (height - top - BOTTOM - _GAP * (len(panels) - 1)) / len(panels)
    x = scale_over(_all(one.x for panel in panels for one in panel.series), LEFT, WIDTH - RIGHT, log=log)
    parts = [legend]
    for k, panel in enumerate(panels):
        upper = top + k * (each + _GAP)
        y = scale_over(_all(_shown(panel)), upper + each, upper, log=panel.log)
        parts += [
            axes_around(x, y, across if k == len(panels) - 1 else "", panel.upright),
            *(_drawn(x, y, panel.series)),
        ]
    return svg(height, parts)


def svg(height: float, parts: Iterable[str]) -> Markup:
    """Return the ``<svg>`` around what is drawn.

    Parameters
    ----------
    height : float
        Of the figure.
    parts : iterable of str
        Elements, with names escaped.
    """
    head = f'<svg viewBox="0 0 {WIDTH:g} {height:g}" font-size="{FONT:g}" fill="{INK}" stroke-linejoin="round"'
    # Markup: every name in it was escaped where it was put.
    return Markup(f'{head} font-family="system-ui, sans-serif">\n{"".join(parts)}</svg>')


def words(x: float, y: float, text: str, anchor: str = "middle", more: str = "") -> str:
    """Return a text, escaped.

    Parameters
    ----------
    x, y : float
        Where its foot stands.
    text : str
        What.
    anchor : str, optional
        Which end of it: start, middle or end.
    more : str, optional
        Further attributes.
    """
    return f'<text x="{x:.1f}" y="{y:.1f}" text-anchor="{anchor}"{more}>{escape(text)}</text>\n'


def axes_around(x: Scale | Cells, y: Scale | Cells, across: str, upright: str | None) -> str:
    """Return both axes with marks, texts and, but for cells, a grid.

    Parameters
    ----------
    x, y : Scale or Cells
        The axes; the upright one begins below.
    across : str
        What stands below.
    upright : str or None
        What stands beside; None where the axis has been labelled to the left.
    """
    left, right, foot, top = x.begin, x.end, y.begin, y.end
    marks = [(at, text) for at, text in _placed(x) if left - 0.5 <= at <= right + 0.5]
    rungs = [(at, text) for at, text in _placed(y) if top - 0.5 <= at <= foot + 0.5]
    grid = "".join(f"M{at:.1f} {foot:.1f}V{top:.1f}" for at, _ in marks)
    grid += "".join(f"M{left:.1f} {at:.1f}H{right:.1f}" for at, _ in rungs)
    edge = f"M{left:.1f} {top:.1f}V{foot:.1f}H{right:.1f}"
    edge += "".join(f"M{at:.1f} {foot:.1f}v3.5" for at, _ in marks)
    edge += "".join(f"M{left:.1f} {at:.1f}h-3.5" for at, _ in rungs)
    edge += "".join(f"M{at:.1f} {foot:.1f}v2" for at in x.place(np.array(x.between())))
    edge += "".join(f"M{left:.1f} {at:.1f}h-2" for at in y.place(np.array(y.between())))
    texts = [words(at, foot + 13.0, text) for at, text in marks]
    texts += [words((left + right) / 2.0, foot + 28.0, across)] if across else []
    if upright is not None:
        at, middle = left - 46.0, (foot + top) / 2.0
        texts += [words(left - 6.0, rung + 3.2, text, "end") for rung, text in rungs]
        texts += [words(at, middle, upright, more=f' transform="rotate(-90 {at:.1f} {middle:.1f})"')]
    lines = (
        ""
        if isinstance(x, Cells)
        else f'<path d="{grid}" stroke="{INK}" stroke-opacity=".13" stroke-width=".6" fill="none"/>\n'
    )
    return f'{lines}<path d="{edge}" stroke="{INK}" stroke-width=".7" fill="none"/>\n{"".join(texts)}'


def _placed(scale: Scale | Cells) -> list[tuple[float, str]]:
    marks = scale.marks()
    places = scale.place(np.array([value for value, _ in marks]))
    return [(float(at), text) for at, (_, text) in zip(places, marks, strict=True)]


def _all(columns: Iterable[FloatArray]) -> FloatArray:
    return np.concatenate([np.asarray(column, dtype=float) for column in columns] or [np.empty(0)])


def _shown(panel: Panel) -> list[FloatArray]:
    return [ends for one in panel.series for ends in (one.y, one.low, one.high) if ends is not None]


def _drawn(x: Scale, y: Scale, series: Sequence[ChartLine]) -> list[str]:
    """Return areas, then lines, then marks, so that no line is hidden by an area."""
    placed = [(one, x.place(one.x), y.place(one.y)) for one in series]
    areas = [_interval(one, at, y) for one, at, _ in placed if one.low is not None and one.high is not None]
    lines = [_line(one, _path(at, up)) for one, at, up in placed if one.dash is not None]
    return [*areas, *lines, *(_points(one, at, up) for one, at, up in placed)]


def _path(at: FloatArray, up: FloatArray) -> str:
    """Return a line through points, broken where there is none."""
    path, pen = [], "M"
    for x, y in zip(at.tolist(), up.tolist(), strict=True):
        whole = x == x and y == y  # noqa: PLR0124 - a number
        path.append(f"{pen}{x:.1f} {y:.1f}" if whole else "")
        pen = "L" if whole else "M"
    return "".join(path)


def _line(one: ChartLine, path: str) -> str:
    assert one.dash is not None
    dash = one.dash[1]
    dashes = f' stroke-dasharray="{" ".join(f"{part * one.width:.2g}" for part in dash)}"' if dash else ""
    return f'<path d="{path}" fill="none" stroke="{one.color}" stroke-width="{one.width:g}"{dashes}/>\n'


def _interval(one: ChartLine, at: FloatArray, y: Scale) -> str:
    """Return the area between the ends where the points are joined, else a bar at each."""
    assert one.low is not None
    assert one.high is not None
    low, high = y.place(one.low), y.place(one.high)
    known = np.isfinite(low) & np.isfinite(high)
    if one.dash is None:
        bars = zip(at[known].tolist(), low[known].tolist(), high[known].tolist(), strict=True)
        path = "".join(f"M{x:.1f} {a:.1f}V{b:.1f}" for x, a, b in bars)
        return f'<path d="{path}" stroke="{one.color}" stroke-opacity=".5"/>\n' if path else ""
    if known.sum() < 2:
        return ""
    there, back = _path(at[known], low[known]), _path(at[known][::-1], high[known][::-1])
    return f'<path d="{there}L{back[1:]}z" fill="{one.color}" fill-opacity=".18"/>\n'


def _points(one: ChartLine, at: FloatArray, up: FloatArray) -> str:
    """Return the marks of a series: of many points that are joined a few, each series elsewhere."""
    if one.mark is None:
        return ""
    first, step = (0, 1) if one.dash is None else marked_every(one.mark, at.size)
    chosen = [(x, y) for x, y in zip(at[first::step].tolist(), up[first::step].tolist(), strict=True) if y == y]  # noqa: PLR0124
    return _marks(one, chosen)


def _marks(one: ChartLine, places: Iterable[tuple[float, float]]) -> str:
    if one.mark is None:
        return ""
    shape = SHAPES[one.mark.marker]
    path = "".join(f"M{x:.1f} {y:.1f}{shape}" for x, y in places)
    ink = f'fill="none" stroke="{one.color}" stroke-width="1.3"'
    if not is_open(one.mark.marker):
        ink = f'fill="{one.color}" stroke="{INK}" stroke-width="{SOLID_RIM:g}"'
    return f'<path d="{path}" {ink}/>\n'


def _legend(series: Sequence[ChartLine]) -> tuple[str, float]:
    """Return the legend, row by row in columns as wide as the longest name, and where the panels below it begin."""
    entry = _ENTRY + _LETTER * max(len(one.name) for one in series)
    n_rows = -(-len(series) // max(1, int(WIDTH / entry)))
    n_columns = -(-len(series) // n_rows)
    parts = []
    for k, one in enumerate(series):
        x, y = (k % n_columns) * WIDTH / max(n_columns, int(WIDTH / entry)), 8.0 + _ROW * (k // n_columns)
        parts += [] if one.dash is None else [_line(one, f"M{x + 2.0:.1f} {y:.1f}h24")]
        parts += [_marks(one, [(x + 14.0, y)]), words(x + 33.0, y + 3.2, one.name, "start")]
    return "".join(parts), 8.0 + _ROW * n_rows + 6.0
