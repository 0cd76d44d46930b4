"""Draw docs/images/rooms.svg: the rooms, and the way of a reading through them (`python -m tests.project.picture`).

Rooms that do not exist (yet) are left out, so a new one needs no more than its place here.
"""

from __future__ import annotations

from pathlib import Path
from typing import NamedTuple

import testbed

ROOT = Path(testbed.__file__).parent
PICTURE = Path(__file__).parents[2] / "docs" / "images" / "rooms.svg"
WIDTH, HEIGHT = 1120, 700
STAGE, TOOL, LOOK, TOP = "#dbe9f6", "#eeeeee", "#e3f1dd", "#f7ecd9"
INK, WAY, TRUTH = "#222222", "#1f5fa8", "#b0561f"


class Room(NamedTuple):
    """A box: its place, its colour and what it holds, lines divided by a bar."""

    x: float
    y: float
    w: float
    h: float
    fill: str
    text: str


ROOMS = {
    "cli": Room(30, 20, 250, 50, TOP, "commands; the only room that prints"),
    "reproduce": Room(310, 20, 250, 50, TOP, "the papers' measurements again"),
    "campaigns": Room(590, 20, 250, 50, TOP, "many runs: sweeps, regression, design"),
    "design": Room(870, 20, 220, 50, TOP, "a chain for a requirement"),
    "scenario": Room(30, 160, 170, 120, STAGE, "YAML, units, presets|→ validated, in SI,|and back"),
    "models": Room(
        *(270, 140, 250, 160, STAGE),
        "motion: the commanded rate|turntable in MuJoCo, or its modes|MHD channel, coil temperatures||"
        "truth: inertial rate at each site",
    ),
    "sensors": Room(570, 140, 160, 160, STAGE, "MHD ARS, MEMS gyro,|fibre-optic gyro:|noise, range, words||readings"),
    "fusion": Room(
        *(800, 140, 180, 160, STAGE), "filters, each with a|belief of its own||estimates: rate, std,|diagnostics"
    ),
    "pointing": Room(1005, 140, 95, 160, STAGE, "line of|sight"),
    "judging": Room(570, 390, 200, 80, STAGE, "errors, floor, optimum,|verdict on the claims"),
    "runs": Room(820, 390, 160, 80, STAGE, "run.nc, metrics.json,|in memory or on disk"),
    "recording": Room(630, 540, 140, 64, LOOK, "Rerun: recording.rrd"),
    "report": Room(790, 540, 140, 64, LOOK, "report.html"),
    "notebook": Room(950, 540, 140, 64, LOOK, "table, figures, xarray"),
    "logs": Room(30, 390, 200, 80, STAGE, "recorded files:|time base, channels"),
    "identification": Room(270, 390, 110, 80, STAGE, "a belief from|a record"),
    "playback": Room(400, 390, 130, 80, STAGE, "a record through|the filters"),
    "compensation": Room(270, 540, 160, 64, STAGE, "drift models of arrays"),
    "drift": Room(30, 540, 200, 64, STAGE, "train, apply, audit a gyro"),
    "metrics": Room(30, 630, 180, 50, TOOL, "sums over blocks of arrays"),
    "allan": Room(230, 630, 180, 50, TOOL, "Allan deviation"),
    "pages": Room(430, 630, 180, 50, TOOL, "SVG, HTML, numbers"),
}
FOUNDATION = (630, 630, 460, 50)

# From (x, y) to (x, y), along corners, the readings' way, and what only the judge may know.
WAYS = [
    (WAY, (200, 220), (270, 220)),
    (WAY, (520, 220), (570, 220)),
    (WAY, (730, 220), (800, 220)),
    (WAY, (890, 300), (890, 345), (720, 345), (720, 390)),
    (WAY, (890, 300), (890, 390)),
    (WAY, (770, 430), (820, 430)),
    (WAY, (900, 470), (900, 505), (700, 505), (700, 540)),
    (WAY, (900, 470), (900, 505), (860, 505), (860, 540)),
    (WAY, (900, 470), (900, 505), (1020, 505), (1020, 540)),
    (TRUTH, (395, 300), (395, 345), (620, 345), (620, 390)),
]
OTHER_WAYS = {
    "logs": [
        (WAY, (130, 390), (130, 360), (782, 360), (782, 270), (800, 270)),
        (WAY, (130, 470), (130, 540)),
    ],
    "pointing": [(WAY, (980, 220), (1005, 220))],
    "drift": [(WAY, (270, 572), (230, 572))],
}


def picture() -> str:
    """Return the picture as SVG."""
    there = [name for name in ROOMS if (ROOT / name / "__init__.py").exists()]
    ways = [*WAYS, *(way for name, more in OTHER_WAYS.items() if name in there for way in more)]
    return "\n".join(
        [
            f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {WIDTH} {HEIGHT}" font-family="sans-serif">',
            "<title>The rooms of testbed and the way of a reading through them</title>",
            f"<defs>{_head('way', WAY)}{_head('truth', TRUTH)}</defs>",
            f'<rect width="{WIDTH}" height="{HEIGHT}" fill="white"/>',
            _frame(245, 100, 865 if "pointing" in there else 765, 230, "none", dash="6 4"),
            _text(260, 124, "chain/", "block after block; any length of a block gives the same bits"),
            f'<line x1="765" y1="134" x2="765" y2="306" stroke="{TRUTH}" stroke-width="3"/>',
            _text(755, 322, "", "readings pass, nothing else", TRUTH, "end"),
            *(_box(name, ROOMS[name]) for name in there),
            _foundation(),
            *(_way(*way) for way in ways),
            "</svg>\n",
        ]
    )


def _head(name: str, color: str) -> str:
    return (
        f'<marker id="{name}" viewBox="0 0 8 8" refX="7" refY="4" markerWidth="7" markerHeight="7" orient="auto">'
        f'<path d="M0 0 L8 4 L0 8 Z" fill="{color}"/></marker>'
    )


def _text(x: float, y: float, bold: str, plain: str, color: str = INK, anchor: str = "start") -> str:
    head = f'<tspan font-weight="bold">{bold}</tspan> ' if bold else ""
    return f'<text x="{x}" y="{y}" font-size="12" fill="{color}" text-anchor="{anchor}">{head}{plain}</text>'


def _box(name: str, room: Room) -> str:
    lines = [_text(room.x + 10, room.y + 20, f"{name}/", "")]
    lines += [_text(room.x + 10, room.y + 38 + 17 * i, "", line) for i, line in enumerate(room.text.split("|")) if line]
    return _frame(*room[:5]) + "".join(lines)


def _frame(x: float, y: float, w: float, h: float, fill: str, dash: str = "none") -> str:
    place = f'x="{x}" y="{y}" width="{w}" height="{h}" rx="6"'
    return f'<rect {place} fill="{fill}" stroke="#888888" stroke-dasharray="{dash}"/>'


def _foundation() -> str:
    x, y, *_ = FOUNDATION
    words = _text(x + 10, y + 26, "ground floor", "errors, units, signals, parts, document, inputs")
    return _frame(*FOUNDATION, TOOL) + words


def _way(color: str, *points: tuple[float, float]) -> str:
    corners = " ".join(f"{x},{y}" for x, y in points)
    head = "way" if color == WAY else "truth"
    return f'<polyline points="{corners}" fill="none" stroke="{color}" stroke-width="2" marker-end="url(#{head})"/>'


if __name__ == "__main__":
    PICTURE.write_text(picture(), encoding="utf-8")
