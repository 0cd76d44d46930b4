"""A log of one's own: look at it, then take its noise and its spectrum, all from Python; docs/logs.md has the words.

Run: python examples/own_log.py [LOG]; without one, a log of known noise with a gap is written and read.
"""

import sys
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np

import testbed
from testbed.judging.allan_analysis import analyse
from testbed.judging.allan_records import as_record
from testbed.judging.density import estimate_density
from testbed.sensors.noise import GyroNoise


def write_log(path: Path, angle_random_walk: float) -> None:
    """Write a log as a data logger may: microseconds, degrees, twenty samples lost."""
    rate = np.degrees(GyroNoise(angle_random_walk=angle_random_walk).sample(20_000, 500.0, 1))
    kept = np.delete(np.arange(rate.size), slice(7000, 7020))
    rows = "".join(f"{2000 * k},{rate[k]:.6f}\n" for k in kept)
    path.write_text(f"t_us,gyro [deg/s]\n{rows}")


def main(path: Path) -> dict[str, float]:
    """Print what the first rate of a log holds; return N [deg/sqrt(h)] with its limits and the rms above 1 Hz."""
    channel = next(c for c in testbed.read_log(path).channels.values() if c.quantity in {"rate", "angle"})
    record = as_record(channel, channel.name)
    found = analyse(record)
    noise, density = found.fit.angle_random_walk, estimate_density(record)
    (band,) = density.bands([1.0, record.sample_rate_hz])
    sheet = {name: 60.0 * np.degrees(getattr(noise, name)) for name in ("value", "lower", "upper")}
    print(record.content)
    print(*record.notes, found.verdict(), sep="\n")
    print(f"N = {sheet['value']:.4f} deg/sqrt(h), 95 % {sheet['lower']:.4f} to {sheet['upper']:.4f}")
    print(f"above 1 Hz {np.degrees(band.rate):.4f} deg/s rms, {1e6 * band.angle:.2f} urad rms")
    return {**sheet, "rms": float(np.degrees(band.rate))}


if __name__ == "__main__":
    if len(sys.argv) > 1:
        main(Path(sys.argv[1]))
    else:
        with TemporaryDirectory() as folder:
            log = Path(folder) / "log.csv"
            write_log(log, angle_random_walk=np.radians(0.15) / 60.0)
            main(log)
