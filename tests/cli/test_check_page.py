"""The page of `testbed check`: short, and right in what it says of the run."""

from __future__ import annotations

import re

from testbed.chain.forecast import forecast
from testbed.cli.check_page import print_page, size_words, warnings
from testbed.judging.table_facts import table_facts
from tests.scenes import short


def test_the_page_says_what_departs_and_fits_a_screen_or_two(tmp_path, capsys):
    edit = ("preset: adis16505_filtered", "preset: adis16505_filtered, angle_random_walk: 0.3 deg/sqrt(h)")
    scenario = short(tmp_path, edit)
    size = forecast(scenario)
    print_page(scenario, table_facts(scenario, size.step), size)
    out = capsys.readouterr().out
    assert len(out.splitlines()) < 60
    row = next(line for line in out.splitlines() if "angle_random_walk" in line)
    assert "0.3 deg/sqrt(h)" in row
    assert "0.15 deg/sqrt(h)" in row
    assert "motion 1: sine frequency 10 Hz, rate 1 deg/s" in out
    assert size_words(size) in out
    assert "gravity" not in out
    # Six of one sensor and five of the other: one a decade (docs/starts_and_gaps.md).
    assert re.search(r"slow noise of mhd_ars: 6 states, within 0.2\d? dB of its density \(kalman\)", out)
    assert re.search(r"slow noise of mems_gyro: 5 states, within 0.2\d? dB of its density \(kalman\)", out)


def test_a_motion_that_is_seen_in_windows_is_told(tmp_path):
    assert warnings(short(tmp_path)) == []
    hour = short(tmp_path, ("duration: 0.5 s", "duration: 1 h"))
    (told,) = warnings(hour)
    assert "in windows spread over 3600 s" in told
