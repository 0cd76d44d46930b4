"""Calibrate the thresholds of N_k on a sweep of the simulated sensors, as Figure 7 of paper 1: the defaults of `arw_shakf` come from here.

A stepped sine of 1 deg/s over 0.1-25 Hz, at frequencies that none of the judged signals uses (0.5, 4, 10 Hz are left out), through the
presets `sx300` and `adis16505_filtered`; N_k / dT of each step is the mean half squared increment of the readings once they have settled.
The band edges are where physics puts them: 2 Hz, about the corner of the MHD ARS, and 6.3 Hz, beyond the 4.5 Hz low-pass of the gyro.

Run it with ``python examples/calibrate_bands.py``.
"""

from __future__ import annotations

import numpy as np

from testbed.fusion.arw_shakf import calibrate_bands, increment_variance
from testbed.sensors import load_preset

SWEEP_HZ = np.array([0.1, 0.2, 0.35, 0.7, 1.0, 1.4, 2.0, 2.8, 3.3, 5.0, 6.3, 8.0, 12.0, 17.0, 25.0])
PRESETS = {"mems_gyro": "adis16505_filtered", "mhd_ars": "sx300"}
BASE_HZ = 20_000.0
SETTLE_S = 2.0


def sweep(seed: int = 7) -> dict[str, np.ndarray]:
    """Return N_k / dT [rad^2/s^2] of each sensor at every frequency of the sweep."""
    levels = {name: np.empty(SWEEP_HZ.size) for name in PRESETS}
    for i, freq in enumerate(SWEEP_HZ):
        # Whole periods, as an increment depends on the phase.
        measure = np.ceil(2.0 * freq) / freq
        t = np.arange(round((SETTLE_S + measure) * BASE_HZ)) / BASE_HZ
        rate = np.deg2rad(1.0) * np.sin(2 * np.pi * freq * t)
        for name, preset in PRESETS.items():
            sensor = load_preset(preset)
            readings = sensor.sample(rate, BASE_HZ, seed + i)
            levels[name][i] = increment_variance(readings[round(SETTLE_S * sensor.sample_rate) :])
    return levels


def thresholds() -> dict[str, tuple[float, float]]:
    """Return the thresholds of N_k / dT [rad^2/s^2] of each sensor."""
    return {name: calibrate_bands(SWEEP_HZ, level) for name, level in sweep().items()}


def main() -> None:
    """Print the sweep and the thresholds in (deg/s)^2."""
    square = np.deg2rad(1.0) ** 2
    levels = sweep()
    print("N_k / dT in (deg/s)^2 at 1 deg/s")
    print(f"{'Hz':>8}" + "".join(f"{name:>14}" for name in levels))
    for i, freq in enumerate(SWEEP_HZ):
        print(f"{freq:8.2f}" + "".join(f"{level[i] / square:14.3e}" for level in levels.values()))
    for name, level in levels.items():
        low, high = calibrate_bands(SWEEP_HZ, level)
        print(f"{name}: thresholds {low / square:.2e} and {high / square:.2e} (deg/s)^2")


if __name__ == "__main__":
    main()
