"""Faults of a sensor against an outright reading of what they say, in any division into blocks."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from pydantic import ValidationError

from testbed.sensors import load_preset
from testbed.sensors.faults import Fault, FaultStage

FS, RAIL = 100.0, 9.0


def expected(readings, faults):
    """Return the readings, each asked by its own time; times in whole milliseconds."""
    found = list(readings)
    for fault in faults:
        at, end = round(1000 * fault.at), round(1000 * (fault.at + fault.length))
        inside = [j for j in range(len(readings)) if at <= 10 * j < end]
        for j in inside:
            held = readings[max(inside[0] - 1, 0)]
            found[j] = {"lost": np.nan, "stuck": held, "rail": RAIL}[fault.kind]
    return np.array(found)


@st.composite
def fault_lists(draw):
    edges = sorted(draw(st.sets(st.integers(0, 400), min_size=2, max_size=6)))
    kinds = st.sampled_from(["lost", "stuck", "rail"])
    return [
        Fault(kind=draw(kinds), at=a / 1000, length=(b - a) / 1000)
        for a, b in zip(edges[::2], edges[1::2], strict=False)
    ]


@given(fault_lists(), st.lists(st.integers(0, 30), max_size=5))
def test_readings_are_those_of_their_own_time_in_any_blocks(faults, cuts):
    readings = np.arange(40.0) + 0.5
    stage = FaultStage(faults, FS, RAIL)
    given_ = np.concatenate([stage.process(block) for block in np.split(readings, sorted(cuts))])
    assert np.array_equal(given_, expected(readings, faults), equal_nan=True)
    assert np.array_equal(readings, np.arange(40.0) + 0.5)


def test_a_sensor_that_is_stuck_from_the_first_reading_on_repeats_that_one():
    stage = FaultStage([Fault(kind="stuck", at=0.0, length=0.03)], FS, RAIL)
    assert stage.process(np.array([5.0, 6.0, 7.0, 8.0])).tolist() == [5.0, 5.0, 5.0, 8.0]


def test_two_faults_at_a_time_are_refused():
    lost = Fault(kind="lost", at=1.0, length=1.0)
    gyro = load_preset("adis16505")
    assert gyro.model_copy(update={"faults": [Fault(kind="rail", at=2.0, length=1.0), lost]}).faults[1] == lost
    with pytest.raises((ValidationError, ValueError), match="one fault at a time"):
        gyro.model_copy(update={"faults": [lost, Fault(kind="rail", at=1.999, length=1.0)]})


@pytest.mark.parametrize("preset", ["sx300", "adis16505", "fog_paper3"])
def test_a_whole_record_has_the_faults_and_nothing_else_moves(preset):
    sensor = load_preset(preset)
    n, fs = 400, sensor.sample_rate
    clean = sensor.sample(np.zeros(n), fs, seed=4)
    faults = [Fault(kind="lost", at=10 / fs, length=20 / fs), Fault(kind="rail", at=50 / fs, length=5 / fs)]
    got = sensor.model_copy(update={"faults": faults}).sample(np.zeros(n), fs, seed=4)
    assert np.isnan(got[10:30]).all()
    assert np.all(got[50:55] == sensor.full_scale())
    kept = np.r_[0:10, 30:50, 55:n]
    assert np.array_equal(got[kept], clean[kept])
