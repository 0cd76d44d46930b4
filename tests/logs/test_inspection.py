"""`testbed log inspect`: what it finds and proposes, and that the map which it writes reads the same samples."""

from __future__ import annotations

import json

import numpy as np
import pytest

from testbed.errors import ScenarioError
from testbed.judging.allan_records import read
from testbed.logs import read_log
from testbed.logs.formats import open_table
from testbed.logs.inspection import inspect
from testbed.logs.proposal import propose
from testbed.logs.selection import Selection
from testbed.logs.values import ValueScan, word_size
from tests.logs.kinds import COUNTS, DEG, N_TIME, RATE, SECONDS, TEXTS, lines
from tests.shell import assert_clear, call


def reports(tmp_path, text):
    path = tmp_path / "log.csv"
    path.write_text(text)
    return inspect(propose(open_table(path)).plans)


def kinds(report):
    return {finding.kind for finding in report.findings}


def test_a_clean_log_has_no_finding_and_its_figures_are_right(tmp_path):
    (report,) = reports(tmp_path, TEXTS["plain"][0])
    assert report.findings == ()
    assert report.values.mean == pytest.approx(RATE.mean(), abs=1e-9)
    assert report.values.std == pytest.approx(RATE.std(), rel=1e-9)
    assert (report.values.low, report.values.high) == (RATE.min(), RATE.max())
    assert report.values.word == pytest.approx(1e-6, rel=1e-3)
    low, high = report.clock.rate_limits_hz
    assert low <= 1000.0 <= high


