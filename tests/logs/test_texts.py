"""Text files of every kind give the samples that were written into them, and so the noise that is in them."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from testbed.errors import ScenarioError
from testbed.judging.allan_analysis import analyse
from testbed.judging.allan_records import read
from testbed.logs.readers.text import TextTable
from testbed.logs.selection import Selection, TextOptions
from tests.logs.kinds import COUNTS, DEG, FS, RATE, SECONDS, TEXTS, N, lines


def chosen(options):
    """Return what is said of the columns, and of the text."""
    return Selection(**{key: value for key, value in options.items() if key != "text"}), TextOptions(
        **options.get("text", {})
    )


@pytest.mark.oracle
@pytest.mark.parametrize("kind", TEXTS)
def test_every_kind_of_text_gives_its_samples(tmp_path, kind):
    text, encoding, options = TEXTS[kind]
    path = tmp_path / "log.dat"
    path.write_bytes(text.encode(encoding))
    (record,) = read(path, *chosen(options))
    if kind == "a word that means none":
        assert np.isnan(record.rate[-1])
        record = replace(record, rate=record.rate[:-1])
    expected = np.deg2rad(0.002 * COUNTS if kind in {"counts", "preamble"} else RATE)
    # Angles are differenced, and carry 12 digits of 1e3 arcsec at 1 kHz; all else is read as it was written.
    accuracy = 1e-11 / FS * 1e6 if kind == "angle" else 2e-9
    np.testing.assert_allclose(record.rate, expected, rtol=0, atol=accuracy)
    assert record.sample_rate_hz == pytest.approx(FS, rel=1e-6)
    found = analyse(record).fit.angle_random_walk
    assert found.lower < N < found.upper


def table(tmp_path, text, **options):
    path = tmp_path / "log.csv"
    path.write_bytes(text.encode() if isinstance(text, str) else text)
    return TextTable(path, TextOptions(**options))


def test_the_dialect_is_told(tmp_path):
    text = "Zeit;Rate\ns;deg/s\n" + "".join(f"{k},0;{k},5\n" for k in range(30))
    assert str(table(tmp_path, text).dialect) == (
        "utf-8, semicolons, decimal comma, header in line 1, units in line 2, rows from line 3"
    )


@pytest.mark.parametrize(
    ("text", "key", "message"),
    [
        ("rate\n" + "0,5\n1,7\n" * 20, "--decimal", "give --decimal , or --separator ,"),
        ("0,05\n1,70\n" * 20, "--decimal", "give --decimal , or --separator ,"),
        ("t;w\n" + "0,5;1.5\n" * 20, "--decimal", "with a decimal comma"),
    ],
)
def test_what_can_be_read_in_two_ways_is_refused_with_the_option(tmp_path, text, key, message):
    with pytest.raises(ScenarioError) as caught:
        table(tmp_path, text)
    assert caught.value.problems[0].key == key
    assert message in str(caught.value)


def test_the_option_that_is_named_decides(tmp_path):
    text = "0,05\n1,70\n" * 20
    assert [c.name for c in table(tmp_path, text, separator=",").columns] == ["column 1", "column 2"]
    one = table(tmp_path, text, decimal=",")
    assert next(one.blocks([0]))[0][:2].tolist() == [0.05, 1.7]


def test_a_last_line_that_was_cut_is_left_out_and_told(tmp_path):
    log = table(tmp_path, "t,w\n" + "".join(f"0.{k},1.5\n" for k in range(10, 40)) + "0.4")
    assert sum(block[1].size for block in log.blocks([0, 1])) == 30
    assert "cut short" in log.notes[0]


def test_blocks_join_to_the_whole_and_a_fault_in_a_later_one_has_its_line(tmp_path, monkeypatch):
    rows = lines(SECONDS, DEG, head="t,w\n")
    whole = next(iter(table(tmp_path, rows).blocks([0, 1])))
    monkeypatch.setattr("testbed.logs.readers.text._BLOCK", 1000)
    blocks = list(table(tmp_path, rows).blocks([0, 1]))
    assert len(blocks) > 50
    for i in (0, 1):
        assert np.array_equal(np.concatenate([block[i] for block in blocks]), whole[i])
    broken = rows.splitlines()
    broken[3000] = "3.000;1"
    with pytest.raises(ScenarioError) as caught:
        list(table(tmp_path, "\n".join(broken)).blocks([0, 1]))
    assert caught.value.problems[0].line == 3001


def test_stamps_of_the_epoch_keep_their_nanoseconds(tmp_path):
    log = table(tmp_path, TEXTS["header behind a mark, epoch ns"][0])
    block = next(log.blocks([0, 1], [0]))
    assert block[0].dtype == np.int64
    assert block[0][1] - block[0][0] == 1_000_000


def test_times_that_are_not_understood_are_named_and_a_rate_goes_on(tmp_path):
    path = tmp_path / "log.csv"
    path.write_text(lines([f"05/01/24 12:00:{k:02d}" for k in range(60)], DEG[:60], head="time,w [deg/s]\n"))
    with pytest.raises(ScenarioError, match="not ISO 8601: convert them, or give --rate"):
        read(path)
    assert read(path, Selection(rate="1 Hz"))[0].rate.size == 60


def test_a_rate_in_the_head_that_contradicts_the_stamps_is_told(tmp_path):
    path = tmp_path / "log.csv"
    path.write_text("# fs = 52 Hz\n" + lines(SECONDS, DEG, head="t,w [deg/s]\n"))
    (record,) = read(path)
    assert record.sample_rate_hz == pytest.approx(FS)
    assert any("contradiction: the file says 52 Hz" in note for note in record.notes)
    (record,) = read(path, Selection(rate="500"))
    assert any("contradiction: the nominal rate is 500 Hz" in note for note in record.notes)


def test_lines_that_are_left_out_are_counted_and_the_rest_keeps_its_lines(tmp_path):
    rows = lines(SECONDS, DEG, head="t,w [deg/s]\n").splitlines()
    rows[100], rows[200] = "reset", rows[200] + ",7"
    log = table(tmp_path, "\n".join([*rows, "END"]) + "\n", drop_faulty=True)
    assert sum(block[1].size for block in log.blocks([0, 1], [0])) == 3998
    assert log.notes == ["3 lines that are not like the others were left out, the first 'reset'"]


def test_only_lines_with_a_word_are_read_and_a_fault_keeps_its_line(tmp_path):
    rows = "".join(f"GPS,{k},1,2\nIMU,{k},{w}\n" for k, w in enumerate(DEG[:200]))
    log = table(tmp_path, rows, only="IMU")
    np.testing.assert_allclose(next(log.blocks([2]))[2], RATE[:200])
    assert log.line(5) == 12
    with pytest.raises(ScenarioError) as caught:
        list(table(tmp_path, rows.replace("IMU,150,", "IMU,150,x"), only="IMU").blocks([2]))
    assert caught.value.problems[0].line == 302
    with pytest.raises(ScenarioError, match="no line with the word 'GYR'"):
        table(tmp_path, rows, only="GYR")


def test_a_number_that_means_none_is_missing_however_it_is_written(tmp_path):
    path = tmp_path / "log.csv"
    path.write_text(lines(SECONDS, [*DEG[:500], "-9999.000", *DEG[501:]], head="t,w [deg/s]\n"))
    (record,) = read(path)
    assert any("-9999 stands 1 times" in note and "--missing -9999" in note for note in record.notes)
    (record,) = read(path, text=TextOptions(missing="-9999"))
    assert np.flatnonzero(np.isnan(record.rate)).tolist() == [500]
    assert record.notes == ()


@pytest.mark.parametrize(
    ("head", "names"),
    [
        ("Time,Gyro,Gyro\n,x,y\n", ["Time", "Gyro x", "Gyro y"]),
        ("t,x,y\n[s],[deg/s],[deg/s]\na,b,c\n", ["t", "x", "y"]),
        ("a,b,b\nt,x,y\n", ["t", "x", "y"]),
    ],
)
def test_of_several_lines_above_the_rows_the_names_are_found(tmp_path, head, names):
    assert [c.name for c in table(tmp_path, head + "0.1,2.5,3\n" * 40).columns] == names


def test_a_slow_channel_between_quick_ones_has_its_own_rate(tmp_path):
    slow = [w if k % 5 == 2 else "" for k, w in enumerate(DEG)]
    path = tmp_path / "log.csv"
    path.write_text(lines(SECONDS, slow, DEG, head="t,slow [deg/s],fast [deg/s]\n"))
    slow_record, fast = read(path)
    assert (slow_record.sample_rate_hz, fast.sample_rate_hz) == (pytest.approx(200.0), pytest.approx(1000.0))
    np.testing.assert_allclose(slow_record.rate, np.deg2rad(RATE[2::5]), rtol=1e-12)


def test_hexadecimal_words_have_the_sign_of_their_size(tmp_path):
    log = table(tmp_path, "a,b\n" + "0x0005,0x7f\n0xFFFB,0x80\n" * 30)
    block = next(log.blocks([0, 1]))
    assert block[0][:2].tolist() == [5, -5]
    assert block[1][:2].tolist() == [127, -128]
    assert "hexadecimal words of 8 bits" in str(log.dialect)


def test_json_in_one_piece_is_named(tmp_path):
    path = tmp_path / "log.json"
    path.write_text('[{"t": 0, "w": 1}, {"t": 1, "w": 2}]')
    with pytest.raises(ScenarioError, match="JSON in one piece"):
        read(path)
