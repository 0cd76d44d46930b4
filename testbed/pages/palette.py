"""One colour per signal, the same in the recording and in the report, legible on a dark and on a light background; and
beside the colour dashes and a mark, for who prints in grey.
"""

from __future__ import annotations

import colorsys
import hashlib
import re
from typing import TYPE_CHECKING, NamedTuple

if TYPE_CHECKING:
    from collections.abc import Iterable, Sequence

Dash = tuple[float, tuple[float, ...] | None]

COMMANDED = "#7d8894"
TRUTH = "#b07d12"
# Sensors are cool, filters warm or green: the two groups stay apart where many lines cross.
SENSORS = ("#2f86d6", "#1593a5", "#7377e8", "#5b8aa6")
FILTERS = ("#2f9e58", "#b565d8", "#e2553d", "#c2652a", "#d6588f")


# What ships keeps its colour wherever it is shown; any other name has one of its own.
NAMED = {
    "commanded": COMMANDED,
    "truth": TRUTH,
    "sensors/mhd_ars": SENSORS[0],
    "sensors/mems_gyro": SENSORS[1],
    "sensors/fog": SENSORS[2],
    "fusion/kalman": FILTERS[0],
    "fusion/shakf": FILTERS[1],
    "fusion/arw_shakf": FILTERS[2],
    "fusion/arw_shakf_literal": FILTERS[3],
    "fusion/wideband": FILTERS[4],
    "fusion/steady_state": "#8f8420",
    "fusion/complementary": "#a8705a",
    "fusion/blending": "#6b8f2a",
    "fusion/allan_srkf": "#9a7398",
    "fusion/vb_akf": "#c85a70",
    "fusion/imm": "#4f934d",
    "fusion/self_calibrating": "#7d7fb5",
}
# Hues of names that do not ship, in turns from red on.
_HUES = {"sensors": (0.47, 0.73), "fusion": (0.77, 1.42), "columns": (0.0, 1.0)}
# Axes of a recording: red, green and blue everywhere.
_AXES = {"x": FILTERS[2], "y": FILTERS[0], "z": SENSORS[0]}
# Colours are equally light, so in grey they are one: dashes and marks tell the names apart. The numbers of both have no
# common factor, so that all their pairs differ.
DASHES: tuple[Dash, ...] = (
    (0, None),
    (0, (7, 1.5)),
    (0, (3, 1.2)),
    (0, (7, 1.2, 1.5, 1.2)),
    (0, (10, 1.2, 1.5, 1.2, 1.5, 1.2)),
)
_OPEN, SOLID = ("x", "+", "1", "2"), ("o", "s", "^", "D", "v", "P", "*", "<", "X", ">", "p", "h")
_MARKERS = {"sensors": _OPEN, "fusion": SOLID, "columns": SOLID}
# Marks on a line.
_N_MARKS = 7
# Relative luminance that stands out 3:1 on white and on the viewer's dark background.
_LUMINANCE = 0.2


def color_of(key: str) -> str:
    """Return the colour of a signal: it belongs to the name, whatever else is shown beside it.

    Parameters
    ----------
    key : str
        ``sensors/<name>``, ``fusion/<name>``, ``truth``, ``commanded``, or ``columns/<name>`` of a recording.
    """
    if key in NAMED:
        return NAMED[key]
    group, name = key.split("/", maxsplit=1)
    axis = re.search(r"(?:^|[^a-z]|[gwr])([xyz])(?:$|[^a-z])", name.lower())
    if group == "columns" and axis:
        return _AXES[axis[1]]
    low, high = _HUES[group]
    digest = hashlib.sha256(key.encode()).digest()
    return _with_luminance((low + digest[0] / 256 * (high - low)) % 1.0, 0.35 + digest[1] / 256 * 0.45)


def _with_luminance(hue: float, saturation: float) -> str:
    """Return the colour of a hue that is as light as the others, by bisection."""
    low, high = 0.0, 1.0
    for _ in range(20):
        middle = (low + high) / 2
        color = "#" + "".join(f"{round(255 * part):02x}" for part in colorsys.hls_to_rgb(hue, middle, saturation))
        low, high = (middle, high) if luminance(color) < _LUMINANCE else (low, middle)
    return color