def test_each_fault_is_found(tmp_path):
    gap = lines(SECONDS[:500] + SECONDS[520:], DEG[:500] + DEG[520:], head="t,w [deg/s]\n")
    (report,) = reports(tmp_path, gap)
    assert kinds(report) == {"gaps"}
    assert "20 samples lost in 1 gaps (at 0.499 s (line 502))" in report.findings[0].message
    clipped = [f"{value:.6f}" for value in np.clip(RATE, -0.3, 0.3)]
    assert kinds(reports(tmp_path, lines(SECONDS, clipped, head="t,w [deg/s]\n"))[0]) == {"saturation"}
    held = [DEG[k // 4 * 4] for k in range(N_TIME)]
    (report,) = reports(tmp_path, lines(SECONDS, held, head="t,w [deg/s]\n"))
    assert kinds(report) == {"repeats"}
    assert report.values.repeats == pytest.approx(4.0, rel=0.01)
    coarse = [f"{value:.0f}" for value in np.rint(RATE)]
    assert kinds(reports(tmp_path, lines(SECONDS, coarse, head="t,w [deg/s]\n"))[0]) == {"rounding"}
    stuck = [*DEG[:500], *[DEG[500]] * (N_TIME - 1000), *DEG[-500:]]
    (report,) = reports(tmp_path, lines(SECONDS, stuck, head="t,w [deg/s]\n"))
    assert kinds(report) == {"repeats"}
    assert f"stands still for up to {N_TIME - 1000} samples in a row" in report.findings[0].message
    # Two words, to and fro, are the ends of the noise and not of the range.
    between = np.random.default_rng(4).random(N_TIME) < 0.15
    two = [f"{0.07 * one:.2f}" for one in between]
    assert kinds(reports(tmp_path, lines(SECONDS, two, head="t,w [deg/s]\n"))[0]) == {"rounding"}
    empty = [text if k % 100 else "" for k, text in enumerate(DEG)]
    assert kinds(reports(tmp_path, lines(SECONDS, empty, head="t,w [deg/s]\n"))[0]) == {"missing"}
    twice = [*SECONDS[:700], *SECONDS[699:-1]]
    assert "doubled" in kinds(reports(tmp_path, lines(twice, DEG, head="t,w [deg/s]\n"))[0])
    back = [*SECONDS[:700], *SECONDS[600:-100]]
    assert "backward" in kinds(reports(tmp_path, lines(back, DEG, head="t,w [deg/s]\n"))[0])


def test_what_stands_still_as_it_should_has_no_finding(tmp_path):
    """A thermometer in words of 0.1 degC, a flag, a counter, a channel that is held at a slower rate."""
    k = np.arange(N_TIME)
    heat = [f"{25.0 + round(k_ / 900) * 0.1:.1f}" for k_ in k]
    held = [f"{np.sin(k_ // 50):.6f}" for k_ in k]
    flag, count = list(map(str, k // 1500 % 2)), list(map(str, k))
    text = lines(SECONDS, DEG, heat, flag, count, held, head="t,w [deg/s],T [degC],armed,loop,pressure\n")
    for report in reports(tmp_path, text):
        assert report.findings == (), report.plan.name


@pytest.mark.property
def test_blocks_give_the_same_values_as_the_whole():
    rng = np.random.default_rng(3)
    values = np.where(rng.random(5000) < 0.01, np.nan, np.rint(10.0 * rng.standard_normal(5000)))
    whole, parts = ValueScan(), ValueScan()
    whole.add(values)
    for part in np.array_split(values, 17):
        parts.add(part)
    one, other = whole.result(), parts.result()
    for name in ("n_time", "n_missing", "low", "high", "word", "equal", "at_low", "at_high", "row_equal"):
        assert getattr(one, name) == pytest.approx(getattr(other, name)), name
    for name in ("mean", "std", "step_std"):
        assert getattr(one, name) == pytest.approx(getattr(other, name), rel=1e-12), name


@pytest.mark.parametrize(
    ("values", "word"),
    [(0.07 * COUNTS, 0.07), (1e-6 * COUNTS + 3.0, 1e-6), (np.sqrt(np.arange(1000.0)), 0.0), (np.zeros(9), 0.0)],
)
def test_the_word_is_found_where_there_is_one(values, word):
    assert word_size(values) == pytest.approx(word, rel=1e-6, abs=0)


@pytest.mark.parametrize(
    "kind", ["header behind a mark, epoch ns", "cp1252", "iso time", "units in a line", "preamble"]
)
def test_the_map_that_is_written_reads_the_same_samples(tmp_path, kind):
    text, encoding, options = TEXTS[kind]
    path = tmp_path / "log.csv"
    path.write_bytes(text.encode(encoding))
    out = tmp_path / "maps" / "log.yaml"
    result = call("log", "inspect", path, "--out", out, cwd=tmp_path)
    assert result.returncode == 0, result.stderr
    asked = {key: value for key, value in options.items() if key != "column"}
    direct = read(path, Selection(**asked))
    mapped = read(path, Selection(map=out))
    assert len(direct) == len(mapped)
    for one, other in zip(direct, mapped, strict=True):
        assert np.array_equal(one.rate, other.rate)
        assert one.sample_rate_hz == other.sample_rate_hz


def test_json_names_what_is_open_and_what_was_found(tmp_path):
    path = tmp_path / "log.csv"
    path.write_text(lines(SECONDS[:500] + SECONDS[520:], DEG[:500] + DEG[520:], head="t,w\n"))
    found = json.loads(call("log", "inspect", path, "--json", cwd=tmp_path).stdout)
    (channel,) = found["channels"]
    assert channel["time"]["samples_lost"] == 20
    assert channel["time"]["gaps"]["first"][0]["seconds"] == pytest.approx(0.499)
    assert [finding["kind"] for finding in channel["findings"]] == ["gaps"]
    assert found["open"] == ["w: unit (--unit, or --scale of a count)"]


MAP = """\
file: log.csv
channels:
  gyro: {column: "w [deg/s]", sign: -1, time: {column: t, unit: s, offset: 1 ms, epoch: '2024-01-01'}, range: 500 deg/s}
  raw: {column: counts, scale: 0.002 deg/s, time: {rate: 1 kHz}}
"""


def test_a_map_scales_turns_and_shifts(tmp_path):
    (tmp_path / "log.csv").write_text(lines(SECONDS, DEG, list(map(str, COUNTS)), head="t,w [deg/s],counts\n"))
    (tmp_path / "map.yaml").write_text(MAP)
    log = read_log(tmp_path / "log.csv", map=tmp_path / "map.yaml")
    gyro, raw = log.channels["gyro"], log.channels["raw"]
    np.testing.assert_allclose(gyro.values, -np.deg2rad(RATE), atol=1e-12)
    assert gyro.stamps_ns[0] == np.datetime64("2024-01-01T00:00:00.001", "ns").astype(np.int64)
    np.testing.assert_allclose(raw.values, np.deg2rad(0.002 * COUNTS), rtol=1e-12)
    assert raw.rate_hz == 1000.0


@pytest.mark.parametrize(
    ("old", "new", "line", "message"),
    [
        ("column: counts", "colum: counts", 4, "unknown key; did you mean 'column'?"),
        ("sign: -1", "sign: 2", 3, "sign"),
        ("scale: 0.002 deg/s", "scale: '0.002'", 4, "the unit is missing"),
        ("range: 500 deg/s", "range: far", 3, "expected a number and a unit"),
        ("{rate: 1 kHz}", "{rate: 1 kHz, column: t}", 4, "either column or rate"),
        ("unit: s", "unit: V", 3, "expected a quantity in s"),
    ],
)
def test_a_wrong_map_is_refused_with_its_line(tmp_path, old, new, line, message):
    (tmp_path / "log.csv").write_text(lines(SECONDS, DEG, list(map(str, COUNTS)), head="t,w [deg/s],counts\n"))
    (tmp_path / "map.yaml").write_text(MAP.replace(old, new))
    with pytest.raises(ScenarioError, match=message) as caught:
        read_log(tmp_path / "log.csv", map=tmp_path / "map.yaml")
    assert caught.value.problems[0].line == line


def test_a_map_says_the_range_and_inspection_heeds_it(tmp_path):
    path = tmp_path / "log.csv"
    path.write_text(lines(SECONDS, DEG, list(map(str, COUNTS)), head="t,w [deg/s],counts\n"))
    (tmp_path / "map.yaml").write_text(MAP.replace("500 deg/s", f"{abs(RATE).max():.6f} deg/s"))
    found = json.loads(call("log", "inspect", path, "--map", "map.yaml", "--json", cwd=tmp_path).stdout)
    assert [finding["kind"] for finding in found["channels"][0]["findings"]] == ["saturation"]


def test_a_map_names_consecutive_files_and_may_stand_for_them(tmp_path):
    half = N_TIME // 2
    for name, part in (("a", slice(half)), ("b", slice(half, None))):
        (tmp_path / f"{name}.csv").write_text(lines(SECONDS[part], DEG[part], head="t,w [deg/s]\n"))
    said = "channels: {gyro: {column: 2, time: {column: t}}}\n"
    (tmp_path / "log.yaml").write_text("file: [a.csv, b.csv]\n" + said)
    log = read_log(tmp_path / "log.yaml")
    np.testing.assert_allclose(log.channels["gyro"].values, np.deg2rad(RATE), atol=1e-12)
    assert log.channels["gyro"].clock.even
    assert np.array_equal(read(tmp_path / "log.yaml")[0].rate, log.channels["gyro"].values)
    (tmp_path / "b.csv").write_text(lines(SECONDS, DEG, head="t,v [deg/s]\n"))
    with pytest.raises(ScenarioError, match="expected the columns of"):
        read_log(tmp_path / "log.yaml")
    (tmp_path / "log.yaml").write_text(said)
    with pytest.raises(ScenarioError, match="expected the file of the recording"):
        read_log(tmp_path / "log.yaml")


def test_one_column_may_be_two_channels(tmp_path):
    path = tmp_path / "log.csv"
    path.write_text(TEXTS["plain"][0])
    time = {"column": "t"}
    said = {"a": {"column": "2", "unit": "deg/s", "time": time}, "b": {"column": "2", "unit": "rad/s", "time": time}}
    log = read_log(path, map={"channels": said})
    np.testing.assert_allclose(log.channels["a"].values, np.deg2rad(RATE), rtol=1e-12)
    np.testing.assert_array_equal(log.channels["b"].values, RATE)


def test_inspect_of_what_is_no_recording_ends_with_2(tmp_path):
    assert_clear(call("log", "inspect", tmp_path / "none.csv", cwd=tmp_path), 2)
