"""Records from text files: every layout that a logger writes, every fault with its line."""

from __future__ import annotations

import math

import numpy as np
import pytest

from testbed.errors import ScenarioError
from testbed.judging.allan_records import read
from testbed.logs.selection import Selection

VALUES = np.array([0.5, -1.25, 2.0, 1e-3, -4.0])


def write(tmp_path, text, name="log.csv"):
    path = tmp_path / name
    path.write_text(text, encoding="utf-8")
    return path


def read_file(path, *, column=None, sample_rate_hz=None, sensor=None, **options):
    rate = None if sample_rate_hz is None else str(sample_rate_hz)
    options = {"rate": rate, **options}
    return read(path, Selection(column=[column] if column else None, **options), sensor=sensor)[0]


@pytest.mark.parametrize(
    "layout",
    [
        "t,rate\n0.0,{0}\n0.1,{1}\n0.2,{2}\n0.3,{3}\n0.4,{4}\n",
        "# gyro 7\n\nt;rate;note\n0.0;{0};a\n0.1;{1};b\n0.2;{2};c\n\n0.3;{3};d\n0.4;{4};e\n",
        "\ufefft\trate\n0.0\t{0}\n0.1\t{1}\n0.2\t{2}\n0.3\t{3}\n0.4\t{4}",
        't,"rate"\r\n0.0,"{0}"\r\n0.1,{1}\r\n0.2,{2}\r\n0.3,{3}\r\n0.4,{4}\r\n',
    ],
    ids=["commas", "semicolons, comments, text column", "byte order mark, tabs", "quotes, carriage returns"],
)
def test_named_column_with_time(tmp_path, layout):
    record = read_file(write(tmp_path, layout.format(*VALUES)), unit="deg/s", column="rate", time="t")
    np.testing.assert_allclose(record.rate, np.deg2rad(VALUES), rtol=4e-16, atol=0)
    # Five times in decimal: the mean step is as good as the last of them.
    assert record.sample_rate_hz == pytest.approx(10.0, rel=1e-15)
    assert record.name == "log"


def test_plain_column_needs_no_name(tmp_path):
    path = write(tmp_path, "".join(f"  {value}\n" for value in VALUES))
    record = read_file(path, unit="mrad/s", sample_rate_hz=100.0)
    np.testing.assert_allclose(record.rate, VALUES * 1e-3, rtol=4e-16, atol=0)
    assert record.sample_rate_hz == 100.0


def test_column_by_number_and_time_in_its_unit(tmp_path):
    path = write(tmp_path, "".join(f"{10 * i} 7 {value}\n" for i, value in enumerate(VALUES)))
    record = read_file(path, unit="rad/s", column="3", time="1", time_unit="ms")
    assert np.array_equal(record.rate, VALUES)
    assert record.sample_rate_hz == pytest.approx(100.0, rel=1e-14)


def test_the_only_column_beside_the_time_is_taken(tmp_path):
    path = write(tmp_path, "x,t\n" + "".join(f"{value},{i}\n" for i, value in enumerate(VALUES)))
    assert np.array_equal(read_file(path, unit="rad/s", time="t").rate, VALUES)


def test_rounded_times_are_even(tmp_path):
    rng = np.random.default_rng(1)
    t = np.round(np.arange(1000) / 3000.0, 5)
    path = write(tmp_path, "".join(f"{a:.5f},{b}\n" for a, b in zip(t, rng.standard_normal(1000), strict=True)))
    # Stamps to 1e-5 s on a step of 3.3e-4 s: the mean step is good to 1e-5 s over the record's length.
    rate = read_file(path, unit="rad/s", column="2", time="1").sample_rate_hz
    assert rate == pytest.approx(3000.0, rel=1e-5 / 0.333)


