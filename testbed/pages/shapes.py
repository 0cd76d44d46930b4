"""Marks of points as paths of SVG, by the letters that matplotlib has for them."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from collections.abc import Sequence

# From the centre to the corner of a solid mark, and to the end of an open one; and the rim of a solid one.
_SOLID, _OPEN, SOLID_RIM = 2.9, 3.1, 0.6


def _corners(radii: Sequence[float], start: float) -> list[tuple[float, float]]:
    """Return corners at equal angles, the first one at `start` [deg] from the right, anticlockwise."""
    angles = np.radians(start) + 2.0 * np.pi * np.arange(len(radii)) / len(radii)
    return [(r * float(np.cos(a)), -r * float(np.sin(a))) for r, a in zip(radii, angles, strict=True)]


def _closed(corners: Sequence[tuple[float, float]]) -> str:
    """Return a closed path whose corners are given from its centre, where the pen stands before."""
    steps = np.diff([(0.0, 0.0), *corners], axis=0)
    return "".join(f"{'l' if k else 'm'}{x:.1f} {y:.1f}" for k, (x, y) in enumerate(steps)) + "z"


def _polygon(n: int, start: float) -> str:
    return _closed(_corners([_SOLID] * n, start))


def _cross(start: float) -> str:
    """Return a thick cross: each arm has two corners, and there is one between two arms."""
    arm, waist = (1.0, 3.0), (1.0, 1.0)
    found = []
    for quarter in np.radians(start) + np.pi / 2.0 * np.arange(4):
        turn = np.array([[np.cos(quarter), -np.sin(quarter)], [np.sin(quarter), np.cos(quarter)]])
        for along, across in ((arm[1], -arm[0]), (arm[1], arm[0]), waist):
            x, y = turn @ (along, across)
            found.append((float(x), -float(y)))
    return _closed(found)


def _spokes(n: int, start: float) -> str:
    return "".join(f"l{x:.1f} {y:.1f}m{-x:.1f} {-y:.1f}" for x, y in _corners([_OPEN] * n, start))


_R = 2.5
SHAPES = {
    "o": f"m-{_R} 0a{_R} {_R} 0 1 0 {2 * _R} 0a{_R} {_R} 0 1 0 -{2 * _R} 0z",
    "s": _polygon(4, 45.0),
    "D": _polygon(4, 0.0),
    "^": _polygon(3, 90.0),
    "v": _polygon(3, -90.0),
    "<": _polygon(3, 180.0),
    ">": _polygon(3, 0.0),
    "p": _polygon(5, 90.0),
    "h": _polygon(6, 90.0),
    "*": _closed(_corners([3.6, 1.5] * 5, 90.0)),
    "P": _cross(0.0),
    "X": _cross(45.0),
    "x": _spokes(4, 45.0),
    "+": _spokes(4, 0.0),
    "1": _spokes(3, -90.0),
    "2": _spokes(3, 90.0),
    "_": _spokes(2, 0.0),
    "|": _spokes(2, 90.0),
}


def is_open(marker: str) -> bool:
    """Return whether a mark is made of strokes, without an inside.

    Parameters
    ----------
    marker : str
        A key of `SHAPES`.
    """
    return not SHAPES[marker].endswith("z")
