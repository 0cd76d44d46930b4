"""A record of a sensor beside an encoder, each logged by a clock of its own, and what it says of the sensor.

An MHD ARS is shaken by sines of 1 deg/s, one after the other; the encoder's logger runs true, the sensor's is 200 ppm
fast, and its readings come 0.5 ms late. Both are written as text, as loggers do; then the sensor is identified.

Run it with ``python examples/identify_from_log.py [FOLDER]``; then, in that folder,
``testbed identify log.yaml --input encoder --output mhd_ars --out belief.yaml`` does the same (some seconds each).
"""

from __future__ import annotations

import sys
import tempfile
from pathlib import Path

import numpy as np

import testbed
from testbed.signals import BASE_RATE_HZ

FREQ_HZ = (0.7, 1.5, 3.0, 6.0, 12.0, 25.0, 47.0, 90.0)
STEP_S, AMPLITUDE_DEG = 4.0, 1.0
CLOCK, DELAY_S = 200e-6, 0.5e-3
ENCODER_HZ, SENSOR_HZ = 1000.0, 2000.0

LOG = """\
channels:
  encoder: {file: encoder.csv, column: angle, kind: angle, time: {column: t}}
  mhd_ars: {file: mhd_ars.csv, column: w, time: {column: t}}
"""


def angle_deg(t: np.ndarray) -> np.ndarray:
    """Return the angle of the table: a sine in each step, begun and ended smoothly."""
    k = np.clip((t / STEP_S).astype(int), 0, len(FREQ_HZ) - 1)
    freq, inside = np.array(FREQ_HZ)[k], np.clip(t - k * STEP_S, 0.0, STEP_S)
    envelope = np.clip(np.minimum(inside, STEP_S - inside) / 0.5, 0.0, 1.0)
    return (
        AMPLITUDE_DEG / (2.0 * np.pi * freq) * np.sin(2.0 * np.pi * freq * inside) * np.sin(np.pi / 2 * envelope) ** 2
    )


def write(folder: Path) -> Path:
    """Write both loggers' files and the map that joins them; return the map."""
    length = STEP_S * len(FREQ_HZ)
    t = np.arange(round(length * BASE_RATE_HZ)) / BASE_RATE_HZ
    rate = np.gradient(np.radians(angle_deg(t)), t)
    reading = testbed.load_preset("sx300").sample(rate, BASE_RATE_HZ, 1)
    encoder_t = np.arange(round(length * ENCODER_HZ)) / ENCODER_HZ
    own_t = np.arange(int(length / (1.0 + CLOCK) * SENSOR_HZ) - 2) / SENSOR_HZ
    late = np.interp((1.0 + CLOCK) * own_t - DELAY_S, t, reading)
    for name, head, times, values in (
        ("encoder", "t [ns],angle [deg]", encoder_t, angle_deg(encoder_t)),
        ("mhd_ars", "t [ns],w [deg/s]", own_t, np.degrees(late)),
    ):
        rows = np.column_stack([np.rint(1e9 * times), values])
        np.savetxt(folder / f"{name}.csv", rows, fmt=["%d", "%.9g"], delimiter=",", header=head, comments="")
    (folder / "log.yaml").write_text(LOG, encoding="utf-8")
    return folder / "log.yaml"


def main(folder: Path) -> None:
    """Write the record and print what it says."""
    found = testbed.identify_sensors(testbed.read_log(write(folder)), "encoder", "mhd_ars")[0]
    response = found.measured.response
    for freq, gain, half in zip(response.freq_hz, response.gain, response.half_widths[0], strict=True):
        print(f"{freq:8.3f} Hz  gain {gain:.5f} +- {half:.5f}")
    print(f"clock {1e6 * response.clock.error:.2f} ppm, dead time {1e6 * found.model.delay:.1f} us")


if __name__ == "__main__":
    if len(sys.argv) > 1:
        main(Path(sys.argv[1]))
    else:
        with tempfile.TemporaryDirectory() as own:
            main(Path(own))