@pytest.mark.parametrize(
    ("text", "options", "message"),
    [
        ("", {"rate": "1"}, "log.csv: expected a recording, got an empty file"),
        ("rate\n", {"rate": "1"}, "expected a column of numbers, got 'rate'"),
        ("1\n2\n3\n", {"rate": "1"}, "expected at least 4 samples, got 3"),
        ("rate\n1\n2\nx\n4\n", {"rate": "1"}, "log.csv:4: expected a finite number in 'rate', got 'x'"),
        ("1\n2\n-inf\n4\n", {"rate": "1"}, "log.csv:3: expected a finite number in column 1, got -inf"),
        ("a,b\n1,2\n3\n4,5\n6,7\n", {"rate": "1", "column": "b"}, "log.csv:3: expected 2 fields"),
        ("a,b\n1.5,2\n", {"rate": "1"}, "--column: expected one of 'a', 'b'"),
        ("1 2\n1 2\n", {"rate": "1"}, "--column: expected one of column 1, column 2"),
        ("a,b\n1,2\n", {"rate": "1", "column": "c"}, "--column: no column 'c'; the header has 'a', 'b'"),
        ("1 2\n1 2\n", {"rate": "1", "column": "3"}, "--column: no column '3'; there are 2"),
        ("a,b\n1,2\n", {"time": "t", "column": "b"}, "--time: no column 't'"),
        ("1\n2\n3\n4\n", {}, "expected either the sample rate"),
        (
            "t,r\n1,1\n2,2\n3,3\n4,4\n",
            {"rate": "2", "time": "t"},
            "--rate: the nominal rate 2 Hz contradicts the stamps",
        ),
        ("1\n2\n3\n4\n", {"rate": "0"}, "--rate: expected more than 0 Hz"),
        ("1\n2\n3\n4\n", {"rate": "inf"}, "--rate: expected more than 0 Hz"),
        ("1\n2\n3\n4\n", {"rate": "10 s"}, "--rate: expected a quantity in Hz"),
        ("1\n2\n3\n4\n", {"rate": "1", "unit": "deg"}, "--kind: deg of column 1 is a unit of angle"),
        ("1\n2\n3\n4\n", {"rate": "1", "unit": "m"}, "--unit: 'm' is no unit of a channel"),
        ("1\n2\n3\n4\n", {"rate": "1", "unit": None}, "--unit: expected the unit of column 1"),
        ("1,1\n2,2\n", {"time": "1", "time_unit": "V"}, "--time-unit: expected a quantity in s"),
        ("1\n2\n3\n4\n", {"rate": "1", "sensor": "gyro"}, "--sensor: expected a run folder"),
        ("3,1\n2,1\n1,1\n0,1\n", {"time": "1"}, "--time: 3 stamps go back"),
        (
            "0,1\n1,1\n1.4,1\n2,1\n3,1\n4,1\n",
            {"time": "1"},
            "log.csv:3: --time: 1 steps are uneven; first 1 s from the start",
        ),
        (
            "0,1\n1,1\n1,1\n2,1\n3,1\n" + "".join(f"{k},1\n" for k in range(4, 40)),
            {"time": "1"},
            "log.csv:3: --time: 1 stamps stand",
        ),
    ],
)
def test_faults_are_named_with_their_place(tmp_path, text, options, message):
    with pytest.raises(ScenarioError) as error:
        read_file(write(tmp_path, text), **{"unit": "rad/s", **options})
    assert message in str(error.value)


def test_lost_samples_are_named_by_line_and_seconds_and_stand_as_nan(tmp_path):
    record = read_file(write(tmp_path, "0,1\n1,1\n2,1\n\n4,nan\n5,1\n6,2\n"), time="1", unit="rad/s")
    assert np.flatnonzero(np.isnan(record.rate)).tolist() == [3, 4]
    assert "1 samples lost in 1 gaps (at 2 s (line 5))" in " ".join(record.notes)


def test_what_is_no_text_is_refused(tmp_path):
    path = tmp_path / "log.csv"
    path.write_bytes(bytes(range(256)))
    with pytest.raises(ScenarioError, match="cannot be read"):
        read_file(path, unit="rad/s", rate="1")
    with pytest.raises(ScenarioError, match="expected a recording or a run folder"):
        read_file(tmp_path / "nothing.csv", unit="rad/s", rate="1")


def test_rate_takes_its_unit(tmp_path):
    path = write(tmp_path, "1\n2\n3\n4\n")
    assert read_file(path, unit="rad/s", rate="2 kHz").sample_rate_hz == 2000.0
    assert math.isclose(read_file(path, unit="rad/s", rate="2.5e2").sample_rate_hz, 250.0)
