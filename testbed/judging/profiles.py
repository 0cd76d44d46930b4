"""What the fluid of a channel does at a few instants: its velocity over the height."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from testbed.runs.block import POSE_STRIDE

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from testbed.runs.block import RunBlock
    from testbed.scenario.model import Scenario

N_INSTANTS = 6
# A profile is as smooth as its Stokes layers; more heights than this no figure shows.
_N_HEIGHTS = 81
# Span of the instants where no line is commanded [s].
_STILL = 1.0


class ProfileKeeper:
    """Keeps the profiles of every channel at six instants from `settle` on, over a period of the slowest line as far as
    the recording's poses are dense enough; over more where they are not.

    Parameters
    ----------
    scenario : Scenario
        What runs.
    """

    def __init__(self, scenario: Scenario) -> None:
        self._base, n_time = scenario.base_rate_hz, scenario.n_time
        lines = [freq for freq in scenario.lines if freq > 0.0]
        span = 1.0 / min(lines) if lines else _STILL
        every = max(1, round(span * self._base / N_INSTANTS / POSE_STRIDE))
        first = -(-round(scenario.frame.settle * self._base) // POSE_STRIDE)
        wanted = POSE_STRIDE * (first + every * np.arange(N_INSTANTS))
        self._wanted: NDArray[np.int64] = wanted[wanted < n_time]
        self._kept: dict[str, dict[str, Any]] = {}

    def write(self, block: RunBlock) -> None:
        """Add a block."""
        for name, (heights, profiles) in block.profiles.items():
            index = block.start + -block.start % POSE_STRIDE + POSE_STRIDE * np.arange(len(profiles))
            shown = np.unique(np.linspace(0, heights.size - 1, min(_N_HEIGHTS, heights.size)).round().astype(int))
            one = self._kept.setdefault(
                name, {"height_m": _digits(heights[shown]), "time_s": [], "wall_deg_s": [], "slip_deg_s": []}
            )
            for row in np.flatnonzero(np.isin(index, self._wanted)):
                wall = block.truth.sensor_rate[name][index[row] - block.start]
                one["time_s"].append(float(index[row] / self._base))
                one["wall_deg_s"].append(_digits(np.degrees([wall]))[0])
                one["slip_deg_s"].append(_digits(np.degrees(profiles[row][shown])))

    def result(self) -> dict[str, dict[str, Any]]:
        """Return the entry `profiles` of metrics.json: of every channel with at least one instant."""
        return {name: one for name, one in self._kept.items() if one["time_s"]}


def _digits(values: Any) -> list[float]:
    """Return the values with six digits: a figure shows three."""
    return [float(f"{value:.6g}") for value in values]
