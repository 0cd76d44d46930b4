"""Calibrate the limits of N_k on a sweep of the simulated sensors, as Figure 7 of paper 1: the shipped bands
`sx300_adis16505` come from here.

A stepped sine of 1 deg/s over 0.1-25 Hz, at frequencies that none of the judged signals uses (0.5, 4, 10 Hz are left
out), through the presets `sx300` and `adis16505_filtered`; N_k / dT of each step is the mean half squared increment of
the readings once they have settled. The band edges are where physics puts them: 2 Hz, about the corner of the MHD ARS,
and 6.3 Hz, beyond the 4.5 Hz low-pass of the gyro. The R of each band and the waits are choices, not measurements; the
file says which.

Run it with ``python examples/calibrate_bands.py`` for the sweep, and with ``--file`` for the file of bands. For your
own sensors change PRESETS, EDGES_HZ and CHOICES, and name the bands under `bands:` of the filter.
"""

from __future__ import annotations

import sys

import numpy as np

from testbed.fusion.bands import calibrate_bands, increment_variance
from testbed.sensors import load_preset
from testbed.signals import BASE_RATE_HZ

SWEEP_HZ = np.array([0.1, 0.2, 0.35, 0.7, 1.0, 1.4, 2.0, 2.8, 3.3, 5.0, 6.3, 8.0, 12.0, 17.0, 25.0])
PRESETS = {"mems_gyro": "adis16505_filtered", "mhd_ars": "sx300"}
SETTLE_S = 2.0
SEED = 7
EDGES_HZ = (2.0, 6.3)
# R of the low, mid and high band in (deg/s)^2, and the wait before a band is judged, with the reason of each.
CHOICES = {
    "mems_gyro": (
        ("1e-4", "1e-3", "1e-2", "chosen: trust the gyro ever less as the signal leaves its low-pass"),
        ("65 ms", "130 readings: spurious entries at the start end"),
    ),
    "mhd_ars": (
        ("6.5e-7", "2e-7", "1e-7", "the white noise of a reading, then below it: trust the MHD ARS ever more"),
        ("10 ms", "200 readings"),
    ),
}


def sweep(seed: int = SEED) -> dict[str, np.ndarray]:
    """Return N_k / dT [rad^2/s^2] of each sensor at every frequency of the sweep."""
    levels = {name: np.empty(SWEEP_HZ.size) for name in PRESETS}
    for i, freq in enumerate(SWEEP_HZ):
        # Whole periods, as an increment depends on the phase.
        measure = np.ceil(2.0 * freq) / freq
        t = np.arange(round((SETTLE_S + measure) * BASE_RATE_HZ)) / BASE_RATE_HZ
        rate = np.deg2rad(1.0) * np.sin(2 * np.pi * freq * t)
        for name, preset in PRESETS.items():
            sensor = load_preset(preset)
            readings = sensor.sample(rate, BASE_RATE_HZ, seed + i)
            levels[name][i] = increment_variance(readings[round(SETTLE_S * sensor.sample_rate) :])
    return levels


def thresholds(levels: dict[str, np.ndarray]) -> dict[str, tuple[float, float]]:
    """Return the thresholds of N_k / dT [rad^2/s^2] of each sensor."""
    return {name: calibrate_bands(SWEEP_HZ, level, EDGES_HZ) for name, level in levels.items()}


def bands_file(levels: dict[str, np.ndarray]) -> str:
    """Return the text of the file of bands: two digits, as the scatter of N_k allows."""
    lines = [
        f"# N_k / dT of {' and '.join(PRESETS.values())} at the band edges of a stepped sine of 1 deg/s.",
        "# Written by examples/calibrate_bands.py:",
        (
            f"# {SWEEP_HZ[0]:g}-{SWEEP_HZ[-1]:g} Hz in {SWEEP_HZ.size} steps, edges {EDGES_HZ[0]:g} and "
            f"{EDGES_HZ[1]:g} Hz, noise on, seed {SEED}. N_k sees amplitude times frequency:"
        ),
        "# the limits hold for that amplitude only.",
    ]
    square = np.deg2rad(1.0) ** 2
    for name, limits in thresholds(levels).items():
        (*R, why_R), (wait, why_wait) = CHOICES[name]
        lines += [
            f"{name}:  # {PRESETS[name]}",
            f"  thresholds: [{', '.join(f'{limit / square:.1e} (deg/s)^2' for limit in limits)}]",
            f"  R: [{', '.join(f'{value} (deg/s)^2' for value in R)}]  # {why_R}",
            f"  wait: {wait}  # {why_wait}",
        ]
    return "\n".join(lines) + "\n"


def main() -> None:
    """Print the file of bands, or the sweep and the thresholds in (deg/s)^2."""
    levels = sweep()
    if "--file" in sys.argv[1:]:
        print(bands_file(levels), end="")
        return
    square = np.deg2rad(1.0) ** 2
    print("N_k / dT in (deg/s)^2 at 1 deg/s")
    print(f"{'Hz':>8}" + "".join(f"{name:>14}" for name in levels))
    for i, freq in enumerate(SWEEP_HZ):
        print(f"{freq:8.2f}" + "".join(f"{level[i] / square:14.3e}" for level in levels.values()))
    for name, (low, high) in thresholds(levels).items():
        print(f"{name}: thresholds {low / square:.2e} and {high / square:.2e} (deg/s)^2")


if __name__ == "__main__":
    main()