def luminance(color: str) -> float:
    """Return the relative luminance of "#rrggbb" [-], as WCAG 2.2 defines it."""
    linear = [c / 12.92 if c <= 0.04045 else ((c + 0.055) / 1.055) ** 2.4 for c in (b / 255 for b in rgb(color))]
    return 0.2126 * linear[0] + 0.7152 * linear[1] + 0.0722 * linear[2]


def series_colors(sensor_names: Sequence[str], fusion_names: Sequence[str]) -> dict[str, str]:
    """Return the colour of every rate signal.

    Parameters
    ----------
    sensor_names, fusion_names : sequence of str
        Instances.

    Returns
    -------
    dict of str to str
        "#rrggbb" under the keys `commanded`, `truth`, `sensors/<name>` and `fusion/<name>`.
    """
    colors = {"commanded": COMMANDED, "truth": TRUTH}
    keys = [*(f"sensors/{name}" for name in sensor_names), *(f"fusion/{name}" for name in fusion_names)]
    return colors | {key: color_of(key) for key in keys}


class Mark(NamedTuple):
    """How the line of a signal is dashed and marked, and its place among those that it is drawn with."""

    dash: Dash
    marker: str
    turn: int


def marked_every(mark: Mark, n_points: int) -> tuple[int, int]:
    """Return the first point of a line that is marked and how many further the next one is: a few, each line elsewhere.

    Parameters
    ----------
    mark : Mark
        Of the line.
    n_points : int
        Of the line.
    """
    step = max(1, n_points // _N_MARKS)
    return int((0.3 + 0.37 * mark.turn) % 1.0 * step), step


def series_marks(groups: Iterable[str]) -> dict[str, Mark]:
    """Return dashes and marker of every sensor and filter: no two of a group have both in common.

    What ships keeps its own; any other name has that of its hash or the next whose marker is free, else the next pair.

    Parameters
    ----------
    groups : iterable of str
        ``sensors/<name>``, ``fusion/<name>`` or ``columns/<name>``; anything else is left out.
    """
    drawn = [group for group in groups if "/" in group]
    places: dict[str, int] = {}
    taken: set[tuple[str, int]] = set()
    for group in sorted(drawn, key=lambda one: one not in NAMED):
        kind = group.split("/", maxsplit=1)[0]
        n_markers = len(_MARKERS[kind])
        n_pairs, first = len(DASHES) * n_markers, _first_place(group)
        order = [(first + step) % n_pairs for step in range(n_pairs)]
        markers = {place % n_markers for other, place in taken if other == kind}
        free = [place for place in order if (kind, place) not in taken] or order
        places[group] = next((place for place in free if place % n_markers not in markers), free[0])
        taken.add((kind, places[group]))
    return {group: _mark(group, places[group], turn) for turn, group in enumerate(drawn)}


def _first_place(group: str) -> int:
    kind = group.split("/", maxsplit=1)[0]
    if group in NAMED:
        return [name for name in NAMED if name.startswith(f"{kind}/")].index(group)
    return hashlib.sha256(group.encode()).digest()[2]


def _mark(group: str, place: int, turn: int) -> Mark:
    markers = _MARKERS[group.split("/", maxsplit=1)[0]]
    return Mark(DASHES[place % len(DASHES)], markers[place % len(markers)], turn)


def rgb(color: str) -> tuple[int, int, int]:
    """Return the three bytes of "#rrggbb"."""
    return int(color[1:3], 16), int(color[3:5], 16), int(color[5:7], 16)


def mix(color: str, other: str, share: float) -> str:
    """Return the colour that has the given share (0 to 1) of `other` in it."""
    mixed = (round((1 - share) * a + share * b) for a, b in zip(rgb(color), rgb(other), strict=True))
    return "#" + "".join(f"{value:02x}" for value in mixed)
