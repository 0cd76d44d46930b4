"""The front part: what is no reading is struck out before any filter sees it, and what is one is left alone."""

from __future__ import annotations

import math

import numpy as np
import pytest

from testbed.fusion.belief import SensorBelief, load_belief
from testbed.fusion.gate import Gate, most_repeats, step_std
from testbed.fusion.schedule import Schedule
from testbed.signals import FloatArray, random_stream
from tests.records import DEG, RATES, record

SENSOR = SensorBelief(
    numerator=(600.0,), denominator=(1.0, 600.0), output_noise=1e-7, range=0.5, resolution=1e-6
)  # 1.4e-5 rad/s a reading at 20 kHz
FS = 20_000.0
STD = 1e-7 * math.sqrt(FS)


def struck(readings: FloatArray, belief: SensorBelief = SENSOR) -> FloatArray:
    """Return which readings of a lone sensor are struck out."""
    Z = readings[None].copy()
    counts = Gate({"one": belief}, Schedule({"one": FS})).process(Z)
    assert np.array_equal(np.diff(counts[0], prepend=0.0), np.isinf(Z[0]) & np.isfinite(readings))
    return np.isinf(Z[0]) & np.isfinite(readings)


def calm(n: int = 1_000, seed: int = 1) -> FloatArray:
    return STD * random_stream(seed, "calm").standard_normal(n)


def test_the_end_of_the_range_is_no_reading() -> None:
    readings = calm()
    readings[500:600] = 0.5
    readings[700] = -0.6
    assert list(np.flatnonzero(struck(readings))) == [*range(500, 600), 700]


def test_a_stuck_sensor_is_struck_out_from_the_promised_repetition_on() -> None:
    readings = calm()
    readings[500:600] = readings[499]
    n = most_repeats(STD, 1e-6)
    assert list(np.flatnonzero(struck(readings))) == list(range(499 + n, 600))


@pytest.mark.oracle
@pytest.mark.parametrize("ratio", [0.3, 1.0, 3.5])
def test_no_word_is_likelier_than_the_formula_says(ratio: float) -> None:
    """The most likely word of a Gaussian is the one around its mean: by counting a million."""
    words = np.rint(ratio * random_stream(2, "words").standard_normal(1_000_000))
    p = math.erf(1.0 / (2.0 * math.sqrt(2.0) * ratio))
    # Four standard errors of a share.
    assert np.mean(words == 0.0) == pytest.approx(p, abs=4.0 * math.sqrt(p / 1e6))
    assert most_repeats(ratio, 1.0) == math.ceil(math.log(1e-12) / math.log(p))


def test_the_shipped_mhd_sensor_may_repeat_itself_thirteen_times() -> None:
    belief = load_belief("eq39")["mhd_ars"]
    assert most_repeats(step_std(belief, FS), belief.resolution) == 13
    assert most_repeats(step_std(belief, FS), None) == 0
    # Words of ten standard deviations repeat at rest for ever, and rightly.
    assert most_repeats(STD, 10.0 * STD) == 0


def test_a_jump_out_of_a_calm_waits_for_the_first_reading_that_differs() -> None:
    readings = calm()
    readings[500:520] = 0.1
    without = SENSOR.model_copy(update={"resolution": None})
    assert list(np.flatnonzero(struck(readings, without))) == list(range(500, 520))
    # A step of the rate is one reading late.
    stepped = calm()
    stepped[500:] += 0.1
    assert list(np.flatnonzero(struck(stepped))) == [500]


def test_a_fast_and_large_sine_is_left_alone() -> None:
    """500 Hz, 20 deg/s: at most one in 10,000, the first that leaves the rest."""
    t = np.arange(20_000) / FS
    readings = np.where(t < 0.5, 0.0, 20.0 * DEG * np.sin(2.0 * np.pi * 500.0 * (t - 0.5))) + calm(t.size)
    assert np.count_nonzero(struck(readings)) <= 2


@pytest.mark.parametrize("lines", [((3.0, 1.0),), ((500.0, 20.0),), ()])
def test_clean_records_of_the_shipped_sensors_lose_nothing(lines: tuple[tuple[float, float], ...]) -> None:
    def motion(t: FloatArray) -> FloatArray:
        return sum((a * DEG * np.sin(2.0 * np.pi * f * t) for f, a in lines), np.zeros(t.size))

    _, readings = record(motion, 2.0, 3)
    belief, schedule = load_belief("identified"), Schedule(RATES)
    counts = Gate(belief, schedule).process(schedule.spread(readings))[:, -1]
    assert counts.sum() <= (4 if lines and lines[0][0] > 100.0 else 0)


def test_blocks_make_no_difference() -> None:
    readings = calm(3_000)
    readings[1000:1030], readings[2000:2100] = readings[999], 0.4
    whole = struck(readings)
    gate, found = Gate({"one": SENSOR}, Schedule({"one": FS})), []
    for start in range(0, 3_000, 7):
        Z = readings[None, start : start + 7].copy()
        gate.process(Z)
        found.append(np.isinf(Z[0]))
    assert np.array_equal(np.concatenate(found), whole)
