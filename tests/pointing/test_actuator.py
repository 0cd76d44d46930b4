"""The mirror: Butterworth's group delay, and a measured response met by a rational function or refused."""

from __future__ import annotations

import math

import numpy as np
import pytest
from numpy.testing import assert_allclose

from testbed.errors import ScenarioError
from testbed.pointing.actuator import Dynamics, butterworth_mirror, measured_mirror

FREQ = np.geomspace(1.0, 5000.0, 60)


def table(path, response, head="frequency,gain,phase\n"):
    rows = [f"{f:.6g},{abs(H):.8g},{np.rad2deg(np.angle(H)):.8g}" for f, H in zip(FREQ, response, strict=True)]
    path.write_text(head + "\n".join(rows) + "\n")
    return path


def test_the_group_delay_is_minus_the_slope_of_the_phase():
    mirror = butterworth_mirror(1000.0)
    assert_allclose(mirror.group_delay, math.sqrt(2.0) / (2.0 * math.pi * 1000.0), rtol=1e-12)
    freq = np.array([0.01])
    assert_allclose(-np.angle(mirror.response(freq)) / (2.0 * np.pi * freq), mirror.group_delay, rtol=1e-6)
    lead = Dynamics((3.0, 2.0), (1.0, 5.0, 4.0))
    assert_allclose(-np.angle(lead.response(freq / 100) / 0.5) / (0.02 * np.pi * freq), lead.group_delay, rtol=1e-4)


@pytest.mark.oracle
def test_a_measured_response_is_met(tmp_path):
    """Third order, given by its samples alone: found to the digits that the file has."""
    true = Dynamics((2e10,), tuple(np.poly([-4000.0, -900.0 + 2000j, -900.0 - 2000j]).real))
    found = measured_mirror(table(tmp_path / "fsm.csv", true.response(FREQ)))
    assert_allclose(found.response(FREQ), true.response(FREQ), rtol=1e-4)
    assert_allclose(found.group_delay, true.group_delay, rtol=1e-3)


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("", "at least eight rows"),
        ("1,2\n", "at least eight rows"),
        ("f,g,p\n1,2,x\n", "three numbers"),
        ("".join(f"{f},1,0\n" for f in (1, 2, 3, 3, 5, 6, 7, 8)), "rising"),
        ("".join(f"{f},0,0\n" for f in range(1, 10)), "gains above 0"),
    ],
)
def test_what_is_no_response_is_refused(tmp_path, text, words):
    path = tmp_path / "fsm.csv"
    path.write_text(text)
    with pytest.raises(ValueError, match=words):
        measured_mirror(path)


def test_a_response_that_no_few_poles_meet_is_refused(tmp_path, rng):
    noisy = butterworth_mirror(500.0).response(FREQ) * (1.0 + 0.5 * rng.standard_normal(FREQ.size))
    with pytest.raises(ValueError, match="meet within 5 %"):
        measured_mirror(table(tmp_path / "fsm.csv", noisy))


def test_a_missing_file_is_named(tmp_path):
    with pytest.raises(ScenarioError, match=r"none\.csv"):
        measured_mirror(tmp_path / "none.csv")
