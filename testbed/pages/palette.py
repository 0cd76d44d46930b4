"""One colour per signal, the same in the recording and in the report, legible on a dark and on a light background."""

from __future__ import annotations

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from collections.abc import Sequence

COMMANDED = "#7d8894"
TRUTH = "#b07d12"
# Sensors are cool, filters warm or green: the two groups stay apart where many lines cross.
SENSORS = ("#2f86d6", "#1593a5", "#7377e8", "#5b8aa6")
FILTERS = ("#2f9e58", "#b565d8", "#e2553d", "#c2652a", "#d6588f")


def series_colors(sensor_names: Sequence[str], fusion_names: Sequence[str]) -> dict[str, str]:
    """Return the colour of every rate signal; sensors and filters take theirs by order, repeated when they run out.

    Parameters
    ----------
    sensor_names, fusion_names : sequence of str
        Instances in the order of the scenario.

    Returns
    -------
    dict of str to str
        "#rrggbb" under the keys `commanded`, `truth`, `sensors/<name>` and `fusion/<name>`.
    """
    colors = {"commanded": COMMANDED, "truth": TRUTH}
    colors |= {f"sensors/{name}": SENSORS[i % len(SENSORS)] for i, name in enumerate(sensor_names)}
    colors |= {f"fusion/{name}": FILTERS[i % len(FILTERS)] for i, name in enumerate(fusion_names)}
    return colors


def rgb(color: str) -> tuple[int, int, int]:
    """Return the three bytes of "#rrggbb"."""
    return int(color[1:3], 16), int(color[3:5], 16), int(color[5:7], 16)


def mix(color: str, other: str, share: float) -> str:
    """Return the colour that has the given share (0 to 1) of `other` in it."""
    mixed = (round((1 - share) * a + share * b) for a, b in zip(rgb(color), rgb(other), strict=True))
    return "#" + "".join(f"{value:02x}" for value in mixed)
