"""What is left of a figure that is printed in grey: which of its series can no longer be told apart."""

from __future__ import annotations

import itertools

from matplotlib.collections import PolyCollection
from matplotlib.colors import to_hex
from PIL import ImageColor

# Greys of 256 that are told apart on paper without one beside the other.
APART = 40
_STROKES = "x+1234|_"


def grey(color):
    """Return the grey of a colour, 0 to 255, as an image library prints it."""
    red, green, blue = ImageColor.getrgb(to_hex(color))
    return (299 * red + 587 * green + 114 * blue) / 1000


def style(line):
    """Return dashes, marker, whether it is filled, and whether the line is thick."""
    marker = line.get_marker() if line.get_marker() not in {"None", None, ""} else ""
    filled = bool(marker) and marker not in _STROKES and line.get_fillstyle() != "none"
    dash = "none" if line.get_linestyle() in {"None", "none"} else line._dash_pattern
    # Dashes are stored in units of the width.
    if isinstance(dash, tuple) and dash[1] is not None:
        dash = tuple(round(part / line.get_linewidth(), 3) for part in dash[1])
    elif dash != "none":
        dash = "full"
    return dash, marker, filled, line.get_linewidth() > 4.0


def confused(figure):
    """Return what cannot be told apart: entries of the legend, and series of a panel."""
    found = []
    for legend in [*figure.legends, *(axes.get_legend() for axes in figure.axes if axes.get_legend())]:
        entries = [(text.get_text(), handle) for text, handle in zip(legend.get_texts(), _handles(legend), strict=True)]
        for (one, a), (other, b) in itertools.combinations(entries, 2):
            if _look(a) == _look(b) and abs(grey(_color(a)) - grey(_color(b))) < APART:
                found.append((one, other))
    for axes in figure.axes:
        series = {}
        for line in axes.lines:
            series.setdefault(to_hex(line.get_color()), set()).add(style(line))
        for area in axes.collections:
            if isinstance(area, PolyCollection):
                series.setdefault(to_hex(area.get_facecolor()[0]), set())
        for (one, a), (other, b) in itertools.combinations(series.items(), 2):
            # One area without marks is told from those with some.
            alike = a & b or not (a or b)
            if alike and abs(grey(one) - grey(other)) < APART:
                found.append((axes.get_title(loc="left") or axes.get_ylabel(), one, other))
    return found


def confused_series(series):
    """Return what cannot be told apart of the series of a panel that is drawn without a library."""
    return [
        (one.name, other.name)
        for one, other in itertools.combinations(series, 2)
        if (one.dash, one.mark and one.mark.marker) == (other.dash, other.mark and other.mark.marker)
        and abs(grey(_ink(one)) - grey(_ink(other))) < APART
    ]


def _ink(one):
    return "#000000" if one.color == "currentColor" else one.color


def _handles(legend):
    return legend.legend_handles


def _color(handle):
    return handle.get_color() if hasattr(handle, "get_color") else handle.get_facecolor()[:3]


def _look(handle):
    if hasattr(handle, "get_linestyle") and hasattr(handle, "get_marker"):
        return style(handle)
    return ("area", handle.get_alpha(), handle.get_hatch())
