"""Files that are damaged, or made to do harm: one error with the place and the remedy, within 5 s and 1 GB."""

from __future__ import annotations

import os
import sys
import zipfile
import zlib
from pathlib import Path

import numpy as np
import pytest

from testbed.errors import ScenarioError
from testbed.logs import read_log

SECONDS, BYTES = 5.0, 1 << 30


def many_columns(path):
    path.write_text(",".join(map(str, range(1_000_000))) + "\n" + ",".join(["1"] * 1_000_000) + "\n")


def many_short_columns(path):
    path.write_text(",".join("x" * 100_000) + "\n" + ",".join("1" * 100_000) + "\n" + ",".join("2" * 100_000) + "\n")


def nul_bytes(path):
    path.write_bytes(b"t,w\n" + b"0.1,2\n" * 200_000 + b"\0" * 4096 + b"\n" + b"0.1,2\n" * 10)


def binary_in_text_clothes(path):
    path.write_bytes(np.random.default_rng(1).bytes(3_000_000))


def letters_without_lines(path):
    path.write_bytes(b"1," * 30_000_000)


def line_without_end(path):
    path.write_bytes(b"t,w\n" + b"0.1,2\n" * 300_000 + b"7" * 100_000_000)


def mixed_separators(path):
    path.write_text("t,w\n" + "0.1,2\n" * 1000 + "0.2;3\n" * 20 + "0.1,2\n" * 300_000)


def blanks_without_end(path):
    path.write_text("t w\n" + "0.1 2\n" * 100 + " " * 3_000_000 + "\n" + "0.1 2 (\n" * 3)


def brackets_without_end(path):
    path.write_text("t," + "[(" * 200_000 + "\n" + "0.1,2\n" * 100)


def hdf5_bomb(path):
    import h5py

    with h5py.File(path, "w") as file:
        file.create_dataset("w", shape=(10**11,), chunks=(1 << 20,), dtype="f8", compression="gzip")


def hdf5_of_zeros(path):
    import h5py

    with h5py.File(path, "w") as file:
        data = file.create_dataset("w", shape=(10**8,), chunks=(10**7,), dtype="f8", compression="gzip")
        for k in range(10):
            data[k * 10**7 : (k + 1) * 10**7] = 0.0


def hdf5_of_many(path):
    import h5py

    with h5py.File(path, "w", libver="latest") as file:
        for k in range(12_000):
            file[f"w{k}"] = np.zeros(2)


def parquet_bomb(path):
    import pyarrow as pa
    from pyarrow import parquet

    table = pa.table({"w": np.zeros(10**7)})
    with parquet.ParquetWriter(path, table.schema, compression="zstd") as writer:
        for _ in range(12):
            writer.write_table(table, row_group_size=10**7)


def npz_bomb(path):
    head = (
        b"\x93NUMPY\x01\x00v\x00"
        + b"{'descr': '<f8', 'fortran_order': False, 'shape': (125000000,), }".ljust(117)
        + b"\n"
    )
    with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as archive, archive.open("w.npy", "w") as member:
        member.write(head)
        for _ in range(100):
            member.write(bytes(10**7))


def mat_bomb(path):
    """Return a compressed MAT 5 element that claims and holds 800 MB of zeros."""
    n = 10**8
    head = (
        np.array([6, 8, 6, 0, 5, 8, n, 1, 1, 1], "<u4").tobytes()
        + b"w"
        + bytes(7)
        + np.array([9, 8 * n], "<u4").tobytes()
    )
    press = zlib.compressobj(1)
    body = press.compress(np.array([14, len(head) + 8 * n], "<u4").tobytes() + head)
    body += b"".join(press.compress(bytes(8 * 10**6)) for _ in range(100)) + press.flush()
    mark = b"MATLAB 5.0 MAT-file".ljust(124) + b"\x00\x01IM"
    path.write_bytes(mark + np.array([15, len(body)], "<u4").tobytes() + body)


# Writer, and what the message says.
HOSTILE = [
    (many_columns, "is it a text, with one sample a row?"),
    (many_short_columns, "at most 10000 columns, got 100000"),
    (nul_bytes, "a NUL byte"),
    (binary_in_text_clothes, "a NUL byte"),
    (letters_without_lines, "is it a text"),
    (line_without_end, "is it a text"),
    (mixed_separators, ":1002: expected 2 fields"),
    (blanks_without_end, "expected 2 fields"),
    (brackets_without_end, ""),
    (hdf5_bomb, "claims 800 GB of data"),
    (hdf5_of_zeros, "claims 0.8 GB of data"),
    (hdf5_of_many, "at most 10000 columns"),
    (parquet_bomb, "claims 0.96 GB of data"),
    (npz_bomb, "claims 1 GB of data"),
    (mat_bomb, "claims 0.8 GB of data"),
]


