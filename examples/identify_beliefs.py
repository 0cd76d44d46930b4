"""Identify what the filters may believe about the presets `sx300` and `adis16505_filtered`: the shipped belief
`identified` comes from here.

Each response is sampled at 301 frequencies, 0.01 Hz to 1 kHz, evenly in logarithm, and fitted with relative weight;
noise is the data sheets'. Four real poles carry the Stokes layer of the MHD channel to 2e-4; equation (39), with two,
is wrong by 0.2 %.

Run it with ``python examples/identify_beliefs.py``; it prints the belief file.
"""

from __future__ import annotations

import numpy as np

from testbed.fusion.analysis.identify import Identified, identify
from testbed.sensors import load_preset

FREQ_HZ = np.logspace(-2.0, 3.0, 301)
SENSORS = {
    "mems_gyro": ("adis16505_filtered", {"real_poles": 2}),
    "mhd_ars": ("sx300", {"real_poles": 4, "blind_at_dc": True}),
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


def identified() -> dict[str, Identified]:
    """Return the fitted transfer function of each sensor."""
    return {
        name: identify(FREQ_HZ, load_preset(preset).response(FREQ_HZ), **order)
        for name, (preset, order) in SENSORS.items()
    }


def belief_file() -> str:
    """Return the text of the belief file."""
    lines = [
        f"# What fits the responses of the presets {' and '.join(preset for preset, _ in SENSORS.values())}.",
        "# Written by examples/identify_beliefs.py; s in rad/s, highest power first.",
    ]
    for name, fit in identified().items():
        lines.append(
            f"{name}:  # {SENSORS[name][0]}, "
            f"misfit below {max(1.01 * fit.worst, 1e-9):.1e} from {FREQ_HZ[0]:g} to {FREQ_HZ[-1]:g} Hz"
        )
        # Nine digits: far below the misfit.
        lines += [
            f"  {key}: [{', '.join(f'{value:.9g}' for value in getattr(fit, key))}]"
            for key in ("numerator", "denominator")
        ]
        lines += [
            f"  {key}: {value}" + (f"  # {source}" if source else "") for key, (value, source) in NOISE[name].items()
        ]
    return "\n".join(lines) + "\n"


def main() -> None:
    """Print the belief file."""
    print(belief_file(), end="")


if __name__ == "__main__":
    main()
