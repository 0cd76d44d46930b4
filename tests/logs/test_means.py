"""Means of neighbouring samples are those of the whole record, whatever the blocks; so is the Allan deviation."""

from __future__ import annotations

import json
from types import SimpleNamespace

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest

from testbed.allan import allan_deviation
from testbed.errors import ScenarioError
from testbed.judging.allan_records import read
from testbed.logs import keeping, read_log
from testbed.logs.formats import open_table
from testbed.logs.logmap import ChannelMap, LogMap
from testbed.logs.means import Means, Places
from testbed.logs.reader import read_map
from testbed.logs.selection import Selection
from tests.logs.kinds import ANGLE, DEG, RATE, SECONDS, digits, lines
from tests.shell import call


def log(tmp_path, *columns, head="t,w [deg/s]\n"):
    path = tmp_path / "log.csv"
    path.write_text(lines(*columns, head=head))
    return path


@pytest.mark.property
@pytest.mark.parametrize("parts", [1, 7, 400])
def test_blocks_give_the_means_of_the_whole(parts):
    values = np.random.default_rng(1).standard_normal(4003)
    means, places = Means(10, "rate"), Places()
    found = [means.add(part, places.rows(part.size)) for part in np.array_split(values, parts)]
    np.testing.assert_allclose(np.concatenate(found), values[:4000].reshape(-1, 10).mean(axis=1), rtol=1e-12)


def test_the_allan_deviation_of_means_is_that_of_the_record_where_both_are(tmp_path):
    path = log(tmp_path, SECONDS, DEG)
    (record,) = read(path, Selection(average=8))
    assert record.sample_rate_hz == pytest.approx(125.0)
    tau = 0.008 * np.arange(1, 6)
    means, whole = allan_deviation(record.rate, 125.0, tau), allan_deviation(np.deg2rad(RATE), 1000.0, tau)
    # The same averages, an eighth as many places: within three standard deviations of the estimates.
    assert np.all(np.abs(means.deviation / whole.deviation - 1.0) < 3.0 * np.sqrt(1.0 / (2.0 * means.edf)))


@pytest.mark.parametrize(
    ("column", "head", "said"),
    [
        (digits(RATE / 1000.0 * 3600.0, "{:.12g}"), "t,w [arcsec]\n", {"kind": "increment"}),
        (digits(ANGLE[1:], "{:.14g}"), "t,w [arcsec]\n", {"kind": "angle"}),
    ],
)
def test_means_of_increments_and_angles_are_those_of_the_rate(tmp_path, column, head, said):
    path = log(tmp_path, SECONDS, column, head=head)
    (record,) = read(path, Selection(average=10, **said))
    expected = np.deg2rad(RATE).reshape(-1, 10).mean(axis=1)[:-1]
    got = record.rate[: expected.size] if said["kind"] == "increment" else record.rate
    want = expected if said["kind"] == "increment" else expected[1:]
    np.testing.assert_allclose(got[: want.size], want[: got.size], rtol=0, atol=1e-7)


def test_lost_samples_leave_a_mean_out_where_it_has_fewer_than_four_fifths(tmp_path):
    kept = [k for k in range(4000) if k not in (1000, *range(2000, 2005), *range(3000, 3040))]
    path = log(tmp_path, [SECONDS[k] for k in kept], [DEG[k] for k in kept])
    (record,) = read(path, Selection(average=10))
    assert np.flatnonzero(np.isnan(record.rate)).tolist() == [200, 300, 301, 302, 303]
    rest = np.delete(np.deg2rad(RATE[1000:1010]), 0)
    assert record.rate[100] == pytest.approx(rest.mean(), rel=1e-9)
    assert any("46 samples lost" in note for note in record.notes)


def test_what_memory_should_not_hold_is_refused_with_the_option(tmp_path, monkeypatch):
    path = log(tmp_path, SECONDS, DEG)
    monkeypatch.setattr(keeping, "MOST_KEPT", 5000)
    with pytest.raises(ScenarioError, match="--average 1000 keeps means"):
        read_log(path)
    assert read_log(path, average=100).channels["w"].values.size == 39
    with pytest.raises(ScenarioError, match="from 1 on"):
        read_log(path, average=0)


