"""The page of `testbed check`: short, and right in what it says of the run."""

from __future__ import annotations

import re

import numpy as np
import pytest

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


def test_a_motion_beyond_the_linear_channel_is_told_by_numbers(tmp_path):
    slow = ("frequency: 10 Hz, rate: 1 deg/s", "frequency: 0.5 Hz, rate: 25 deg/s")
    weak = ("{preset: sx300}", "{preset: sx300, channel: {height: 10 mm, field: 0.036 T}}")
    length = ("duration: 0.5 s", "duration: 2 s")
    assert warnings(short(tmp_path, slow, length)) == []
    (told,) = warnings(short(tmp_path, slow, length, weak))
    stroke = re.match(r"mhd_ars: channel: the motion leaves the range of 'flow: linear': stroke ([\d.]+) deg", told)
    # 25 deg/s over w; the motion's beginning is smooth. Then a/W of 0.0996 1/s, and nu/(W l^2).
    assert stroke is not None
    assert float(stroke[1]) == pytest.approx(25.0 / np.pi, rel=0.02)
    assert "Elsasser number 0.23 (at least 10) or Ekman number 0.0026 (at least 1)" in told
    whole = ("field: 0.036 T", "field: 0.036 T, flow: similarity")
    assert warnings(short(tmp_path, slow, length, weak, whole)) == []