# The largest size of the process itself: what `wait` reports begins with that of the process which started it.
PEAK = """
import atexit, pathlib, re, sys
status = pathlib.Path("/proc/self/status")
peak = lambda: int(re.search(r"VmHWM:\\s+(\\d+)", status.read_text())[1]) * 1024
atexit.register(lambda: pathlib.Path(sys.argv.pop()).write_text(str(peak())))
from testbed.cli import main
sys.argv, place = sys.argv[:-1], sys.argv[-1]
atexit.register(lambda: sys.argv.append(place))
main()
"""


def run(path, *words):
    """Run the command line, return its status, words, CPU seconds and largest size in bytes."""
    out, size = path.parent / "words.txt", path.parent / "size.txt"
    arguments = [sys.executable, "-c", PEAK, *words, str(path), str(size)]
    with out.open("wb") as stream:
        actions = [(os.POSIX_SPAWN_DUP2, stream.fileno(), 1), (os.POSIX_SPAWN_DUP2, stream.fileno(), 2)]
        child = os.posix_spawn(sys.executable, arguments, os.environ, file_actions=actions)
        _, status, usage = os.wait4(child, 0)
    # CPU time, since the machine may be busy with other tests.
    return os.waitstatus_to_exitcode(status), out.read_text(), usage.ru_utime + usage.ru_stime, int(size.read_text())


@pytest.mark.slow
@pytest.mark.parametrize(("write", "message"), HOSTILE, ids=lambda v: getattr(v, "__name__", ""))
def test_a_hostile_file_is_one_error_within_time_and_memory(tmp_path, write, message):
    path = tmp_path / "log.csv"
    write(path)
    # Whatever reads blocks is tried by the command that keeps none, the rest by the one that keeps all.
    for words in [("allan",)] if write in {hdf5_of_zeros, parquet_bomb, npz_bomb, nul_bytes} else [("log", "inspect")]:
        status, text, seconds, size = run(path, *words)
        if message:
            assert status == 2, text
            assert message in text
        assert text.count("error:") <= 1
        assert "Traceback" not in text
        assert seconds < SECONDS
        assert size < BYTES


def test_a_directory_and_a_missing_file_are_refused(tmp_path):
    for path in (tmp_path, tmp_path / "none.csv"):
        with pytest.raises(ScenarioError, match="expected a recording"):
            read_log(path)


def test_an_empty_file_is_refused_unread(tmp_path):
    """So are those that the kernel makes up, of which some let a reader wait for ever."""
    (tmp_path / "log.csv").touch()
    for path in (tmp_path / "log.csv", Path("/proc/kmsg"), Path("/proc/uptime")):
        if path.exists():
            with pytest.raises(ScenarioError, match="expected a recording, got an empty file"):
                read_log(path)


@pytest.mark.slow
def test_memory_does_not_grow_with_a_text_that_is_inspected(tmp_path):
    """A text of 4 MB and one of 80 MB; `benchmarks/bench_logs.py --long` does it with 1 GB."""
    path = tmp_path / "log.csv"
    rows = b"".join(b"%d,%d.25\n" % (k * 1000, k % 7) for k in range(300_000))
    path.write_bytes(b"t_us,w [deg/s]\n" + rows)
    small = run(path, "log", "inspect")
    path.write_bytes(b"t_us,w [deg/s]\n" + rows * 20)
    large = run(path, "log", "inspect")
    assert (small[0], large[0]) == (0, 0)
    assert large[3] < small[3] + 30 * 2**20


@pytest.mark.parametrize("encoding", ["rot13", "zip", "bz2", "quopri", "hex", "base64", "undefined", "no such", "x\0y"])
def test_what_is_no_encoding_of_a_text_is_refused(tmp_path, encoding):
    path = tmp_path / "log.csv"
    path.write_text("t [us],w [deg/s]\n" + "".join(f"{500 * k},{k % 7}\n" for k in range(100)))
    with pytest.raises(ScenarioError, match="which encoding is it") as caught:
        read_log(path, map={"encoding": encoding, "channels": {"w": {"column": 2, "unit": "deg/s"}}})
    (problem,) = caught.value.problems
    assert len(problem.message) < 200
