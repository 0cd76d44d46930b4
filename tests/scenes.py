"""Short scenarios for tests that need a whole chain."""

from __future__ import annotations

from typing import TYPE_CHECKING

from testbed.scenario.loader import load_scenario

if TYPE_CHECKING:
    from pathlib import Path

    from testbed.scenario.model import Scenario

SHORT = """\
name: short
seed: 11
duration: 0.5 s
settle: 0.2 s
ramp_in: 0.1 s
turntable: {preset: air_bearing}
motion:
  - sine: {frequency: 10 Hz, rate: 1 deg/s}
sensors:
  mhd_ars: {preset: sx300}
  mems_gyro: {preset: adis16505_filtered}
fusion:
  kalman: {}
  arw_shakf: {}
expect:
  kalman: {rmse_deg_s: "< 1"}
"""


def short(folder: Path, *edits: tuple[str, str], plugins: tuple[str, ...] = ()) -> Scenario:
    """Return the short scenario with (old, new) replaced in its text."""
    return load_scenario(short_file(folder, *edits), plugins=plugins)


def short_file(folder: Path, *edits: tuple[str, str]) -> Path:
    """Write the short scenario with (old, new) replaced in its text, and return the file."""
    text = SHORT
    for old, new in edits:
        assert old in text
        text = text.replace(old, new)
    path = folder / "short.yaml"
    path.write_text(text, encoding="utf-8")
    return path
