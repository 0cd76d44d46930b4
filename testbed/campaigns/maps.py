"""The error over two axes: cells where every value meets every other, else a point for each pair that was drawn."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from testbed.pages.chart import INK, LEFT, WIDTH, axes_around, svg, words
from testbed.pages.palette import mix
from testbed.pages.scales import Cells, Scale, scale_over

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from markupsafe import Markup

    from testbed.campaigns.curves import Point, Summary
    from testbed.signals import FloatArray

    Errors = Mapping[tuple[float, float], float]

_COLUMNS, _HEIGHT, _GAP, _TITLE, _FOOT = 3, 150.0, 14.0, 16.0, 38.0
# Of the bar of colours: its distance from the panels, its width, and the room for its texts.
_APART, _BAR, _TEXT = 14.0, 12.0, 50.0
_SHADES = 48
# The colour map cividis at equal steps: its lightness rises evenly, for every eye and in grey.
_COLORS = ("#00224e", "#1a386f", "#434e6c", "#61656f", "#7d7c78", "#9b9476", "#bcae6c", "#dec958", "#fee838")


def map_of(
    found: Summary, values: Mapping[str, FloatArray], named: Mapping[str, str], log: Mapping[str, bool]
) -> Markup:
    """Return the RMSE of every filter over the first two axes, all in one scale.

    Parameters
    ----------
    found : Summary
        What the rows say.
    values : mapping of str to ndarray, shape (n_value,)
        What each axis takes, by its key.
    named, log : mapping of str to str, to bool
        What stands beside an axis, and whether it is logarithmic where points are drawn.
    """
    first, second = list(values)[:2]
    panels = {
        name: errors_over(found.points["filter", name], first, second)
        for kind, name in found.points
        if kind == "filter"
    }
    shades = scale_over(np.array([one for errors in panels.values() for one in errors.values()]), 0.0, 1.0, log=True)
    columns = min(_COLUMNS, len(panels))
    width = (WIDTH - LEFT - _APART - _BAR - _TEXT - (columns - 1) * _GAP) / columns
    each = _TITLE + _HEIGHT + _FOOT
    parts = []
    for k, (name, errors) in enumerate(panels.items()):
        column, row = k % columns, k // columns
        left, top = LEFT + column * (width + _GAP), row * each + _TITLE
        box = (left, left + width, top + _HEIGHT, top)
        parts.append(words(left, top - 5.0, name, "start", ' font-weight="600"'))
        beside = named[second] if column == 0 else None
        if crossed(errors):
            parts.append(_cells(errors, (values[first], values[second]), box, shades, (named[first], beside)))
        else:
            logs = (log[first], log[second])
            parts.append(_points(errors, (values[first], values[second]), logs, box, shades, (named[first], beside)))
    rows = -(-len(panels) // columns)
    return svg(rows * each, [*parts, _bar(shades, _TITLE, _TITLE + _HEIGHT)])


def errors_over(points: Sequence[Point], first: str, second: str) -> dict[tuple[float, float], float]:
    """Return the RMSE by the values at two axes, over all that has both [deg/s].

    Parameters
    ----------
    points : sequence of Point
        Of a filter.
    first, second : str
        Keys of the axes.
    """
    groups: dict[tuple[float, float], list[float]] = {}
    for point in points:
        if np.isfinite(point.rmse):
            groups.setdefault((point.axes[first], point.axes[second]), []).append(point.rmse)
    return {pair: float(np.sqrt(np.mean(np.square(errors)))) for pair, errors in groups.items()}


def crossed(errors: Errors) -> bool:
    """Return whether values meet each other, so that cells are filled; not where pairs were drawn.

    Parameters
    ----------
    errors : mapping
        As `errors_over` returns them.
    """
    cells = len({a for a, _ in errors}) * len({b for _, b in errors})
    return 2 * len(errors) >= cells


def _cells(
    errors: Errors,
    values: tuple[FloatArray, FloatArray],
    box: tuple[float, float, float, float],
    shades: Scale,
    named: tuple[str, str | None],
) -> str:
    x, y = Cells(values[0], *box[:2]), Cells(values[1], *box[2:])
    column, row = ({value: k for k, value in enumerate(one)} for one in values)
    parts = []
    for (a, b), error in errors.items():
        left, top = x.begin + column[a] * x.width, y.begin + (row[b] + 1) * y.width
        size = f'width="{x.width:.1f}" height="{-y.width:.1f}"'
        parts.append(f'<rect x="{left:.1f}" y="{top:.1f}" {size} fill="{color_at(shades, error)}"/>')
    return f'<g shape-rendering="crispEdges">{"".join(parts)}</g>\n{axes_around(x, y, *named)}'


def _points(
    errors: Errors,
    values: tuple[FloatArray, FloatArray],
    log: tuple[bool, bool],
    box: tuple[float, float, float, float],
    shades: Scale,
    named: tuple[str, str | None],
) -> str:
    x, y = scale_over(values[0], *box[:2], log=log[0]), scale_over(values[1], *box[2:], log=log[1])
    across, up = x.place(np.array([a for a, _ in errors])), y.place(np.array([b for _, b in errors]))
    dots = [
        f'<circle cx="{a:.1f}" cy="{b:.1f}" r="4" fill="{color_at(shades, error)}" stroke="{INK}" stroke-width=".5"/>'
        for a, b, error in zip(across, up, errors.values(), strict=True)
    ]
    return f"{axes_around(x, y, *named)}{''.join(dots)}\n"


def color_at(shades: Scale, error: float) -> str:
    """Return the colour of an error.

    Parameters
    ----------
    shades : Scale
        From 0 to 1 over all errors.
    error : float
        In its units.
    """
    place = min(max(float(shades.place(np.array([error]))[0]), 0.0), 1.0) * (len(_COLORS) - 1)
    k = min(int(place), len(_COLORS) - 2)
    return mix(_COLORS[k], _COLORS[k + 1], place - k)


def _bar(shades: Scale, top: float, foot: float) -> str:
    """Return the colours with their errors, to the right of the panels."""
    left, upright = WIDTH - _TEXT - _BAR, Scale(shades.low, shades.high, foot, top, log=True)
    step, parts = (foot - top) / _SHADES, []
    for k in range(_SHADES):
        share = (k + 0.5) / _SHADES
        color = color_at(shades, shades.low * (shades.high / shades.low) ** share)
        parts.append(
            f'<rect x="{left:.1f}" y="{foot - (k + 1) * step:.2f}" width="{_BAR:g}"'
            f' height="{step + 0.3:.2f}" fill="{color}"/>'
        )
    marks = upright.marks()
    places = upright.place(np.array([value for value, _ in marks]))
    parts += [words(left + _BAR + 4.0, at + 3.2, text, "start") for at, (_, text) in zip(places, marks, strict=True)]
    title = words(WIDTH, top - 5.0, "RMSE [deg/s]", "end")
    return f"{''.join(parts)}\n{title}"
