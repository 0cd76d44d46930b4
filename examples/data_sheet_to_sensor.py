"""From a data sheet to a sensor: its keys, what they become, and the noise of the readings beside what the sheet says.

Run: python examples/data_sheet_to_sensor.py
"""

from __future__ import annotations

import numpy as np

from testbed.allan import allan_deviation
from testbed.sensors.mems_gyro import MemsGyro

# The gyro of the MPU-6050, product specification PS-MPU-6000A-00 revision 3.4, section 6.1; the floor is assumed.
SHEET = {
    "output_rate": "1 kHz",
    "full_scale": "250 dps",
    "sensitivity": "131 LSB/dps",
    "word_bits": 16,
    "rate_noise_density": "5 mdps/√Hz",
    "bandwidth": "98 Hz",
    "total_rms_noise": "0.05 dps",
    "in_run_bias_stability": "10 °/h",
}
SECONDS = 1000


def main() -> None:
    """Translate the sheet, read the gyro at rest, and print what comes out beside what went in."""
    for step in MemsGyro.sheet(SHEET, border=True).steps:
        print(f"{step.key} {step.written} ({step.rule}) -> {step.becomes}")
    gyro = MemsGyro.model_validate(SHEET, context={"border": True})
    for doubt in gyro.doubts():
        print(f"warning: {doubt}")
    readings = gyro.start(gyro.sample_rate, 1, "gyro").process(np.zeros(round(SECONDS * gyro.sample_rate)))
    print(f"rms of {SECONDS} s at rest: {np.rad2deg(np.std(readings)):.4f} deg/s (sheet 0.05)")
    tau = 0.1
    curve = allan_deviation(readings, gyro.sample_rate, [tau])
    walk, slope = (60.0 * np.rad2deg(x) for x in (curve.deviation[0] * tau**0.5, gyro.angle_random_walk))
    print(f"Allan deviation at {tau} s as an angle random walk: {walk:.3f} deg/sqrt(h) (N is {slope:.3f})")
    doubled = MemsGyro.model_validate(
        {**SHEET, "rate_noise_density": "7.07 mdps/√Hz", "total_rms_noise": "0.0522 dps"}, context={"border": True}
    )
    print(f"with a density that was multiplied by sqrt(2) before: {doubled.doubts()[0]}")


if __name__ == "__main__":
    main()
