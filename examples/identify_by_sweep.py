"""Identify the sensors as paper 1 does, from a stepped-sine sweep in time: the shipped belief `swept` comes from here.

The simulated `sx300` (20 kHz) and `adis16505_filtered` (2 kHz) are shaken at 1 deg/s, one frequency after the other,
with all their noise on. Gain and phase of each step are fitted over whole periods; then equation (39)'s forms are
fitted to the steps with relative weight: (b1 s + b0)/(a2 s^2 + a1 s + a0) for the gyro, b1 s/(a2 s^2 + a1 s + a0) for
the MHD sensor. The judged frequencies 0.5, 4, 10 Hz are left out.

Run it with ``python examples/identify_by_sweep.py [SEED]``; it prints the belief file (a few seconds).
"""

from __future__ import annotations

import sys

import numpy as np

from testbed.fusion.analysis.identify import Identified, identify, sine_response
from testbed.sensors import load_preset
from testbed.signals import BASE_RATE_HZ

AMPLITUDE = np.deg2rad(1.0)
SEED = 11
FREQ_HZ = np.array(
    [
        0.01,
        0.02,
        0.04,
        0.07,
        0.12,
        0.2,
        0.3,
        0.7,
        1.2,
        2.0,
        3.0,
        5.0,
        7.0,
        12.0,
        20.0,
        35.0,
        60.0,
        100.0,
        170.0,
        300.0,
        500.0,
        800.0,
    ]
)
# The gyro's slow mode (time constant 9.6 s, 4 % of the gain) must have gone where it is to be measured; above, the fit
# of a drift takes it up.
SLOW_HZ, SETTLE_SLOW_S, SETTLE_S, LEAST_S = 0.5, 60.0, 10.0, 10.0
SENSORS = {
    "mems_gyro": ("adis16505_filtered", {"real_poles": 2}),
    "mhd_ars": ("sx300", {"real_poles": 2, "blind_at_dc": True}),
}
NOISE = {
    "mems_gyro": {
        "input_noise": ("0.15 deg/sqrt(h)", "data sheet ADIS16505-2, angle random walk: it passes the low-pass"),
        "output_noise": ("4.243e-5 deg/sqrt(h)", "assumed: 1e-9 (deg/s)^2 per reading at 2 kHz, keeps R positive"),
        "bias_instability": ("2.7 deg/h", "data sheet ADIS16505-2, as in the preset"),
        "rate_random_walk": ("0.1 deg/h/sqrt(h)", "assumed, as in the preset"),
        "lowest_frequency": ("0.1 mHz", "assumed, as in the preset"),
        "range": ("500 deg/s", "as in the preset"),
        "resolution": ("0.3814697265625 udeg/s", "one count of the 32-bit word"),
    },
    "mhd_ars": {
        "input_noise": ("0 deg/sqrt(h)", ""),
        "output_noise": ("100 nrad/s/sqrt(Hz)", "as in the preset; the 18-bit step adds 0.7 %"),
        "noise_knee": ("0.1 Hz", "assumed, as in the preset"),
        "lowest_frequency": ("0.1 mHz", "assumed, as in the preset"),
        "range": ("30 deg/s", "as in the preset"),
        "resolution": ("2.288818359375e-4 deg/s", "18 bits over +-30 deg/s"),
    },
}


def measured_s(freq_hz: float) -> float:
    """Return for how long a step is measured [s]: whole periods, two at least."""
    return float(np.ceil(max(2.0, LEAST_S * freq_hz)) / freq_hz)


def sweep(seed: int = SEED) -> dict[str, tuple[np.ndarray, np.ndarray]]:
    """Return frequencies [Hz] and complex response [-] of each sensor, as far as its sample rate reaches."""
    found: dict[str, list[tuple[float, complex]]] = {name: [] for name in SENSORS}
    for i, freq in enumerate(FREQ_HZ):
        settle = SETTLE_SLOW_S if freq < SLOW_HZ else SETTLE_S
        t = np.arange(round((settle + measured_s(freq)) * BASE_RATE_HZ)) / BASE_RATE_HZ
        rate = AMPLITUDE * np.sin(2.0 * np.pi * freq * t)
        for name, (preset, _) in SENSORS.items():
            sensor = load_preset(preset)
            if freq < sensor.sample_rate / 2.0:
                readings = sensor.sample(rate, BASE_RATE_HZ, 1000 * seed + i)
                found[name].append((freq, sine_response(readings, sensor.sample_rate, freq, AMPLITUDE, settle=settle)))
    return {name: (np.array([f for f, _ in rows]), np.array([G for _, G in rows])) for name, rows in found.items()}


def identified(seed: int = SEED) -> dict[str, Identified]:
    """Return the fitted transfer function of each sensor."""
    return {name: identify(*points, **SENSORS[name][1]) for name, points in sweep(seed).items()}


def belief_file(seed: int = SEED) -> str:
    """Return the text of the belief file."""
    lines = [
        "# Equation (39)'s forms, identified from a stepped sine of 1 deg/s with noise on.",
        "# Written by examples/identify_by_sweep.py; s in rad/s, highest power first.",
    ]
    for name, fit in identified(seed).items():
        lines.append(
            f"{name}:  # {SENSORS[name][0]}, fit and measured points differ by at most {100.0 * fit.worst:.2g} %"
        )
        # Six digits: the noise leaves three.
        lines += [
            f"  {key}: [{', '.join(f'{value:.6g}' for value in getattr(fit, key))}]"
            for key in ("numerator", "denominator")
        ]
        lines += [
            f"  {key}: {value}" + (f"  # {source}" if source else "") for key, (value, source) in NOISE[name].items()
        ]
    return "\n".join(lines) + "\n"


def main() -> None:
    """Print the belief file."""
    print(belief_file(int(sys.argv[1]) if len(sys.argv) > 1 else SEED), end="")


if __name__ == "__main__":
    main()
