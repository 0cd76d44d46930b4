"""How the error of each filter scatters over seeds, and what a noisier MHD ARS would cost.

Run: `python examples/scatter_of_errors.py [SCENARIO.yaml] [--seeds 20] [--seconds 20]`
"""

from __future__ import annotations

import argparse
from pathlib import Path

import numpy as np

import testbed

SCENARIO = Path(__file__).parents[1] / "scenarios" / "mixed_0p5hz_10hz.yaml"
CHANGES = {
    "as it is": {},
    "a noisy MHD ARS": {"sensors.mhd_ars.noise_density": "10 urad/s/sqrt(Hz)"},
}


def quantiles(scenario: testbed.Scenario, seeds: int) -> dict[str, dict[str, list[float]]]:
    """Return by change and filter the 5 %, 50 % and 95 % quantile of the RMSE over seeds [deg/s]."""
    table = testbed.evaluate(scenario, range(seeds), CHANGES.values())
    return {
        label: {
            name: np.quantile([one.fusion[name].rmse_deg_s for one in row], [0.05, 0.5, 0.95]).tolist()
            for name in scenario.fusion
        }
        for label, row in zip(CHANGES, table, strict=True)
    }


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("scenario", nargs="?", default=str(SCENARIO))
    parser.add_argument("--seeds", type=int, default=20)
    parser.add_argument("--seconds", type=float, default=20.0, help="length of the run, judged in its second half")
    given = parser.parse_args()
    scenario = testbed.load_scenario(given.scenario).with_(
        duration=f"{given.seconds} s", settle=f"{given.seconds / 2} s", **{"turntable.engine": "auto"}
    )
    print(f"{'':34}{'filter':16}{'5 %':>10}{'median':>10}{'95 %':>10}  RMSE [deg/s], {given.seeds} seeds")
    for label, filters in quantiles(scenario, given.seeds).items():
        for name, values in filters.items():
            print(f"{label:34}{name:16}" + "".join(f"{value:10.5f}" for value in values))


if __name__ == "__main__":
    main()
