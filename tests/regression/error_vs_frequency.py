"""Gain, phase and RMSE of every sensor and filter over a small grid of frequencies; run as a program it rewrites the
baseline.

The baseline is a regression aid and no proof: its numbers come from this code. What they should be is judged elsewhere,
against closed forms.
"""

from __future__ import annotations

import json
import tempfile
from pathlib import Path

import testbed

BASELINE = Path(__file__).with_name("baseline.json")
FREQUENCIES_HZ = (0.5, 2.0, 4.0, 10.0, 25.0, 100.0)
SCENARIO = """\
name: error_vs_frequency
seed: 2024
duration: 4 s
settle: 2 s
motion:
  - sine: {{frequency: {frequency} Hz, rate: 1 deg/s}}
sensors:
  mhd_ars: {{preset: sx300}}
  mems_gyro: {{preset: adis16505_filtered}}
fusion:
  kalman: {{}}
  shakf: {{}}
  arw_shakf: {{}}
  arw_shakf_literal: {{}}
"""


def measure() -> dict[str, list[dict[str, float]]]:
    """Return, by sensor and filter, one row of gain, phase and RMSE per frequency."""
    table: dict[str, list[dict[str, float]]] = {}
    for frequency in FREQUENCIES_HZ:
        with tempfile.TemporaryDirectory() as folder:
            path = Path(folder) / "scenario.yaml"
            path.write_text(SCENARIO.format(frequency=frequency))
            metrics = testbed.run(testbed.load_scenario(path)).metrics
        for name, row in {**metrics["sensors"], **metrics["fusion"]}.items():
            (line,) = row["lines"]
            table.setdefault(name, []).append({**line, "rmse_deg_s": row["rmse_deg_s"]})
    return table


def main() -> None:
    """Measure and store the baseline."""
    BASELINE.write_text(json.dumps(measure(), indent=1) + "\n")


if __name__ == "__main__":
    main()
