"""Recordings that are odd in a way of their own: read as they are meant, or refused by their true cause."""

from __future__ import annotations

import re

import numpy as np
import pytest

from testbed.errors import ScenarioError
from testbed.judging.allan_records import read
from testbed.logs.formats import open_table
from testbed.logs.inspection import inspect
from testbed.logs.proposal import propose
from testbed.logs.selection import Selection, TextOptions
from tests.logs.kinds import DEG, ISO, N_TIME, RATE, SECONDS, TIME_US, lines
from tests.shell import call


def pandas_table(path):
    import h5py

    rows = np.zeros(N_TIME, dtype=[("index", "i8"), ("values_block_0", "f8", (2,))])
    rows["values_block_0"] = np.stack([RATE, -RATE], axis=1)
    with h5py.File(path, "w") as file:
        file["df/table"] = rows
    return {"column": ["df/table/values_block_0[0]"], "unit": "deg/s", "rate": "1000"}


def parquet(path, **columns):
    import pyarrow as pa
    from pyarrow import parquet as pq

    pq.write_table(pa.table({"t_us": TIME_US, **columns}), path)


def structures(path):
    parquet(path, gyro=[{"x": w, "y": 0.0} for w in RATE])
    return {"column": ["gyro.x"], "unit": "deg/s"}


def lists_of_one_length(path):
    import pyarrow as pa

    parquet(path, gyro=pa.array([[w, 0.0, 0.0] for w in RATE], pa.list_(pa.float64(), 3)))
    return {"column": ["gyro[0]"], "unit": "deg/s"}


def decimals(path):
    import pyarrow as pa

    parquet(path, w_dps=pa.array(RATE).cast(pa.decimal128(12, 6), safe=False))
    return {}


def durations(path):
    import pyarrow as pa
    from pyarrow import parquet as pq

    pq.write_table(pa.table({"t": pa.array(TIME_US, pa.duration("us")), "w_dps": RATE}), path)
    return {}


def matlab_4(path):
    from scipy.io import savemat

    savemat(path, {"t": SECONDS_OF, "rate": RATE}, format="4", appendmat=False)
    return {"column": ["rate"], "unit": "deg/s"}


def arrays_of_other_lengths(path):
    with path.open("wb") as stream:
        np.savez(stream, t_us=TIME_US, w_dps=RATE, T=RATE[:9], empty=RATE[:0])
    return {}


SECONDS_OF = TIME_US / 1e6
WRITERS = (
    pandas_table, structures, lists_of_one_length, decimals, durations, matlab_4, arrays_of_other_lengths,
)  # fmt: skip


@pytest.mark.parametrize("write", WRITERS, ids=lambda write: write.__name__)
def test_arrays_within_arrays_are_read(tmp_path, write):
    path = tmp_path / "log"
    said = write(path)
    (record,) = read(path, Selection(**said))
    np.testing.assert_allclose(record.rate, np.deg2rad(RATE), rtol=1e-12, atol=1e-8 if write is decimals else 0.0)
    assert record.sample_rate_hz == pytest.approx(1000.0)
    assert inspect(propose(open_table(path)).plans)


PLAIN = lines(SECONDS, DEG, head="t_s,w_dps\n")
NUMBERS = [f'"{k}"' for k in range(1, N_TIME + 1)]
ODD = {
    "names of R, which leave out the first": (lines(NUMBERS, SECONDS, DEG, head='"t" "w_dps"\n', separator=" "), {}),
    "utf-32": (PLAIN.encode("utf-32"), {}),
    "no time, but a column of dates": (lines(ISO, DEG), {"unit": "deg/s"}),
    "date and time in two columns": (
        lines([t[:10] for t in ISO], [t[11:] for t in ISO], DEG, head="date,time,w_dps\n"), {}),
    "end of a file of DOS": (PLAIN + "\x1a", {"text": {"drop_faulty": True}}),
    "power lost": (PLAIN.encode() + bytes(5000), {"text": {"drop_faulty": True}}),
    "stamps that are no use beside a rate": (PLAIN.replace("\n1.000,", "\nnan,"), {"rate": "1000"}),
    "names that act on a terminal": (lines(SECONDS, DEG, head="t_s\x1b[2J,w\x07 [deg/s]\n"), {"time": "1"}),
    "hundreds of empty columns": (PLAIN.replace("\n", "," * 200 + "\n"), {}),
    "24-bit counter": (
        lines([str((16_700_000 + 26 * k) % (1 << 24)) for k in range(N_TIME)], DEG, head="ticks,w_dps\n"),
        {"time": "ticks", "time_unit": "38.4615384615 us"}),
    "16-bit counter": (
        lines([str((60_000 + 1000 * k) % (1 << 16)) for k in range(N_TIME)], DEG, head="t_us,w_dps\n"), {}),
}  # fmt: skip


@pytest.mark.parametrize("kind", ODD)
def test_odd_texts_give_their_samples(tmp_path, kind):
    content, said = ODD[kind]
    path = tmp_path / "log.csv"
    path.write_bytes(content if isinstance(content, bytes) else content.encode())
    chosen = {key: value for key, value in said.items() if key != "text"}
    (record,) = read(path, Selection(**chosen), TextOptions(**said.get("text", {})))
    np.testing.assert_allclose(record.rate, np.deg2rad(RATE), rtol=0, atol=1e-9)
    assert record.sample_rate_hz == pytest.approx(1000.0, rel=1e-6)


@pytest.mark.parametrize(
    ("content", "cause"),
    [
        ("t_s,w_dps\n" + "5,1\n5,2\n" * 20, "the stamps stand still: --rate (the true one)"),
        (lines(SECONDS[::-1], DEG, head="t_s,w_dps\n"), "3999 stamps go back"),
        (PLAIN.replace("\n1.000,", '\n1.000,"'), ":1002: expected quotes in pairs"),
        ("".join(f"# {k}{'x' * 100}\n" for k in range(11_000)) + PLAIN, "no line in the first 1 MB but comments"),
        (PLAIN.encode() + bytes(5000), "or --drop-faulty"),
        (PLAIN.replace("\n1.000,", "\n,"), "expected a time in 't_s', got none"),
    ],
)
def test_what_cannot_be_read_is_refused_by_its_true_cause(tmp_path, content, cause):
    path = tmp_path / "log.csv"
    path.write_bytes(content if isinstance(content, bytes) else content.encode())
    with pytest.raises(ScenarioError, match=re.escape(cause)):
        read(path)


def test_a_name_neither_acts_on_the_terminal_nor_is_missing_in_a_font(tmp_path):
    path = tmp_path / "log.csv"
    path.write_text(lines(SECONDS, DEG, DEG, head="t_s,角速度\x1b[2J [deg/s],w [deg/s]\n"))
    for words in (["log", "inspect"], ["allan"], ["psd"]):
        result = call(*words, path, cwd=tmp_path)
        assert result.returncode == 0, result.stderr
        assert "\x1b[2J" not in result.stdout
        assert "Glyph" not in result.stderr
