"""No pattern of missing readings makes a registered filter unstable, and no lie of a sensor gets far."""

from __future__ import annotations

import functools
from copy import deepcopy
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest

from testbed.fusion.belief import load_belief
from testbed.signals import FloatArray, random_stream
from tests.contract.records import METHODS, NAMES, joined
from tests.records import DEG, FS, RATES, cut, record, rms

if TYPE_CHECKING:
    from testbed.fusion import EstimateBlock

pytestmark = pytest.mark.contract

LENGTH = 12.0
PLACES = {"start": 0.0, "middle": 1.0, "end": None}
# Longest time constant of the sensors' dynamics in the belief, behind which a start is forgotten but for the gyro's.
AMPLITUDE = 1.0 * DEG


def three_hertz(t: FloatArray) -> FloatArray:
    return AMPLITUDE * np.sin(6.0 * np.pi * t)


@functools.cache
def clean() -> tuple[FloatArray, dict[str, FloatArray]]:
    return record(three_hertz, LENGTH, 5)


def up_to(end: float, readings: dict[str, FloatArray]) -> dict[str, FloatArray]:
    return {sensor: z[: round(end * RATES[sensor])] for sensor, z in readings.items()}


# As many as the rows of a filter below need in turn.
@functools.lru_cache(4)
def begun(name: str, since: float, **parameters: object) -> tuple[Any, EstimateBlock]:
    """Return a filter that has taken the clean record up to `since` [s], and its estimate of it.

    Blocks end anywhere (test_filters.py holds that to the bit), so that what comes before a fault is filtered once.
    """
    method = METHODS[name]
    stage = method(load_belief("identified"), RATES, method.Parameters(**parameters))
    return stage, stage.process(up_to(since, clean()[1]))


def run(name: str, readings: dict[str, FloatArray], since: float = 0.0, **parameters: object) -> EstimateBlock:
    """Return the estimate of readings that are the clean ones up to `since` [s]."""
    stage, before = begun(name, since, **parameters)
    return joined([before, deepcopy(stage).process(cut(clean()[0], readings, since)[1])])


def begins(gap: float | str, place: str, seconds: float) -> float:
    """Return from when on readings are missing [s]."""
    if gap == "random":
        return 0.0
    return round(seconds - float(gap), 9) if place == "end" else PLACES[place]


def lost(which: str, gap: float | str, place: str, seconds: float) -> dict[str, FloatArray]:
    """Return the first seconds of the record with readings of one sensor or both missing."""
    found = {}
    for sensor, whole in up_to(seconds, clean()[1]).items():
        z = whole.copy()
        if which in (sensor, "both"):
            if gap == "random":
                z[random_stream(3, sensor, "lost").random(z.size) < 0.9] = np.nan
            else:
                begin = round(begins(gap, place, seconds) * RATES[sensor])
                z[begin : begin + round(float(gap) * RATES[sensor])] = np.nan
        found[sensor] = z
    return found


def check_sane(block) -> None:
    assert np.isfinite(block.rate).all()
    assert np.isfinite(block.std).all()
    assert (block.std > 0.0).all()


@pytest.mark.parametrize("which", ["mhd_ars", "mems_gyro", "both"])
@pytest.mark.parametrize(
    ("gap", "place", "seconds"),
    [(gap, place, 2.2) for gap in (0.02, 0.1) for place in PLACES]
    + [(1.0, place, 3.0) for place in PLACES]
    + [("random", "middle", 2.0)],
)
@pytest.mark.parametrize("name", NAMES)
def test_no_gap_makes_a_filter_unstable(name: str, gap: float | str, place: str, seconds: float, which: str) -> None:
    """Inside a gap a filter extrapolates: an order of 3 at most by what a second of the motion's own acceleration comes
    to, A (1 + w t + (w t)^2 / 2) with w t = 19. What is left half a second after it is of the motion's own size.
    """
    block = run(name, lost(which, gap, place, seconds), begins(gap, place, seconds))
    check_sane(block)
    error = np.abs(block.rate - clean()[0][: block.rate.size])
    if METHODS[name].dishonest and place == "start":
        # (17) takes the innovations of an unknown start for noise of the other sensor: bounded by that start alone.
        assert error.max() <= 20.0 * AMPLITUDE
        return
    turn = 6.0 * np.pi * (1.0 if gap == "random" else float(gap))
    assert error.max() <= AMPLITUDE * (2.0 + turn + turn**2 / 2.0)
    if place != "end" and gap != "random":
        after = round((PLACES[place] + float(gap) + 0.5) * FS)
        assert error[after:].max() <= 2.0 * AMPLITUDE