@pytest.mark.parametrize("kind", ["parquet", "parts", "text"])
def test_a_file_that_says_how_much_it_holds_is_refused_unread(kind, tmp_path, monkeypatch):
    """Of several files all count; of a text its size says it, to half of what the first lines promise."""
    columns = {"w [rad/s]": np.zeros(3000), "t [ns]": np.arange(3000) * 1_000_000}
    paths = [tmp_path / f"{i}.{'csv' if kind == 'text' else 'parquet'}" for i in range(2 if kind == "parts" else 1)]
    for path in paths:
        if kind == "text":
            rows = (f"{w},{t}" for w, t in zip(*columns.values(), strict=True))
            path.write_text("\n".join([",".join(columns), *rows]) + "\n")
        else:
            pq.write_table(pa.table(columns), path)
    monkeypatch.setattr(keeping, "MOST_KEPT", {"parquet": 5999, "parts": 11_999, "text": 2900}[kind])
    monkeypatch.setattr(keeping, "_Columns", lambda *_: SimpleNamespace(add=lambda *_: pytest.fail("it was read")))
    with pytest.raises(ScenarioError, match="--average 1000 keeps means"):
        read_map(None, LogMap(file=paths, channels={"w": ChannelMap(column="w")}))


def test_uneven_stamps_are_refused_with_means_too(tmp_path):
    early = [*SECONDS[:500], "0.5004", *SECONDS[501:]]
    with pytest.raises(ScenarioError, match="steps are uneven"):
        read(log(tmp_path, early, DEG), Selection(average=10))


def test_the_command_says_that_these_are_means(tmp_path):
    path = log(tmp_path, SECONDS, DEG)
    found = json.loads(call("allan", path, "--average", "8", "--json", cwd=tmp_path).stdout)
    assert found["records"][0]["n_time"] == 499
    assert "means of 8 samples of 1000 Hz" in found["records"][0]["remarks"]


def test_a_recording_that_memory_should_not_hold_is_averaged_and_says_so(tmp_path, monkeypatch):
    path = log(tmp_path, SECONDS, DEG)
    (whole,) = read(path, Selection())
    monkeypatch.setattr(keeping, "MOST_WHOLE", 3000)
    monkeypatch.setattr(keeping, "_MEANS", 300)
    (found,) = read(path, Selection())
    # 4000 samples, in at most 300 means of a power of 2: of 16.
    np.testing.assert_array_equal(found.rate, read(path, Selection(average=16))[0].rate)
    assert "means of 16 are kept; --average 1 keeps all" in found.content
    np.testing.assert_array_equal(read(path, Selection(average=1))[0].rate, whole.rate)
    assert read_log(path).channels["w"].values.size == whole.rate.size, "the library averages nothing by itself"


def test_a_slow_sensor_in_the_rows_of_a_quick_one_has_no_means_and_says_so(tmp_path, monkeypatch):
    sparse = [one if k % 10 == 0 else "" for k, one in enumerate(DEG)]
    path = log(tmp_path, SECONDS, sparse)
    assert read(path, Selection())[0].rate.size == 400
    monkeypatch.setattr(keeping, "MOST_WHOLE", 3000)
    monkeypatch.setattr(keeping, "_MEANS", 300)
    with pytest.raises(ScenarioError, match="too few rows for means of 16 samples: --average 1 keeps all"):
        read(path, Selection())
    assert read(path, Selection(average=1))[0].rate.size == 400


@pytest.mark.parametrize("head", ["t,w [deg/s]\n", "t,w [deg/s]\r\n"])
def test_the_number_of_rows_of_a_text_is_told_from_its_beginning(tmp_path, head):
    path = tmp_path / "log.csv"
    n_time, end = 40_000, head.removeprefix("t,w [deg/s]")
    path.write_bytes((head + "".join(f"{k:08d},{k % 7}{end}" for k in range(n_time))).encode())
    assert open_table(path).columns[1].about == pytest.approx(n_time, rel=0.01)


@pytest.mark.parametrize(("average", "message"), [(0, "from 1 on, got 0"), (2000, "at least 4 means of 2000 samples")])
def test_a_number_of_samples_that_leaves_nothing_is_refused(tmp_path, average, message):
    with pytest.raises(ScenarioError, match=message) as caught:
        read(log(tmp_path, SECONDS, DEG), Selection(average=average))
    assert caught.value.problems[0].key == "--average"
    with pytest.raises(ScenarioError, match="expected a file with it"):
        read(tmp_path, Selection(average=10))
