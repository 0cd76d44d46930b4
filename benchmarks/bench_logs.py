"""Speed and memory of reading recordings: CPU seconds, and the largest resident size of the process.

Promised: 6e6 samples of a binary format in 1.2 CPU s, 8e6 rows of text in 2.6. Run: python benchmarks/bench_logs.py;
`--long` adds a text of 1 GB: inspected, and the Allan deviation and density of means of 100 samples.
"""

from __future__ import annotations

import argparse
import os
import resource
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import numpy as np
from promises import Promise, conclude

N_BINARY, N_TEXT, FS = 6_000_000, 8_000_000, 1000.0


def rates(n: int) -> np.ndarray:
    return np.random.default_rng(1).standard_normal(n)


def npy(path: Path) -> None:
    with path.open("wb") as stream:
        np.save(stream, np.stack([np.arange(N_BINARY) / FS, rates(N_BINARY)], axis=1))


def parquet(path: Path) -> None:
    import pyarrow as pa
    from pyarrow import parquet as pq

    pq.write_table(pa.table({"t [s]": np.arange(N_BINARY) / FS, "w [deg/s]": rates(N_BINARY)}), path)


def hdf5(path: Path) -> None:
    import h5py

    with h5py.File(path, "w") as file:
        file["t_s"] = np.arange(N_BINARY) / FS
        file["w_dps"] = rates(N_BINARY)


def mdf(path: Path) -> None:
    import asammdf

    file = asammdf.MDF(version="4.10")
    file.append([asammdf.Signal(rates(N_BINARY), np.arange(N_BINARY) / FS, name="w", unit="deg/s")])
    file.save(path.with_suffix(".mf4"), overwrite=True)
    path.with_suffix(".mf4").rename(path)


def tdms(path: Path) -> None:
    import nptdms

    said = {"wf_increment": 1.0 / FS, "unit_string": "deg/s"}
    with nptdms.TdmsWriter(str(path)) as file:
        file.write_segment([nptdms.ChannelObject("bench", "w", rates(N_BINARY), properties=said)])


def text(path: Path, n: int = N_TEXT) -> None:
    block = 1_000_000
    with path.open("w") as stream:
        stream.write("t_us,w [deg/s]\n")
        for start in range(0, n, block):
            values = rates(block)
            stream.write("".join(f"{(start + k) * 1000},{v:.5f}\n" for k, v in enumerate(values.tolist())))


READ = """
import resource, sys, time
from testbed.logs.choice import select
from testbed.logs.selection import Selection
from pathlib import Path
import pyarrow.csv, h5py
begin = time.process_time()
(channel,) = select(Path(sys.argv[1]), Selection(**eval(sys.argv[2])))
print(channel.values.size, time.process_time() - begin, resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024)
"""


def measure(name: str, write, **said: object) -> float:
    """Print what reading a file takes, and return the CPU seconds."""
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "log"
        write(path)
        size = path.stat().st_size / 1e6
        words = [sys.executable, "-c", READ, str(path), repr(said)]
        done = subprocess.run(words, capture_output=True, text=True, check=True)
        n, seconds, peak = done.stdout.split()
        print(
            f"{name:10s} {int(n):>9d} samples {size:7.1f} MB {float(seconds):6.2f} CPU s {float(peak):7.0f} MB resident"
        )
    return float(seconds)


def long_text() -> bool:
    """Inspect a text of 1 GB, and take its Allan deviation and density; return whether memory stayed below 500 MB."""
    small = True
    commands = (["log", "inspect"], ["allan"], ["psd"])
    with tempfile.TemporaryDirectory() as folder:
        for n in (5_000_000, 55_000_000):
            path = Path(folder) / "log.csv"
            text(path, n)
            for command in commands:
                spent, peak, wall, status = run([*command, str(path)], folder)
                size = path.stat().st_size / 1e6
                words = f"{spent:.1f} CPU s, {wall:.1f} s, {peak:.0f} MB resident"
                print(f"{' '.join(command)}, {size:.0f} MB: status {status}, {words}", flush=True)
                small = small and (size < 1000.0 or (peak < 500.0 and status == 0))
    return small


def run(words: list[str], folder: str) -> tuple[float, float, float, int]:
    """Run a command; return CPU seconds, peak size [MB], seconds and status."""
    begin = time.monotonic()
    script = f"import os, sys; os.chdir({folder!r}); from testbed.cli import main; sys.argv[0] = 'testbed'; main()"
    with Path(folder, "words.txt").open("wb") as stream:
        actions = [(os.POSIX_SPAWN_DUP2, stream.fileno(), 1)]
        arguments = [sys.executable, "-c", script, *words]
        child = os.posix_spawn(sys.executable, arguments, os.environ, file_actions=actions)
        _, status, usage = os.wait4(child, 0)
    spent = usage.ru_utime + usage.ru_stime
    return spent, usage.ru_maxrss / 1024, time.monotonic() - begin, os.waitstatus_to_exitcode(status)


def main() -> None:
    parser = argparse.ArgumentParser()
    parser.add_argument("--long", action="store_true", help="also a text of 1 GB")
    wanted = parser.parse_args()
    # First: what `wait` reports of a child begins with the size of this process.
    if wanted.long and not long_text():
        sys.exit("a text of 1 GB needs more than 500 MB")
    binary = {
        "npy": measure("npy", npy, column=["column 2"], unit="deg/s", time="column 1"),
        "parquet": measure("parquet", parquet),
        "hdf5": measure("hdf5", hdf5),
        "mdf4": measure("mdf4", mdf, column=["w"]),
        "tdms": measure("tdms", tdms),
    }
    slowest = max(binary, key=binary.__getitem__)
    rows = measure("text", text)
    print(f"this process: {resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024:.0f} MB")
    conclude(
        Promise(f"logs: 6e6 samples of the slowest binary format, {slowest} [CPU s]", 1.2, binary[slowest]),
        Promise("logs: 8e6 rows of text [CPU s]", 2.6, rows),
    )


if __name__ == "__main__":
    main()