@pytest.mark.slow
@pytest.mark.parametrize("which", ["mhd_ars", "mems_gyro", "both"])
@pytest.mark.parametrize("name", NAMES)
def test_ten_seconds_without_a_sensor_are_survived(name: str, which: str) -> None:
    block = run(name, lost(which, 10.0, "middle", LENGTH), PLACES["middle"])
    check_sane(block)
    error = np.abs(block.rate - clean()[0])
    assert error[-round(0.2 * FS) :].max() <= 2.0 * AMPLITUDE
    if which == "mems_gyro":
        assert error.max() <= 2.0 * AMPLITUDE


FAULTS = {
    "mhd lost": ("mhd_ars", np.nan),
    "mhd at 0": ("mhd_ars", 0.0),
    "mhd stuck": ("mhd_ars", None),
    "mhd at its rail": ("mhd_ars", 30.0 * DEG),
    "gyro lost": ("mems_gyro", np.nan),
    "gyro at its rail": ("mems_gyro", 500.0 * DEG),
    "gyro at 2000": ("mems_gyro", 2000.0 * DEG),
}
# All but what runs without the front part, as printed.
GATED = [name for name in NAMES if METHODS[name].Parameters().gate]
BEGIN, END, AFTER = 7.0, 8.0, 11.0


def spoilt(fault: str) -> dict[str, FloatArray]:
    sensor, value = FAULTS[fault]
    z = clean()[1][sensor].copy()
    part = slice(round(BEGIN * RATES[sensor]), round(END * RATES[sensor]))
    z[part] = z[part.start] if value is None else value
    return clean()[1] | {sensor: z}


@functools.cache
def undisturbed(name: str):
    return run(name, clean()[1], BEGIN)


@pytest.mark.slow
@pytest.mark.parametrize("fault", FAULTS)
@pytest.mark.parametrize("name", GATED)
def test_a_lying_sensor_is_as_good_as_a_lost_one(name: str, fault: str) -> None:
    """One second of fault in 3 Hz, 1 deg/s."""
    block, rate = run(name, spoilt(fault), BEGIN), clean()[0]
    check_sane(block)
    error, std = (block.rate - rate) / DEG, block.std / DEG
    inside, after = slice(round(BEGIN * FS), round(END * FS)), slice(round(AFTER * FS), None)
    within, left = np.array(METHODS[name].fault_leaves) / DEG
    assert np.abs(error[inside]).max() <= within
    usual = rms((undisturbed(name).rate - rate)[after]) / DEG
    assert rms(error[after]) <= max(left, 1.2 * usual)
    if not METHODS[name].dishonest:
        assert rms((error / std)[inside]) <= 5.0
        assert rms((error / std)[inside.stop :]) <= 5.0
    # One second of readings, but for the repetitions that have to come before a stuck sensor shows.
    sensor, value = FAULTS[fault]
    wanted = 0 if value is not None and np.isnan(value) else RATES[sensor] * (END - BEGIN)
    assert wanted - 20 <= block.diagnostics[f"gated_{sensor}"][-1] <= wanted


@pytest.mark.slow
@pytest.mark.parametrize("name", GATED)
def test_clean_readings_pass_the_front_part(name: str) -> None:
    with_gate, without = undisturbed(name), run(name, clean()[1], gate=False)
    assert all(with_gate.diagnostics[f"gated_{sensor}"][-1] == 0.0 for sensor in RATES)
    assert np.array_equal(with_gate.rate, without.rate)


def test_only_the_literal_form_runs_without_the_front_part() -> None:
    assert set(NAMES) - set(GATED) == {"arw_shakf_literal"}
