"""Memory of `testbed run` against duration: peak resident set of whole processes.

Promise: a 10 min run needs no more than a 1 min run plus 20 %. Give durations in seconds as arguments; mode `fixed`
unless `servo` is among them.

`replay` measures `testbed replay` instead, which holds its readings: bytes for each further sample of recordings of 10
and 30 min at 2000 and 200 Hz, with even stamps and with stamps that jitter. Promise: at most 150.
"""

from __future__ import annotations

import subprocess
import sys
import tempfile
from pathlib import Path

import h5py
import numpy as np
from promises import Promise, conclude

ROOT = Path(__file__).parents[1]
PROGRAM = (
    "import resource, sys\nfrom testbed.cli import main\n"
    "sys.argv = ['testbed', *sys.argv[1:]]\n"
    "try:\n    main()\nfinally:\n    print(resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024)\n"
)


def peak_mb(duration: float, mode: str) -> float:
    text = (ROOT / "scenarios" / "mixed_0p5hz_10hz.yaml").read_text().split("expect:")[0]
    text = (
        text.replace("duration: 20 s", f"duration: {duration} s")
        .replace("settle: 10 s", "settle: 1 s")
        .replace("{preset: air_bearing}", f"{{mode: {mode}}}")
    )
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "scenario.yaml"
        path.write_text(text)
        return peak_of("run", path, folder)


def peak_of(command: str, source: Path, folder: str, *options: str) -> float:
    """Return the peak resident set of a command that writes a run folder [MB]; a verdict may stand."""
    arguments = [sys.executable, "-c", PROGRAM, command, str(source), "--out", f"{folder}/run", *options]
    done = subprocess.run(arguments, check=False, capture_output=True, text=True)
    if done.returncode > 1:
        sys.exit(done.stderr)
    return float(done.stdout.splitlines()[-1])


def of_replay(duration: float, jitter: float) -> tuple[float, int]:
    """Return the peak of a replay [MB] and how many samples it has, its stamps off by up to `jitter` of a step."""
    rng, channels, n_sample = np.random.default_rng(1), [], 0
    with tempfile.TemporaryDirectory() as folder:
        with h5py.File(Path(folder) / "data.h5", "w") as data:
            for name, fs in (("mhd_ars", 2000.0), ("mems_gyro", 200.0)):
                t = np.arange(round(duration * fs)) / fs
                t[1:] += jitter / fs * rng.uniform(-1.0, 1.0, t.size - 1)
                data[f"{name}/time"] = np.rint(1e9 * t).astype(np.int64)
                data[f"{name}/rate"] = 0.02 * np.sin(8.0 * np.pi * t) + 1e-4 * rng.standard_normal(t.size)
                time = f"{{column: {name}/time, unit: ns}}"
                channels.append(f"  {name}: {{column: {name}/rate, unit: rad/s, time: {time}}}\n")
                n_sample += t.size
        log = Path(folder) / "log.yaml"
        log.write_text("file: data.h5\nchannels:\n" + "".join(channels))
        return peak_of("replay", log, folder, "--filter", "kalman", "--quiet"), n_sample


def replays() -> None:
    promises = []
    for kind, jitter in (("even stamps", 0.0), ("stamps that jitter", 0.1)):
        (less, n), (more, m) = (of_replay(duration, jitter) for duration in (600.0, 1800.0))
        print(f"replay, {kind}: {n} samples {less:.0f} MB, {m} samples {more:.0f} MB")
        promises.append(Promise(f"memory of a replay, {kind} [bytes a sample]", 150.0, (more - less) * 2**20 / (m - n)))
    conclude(*promises)


def main(*arguments: str) -> None:
    if "replay" in arguments:
        replays()
    mode = "servo" if "servo" in arguments else "fixed"
    durations = [float(a) for a in arguments if a != "servo"] or [60.0, 600.0]
    peaks = {duration: peak_mb(duration, mode) for duration in durations}
    for duration, peak in peaks.items():
        print(f"{mode}, {duration:6g} s: peak {peak:7.1f} MB")
    first, last = peaks[durations[0]], peaks[durations[-1]]
    what = f"memory of a run of {durations[-1]:g} s over one of {durations[0]:g} s, mode {mode} [-]"
    conclude(Promise(what, 1.2, last / first))


if __name__ == "__main__":
    main(*sys.argv[1:])
