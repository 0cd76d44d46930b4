"""The shipped instruments beside each other, in the units of data sheets."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from testbed.cli.console import ruled, terminal
from testbed.parts import preset, preset_names
from testbed.sensors import load_preset
from testbed.sensors.data_sheet import ALLAN_FLOOR

if TYPE_CHECKING:
    from collections.abc import Mapping

    from testbed.sensors.base import Sensor

_COLUMNS = {
    "type": "type",
    "angle_random_walk_deg_sqrt_h": "N, deg/sqrt(h)",
    "noise_density_mdps_sqrt_hz": "one-sided, mdps/sqrt(Hz)",
    "bias_floor_deg_h": "floor, deg/h",
    "bandwidth_hz": "-3 dB, Hz",
    "output_rate_hz": "rate, Hz",
    "full_scale_deg_s": "range, deg/s",
    "belief": "belief",
}


def part_figures() -> dict[str, dict[str, Any]]:
    """Return the figures of every shipped instrument, None where it has none of a kind."""
    return {name: _figures(name, load_preset(name)) for name in preset_names("testbed.sensors")}


def _figures(name: str, sensor: Sensor) -> dict[str, Any]:
    content = preset("testbed.sensors", name)
    white = float(getattr(sensor, "angle_random_walk", 0.0) or getattr(sensor, "noise_density", 0.0))
    flicker = getattr(sensor, "bias_instability", None)
    return {
        "type": content["type"],
        "angle_random_walk_deg_sqrt_h": _round(np.rad2deg(60.0 * white)),
        "noise_density_mdps_sqrt_hz": _round(np.rad2deg(1e3 * 2.0**0.5 * white)),
        "bias_floor_deg_h": None if flicker is None else _round(np.rad2deg(3600.0 * ALLAN_FLOOR * flicker)),
        "bandwidth_hz": _round(bandwidth(sensor)),
        "output_rate_hz": _round(sensor.sample_rate),
        "full_scale_deg_s": _round(np.rad2deg(sensor.full_scale())),
        "belief": content.get("belief"),
    }


def bandwidth(sensor: Sensor) -> float:
    """Return the highest frequency at which half the power of the pass band comes through [Hz], of a grid of 0.2 %."""
    freq = np.geomspace(1e-2, 1e4, 7000)
    gain = np.abs(sensor.response(freq))
    return float(freq[np.flatnonzero(gain >= gain.max() / 2.0**0.5)[-1]])


def _round(value: float) -> float:
    return float(f"{value:.3g}")


def print_part_figures(parts: Mapping[str, Mapping[str, Any]]) -> None:
    """Print one line for each shipped instrument."""
    table = ruled("part", *_COLUMNS.values())
    table.columns[0].no_wrap = True
    for column in table.columns[2:-1]:
        column.justify = "right"
    for name, figures in parts.items():
        table.add_row(name, *("-" if figures[key] is None else _shown(figures[key]) for key in _COLUMNS))
    terminal().print(table)


def _shown(value: Any) -> str:
    return f"{value:g}" if isinstance(value, float) else str(value)
