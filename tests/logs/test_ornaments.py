"""What loggers write around their numbers is taken off, and nothing of a plain table."""

from __future__ import annotations

import time

import pytest

from testbed.logs.ornaments import find_ornaments
from tests.logs.kinds import TEXTS

ROWS = {
    "labels": ("gx:{0},gy:{1}", "{0},{1}", ("gx", "gy"), ()),
    "labels with blanks and units": ("Rate X: {0}\tY: {1} rad/s", "{0}\t{1}", ("Rate X", "Y"), ("", "rad/s")),
    "json": ('{{"t": {0}, "w": {1}}}', "{0}, {1}", ("t", "w"), ()),
    "brackets": ("[{0}, {1}],", "{0}, {1}", (), ()),
    "units": ("{0} s;{1} deg/s", "{0};{1}", (), ("s", "deg/s")),
    "arrow": ("12:00:00.00{0} -> {1};7", "12:00:00.00{0};{1};7", (), ()),
    "plus of whole numbers": ("+{0},{1}", "{0},{1}", (), ()),
    "thousands with a comma in quotes": ('"1,00{0}.5",{1}', '"100{0}.5",{1}', (), ()),
    "thousands with a point": ("1.00{0},5;{1}", "100{0},5;{1}", (), ()),
    "thousands with an apostrophe": ("1'00{0}.5;{1}", "100{0}.5;{1}", (), ()),
    "exponents of Fortran": ("{0}.5D-02  {1}.0D+00", "{0}.5E-02  {1}.0E+00", (), ()),
    "typographer's minus": ("{0},\u2212{1}.5", "{0},-{1}.5", (), ()),
}


@pytest.mark.parametrize("kind", ROWS)
def test_each_ornament_is_taken_off_in_text_and_in_bytes(kind):
    written, plain, labels, units = ROWS[kind]
    rows = [written.format(k % 10, (k + 3) % 10) for k in range(30)]
    expected = [plain.format(k % 10, (k + 3) % 10) for k in range(30)]
    found = find_ornaments(rows)
    assert [found.off(row) for row in rows] == expected
    assert found.off_bytes("\n".join(rows).encode(), "utf-8").decode().split("\n") == expected
    assert (found.labels, found.units) == (labels, units)


@pytest.mark.parametrize("kind", TEXTS)
def test_a_plain_table_has_none(kind):
    text, _, _ = TEXTS[kind]
    assert find_ornaments(text.splitlines()[-200:]).swaps == ()


def test_a_comma_between_columns_is_no_mark_of_thousands():
    assert find_ornaments(["1,234,567"] * 30).swaps == ()
    assert find_ornaments(["1.234,567"] * 30).swaps == ()


@pytest.mark.parametrize("part", ["a b ", "1a", "1,234", "1.234", "x: ", "[(", "-> ", "12 ", "'1", "gx:1 dps "])
def test_a_line_made_to_be_slow_takes_no_longer_than_another(part):
    rows = [part * (100_000 // len(part))] * 200
    begin = time.process_time()
    found = find_ornaments(rows)
    for row in rows[:5]:
        found.off(row)
    # A hundredth of this on an idle machine; a repetition within another took minutes.
    assert time.process_time() - begin < 3.0
