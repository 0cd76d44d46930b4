"""The judgement of `wideband` in short: few signals, few seeds, shorter runs; the full table is the example's."""

from __future__ import annotations

import importlib.util
import sys
from pathlib import Path

import numpy as np
import pytest

PROGRAM = Path(__file__).parents[2] / "examples" / "wideband_against_fixed.py"
SPEC = importlib.util.spec_from_file_location("wideband_against_fixed", PROGRAM)
assert SPEC is not None
assert SPEC.loader is not None
example = importlib.util.module_from_spec(SPEC)
# Data classes look their module up by name.
sys.modules["wideband_against_fixed"] = example
SPEC.loader.exec_module(example)


def test_the_search_follows_the_grid_to_a_minimum() -> None:
    """From either side, past its first three decades, and by the root mean square over seeds."""
    seen = []

    def errors(decade: int) -> np.ndarray:
        seen.append(decade)
        return np.array([1.0, 1.0, 50.0]) + abs(decade - 7)

    for start in (3, 7, 12):
        best, values = example.best_fixed(errors, start)
        assert best == 7
        assert list(values) == [1.0, 1.0, 50.0]
        assert {6, 8} <= set(seen)
        seen.clear()


@pytest.mark.parametrize("label", ["mixed", "100 Hz", "wheel run-up"])
def test_close_to_the_best_fixed_filter(label: str) -> None:
    """1.15 is promised for the root mean square over ten seeds; two seeds of 4 s scatter more at low frequency: 1.3
    there. From rest: an unknown start leaves offsets that the lag of some wrong filter makes up for in two seeds.
    """
    _, late = example.judge(label, (33, 34), 4.0, "rest")
    assert late.ratio <= (1.15 if label == "100 Hz" else 1.3)
    assert late.wideband <= 0.0035


def test_a_record_of_an_unknown_start_begins_anywhere_in_the_motion() -> None:
    """At another instant for another seed, the sensors having run: the gyro's first reading is no step from 0."""
    motion = [example.sine(0.5)]
    turns = np.arange(2000) / 20_000 * np.pi
    for seed in (33, 34):
        rate, z = example.record(motion, 0.1, seed, "unknown")
        assert rate.size == z["mhd_ars"].size == 10 * z["mems_gyro"].size == 2000
        basis = np.column_stack([np.sin(turns), np.cos(turns)])
        amplitudes, *_ = np.linalg.lstsq(basis, rate, rcond=None)
        assert np.hypot(*amplitudes) == pytest.approx(np.pi / 180.0, rel=1e-6)
        assert amplitudes[1] != pytest.approx(0.0, abs=1e-4)
    begun, _ = example.record(motion, 0.1, 33, "rest")
    assert begun[0] == 0.0


@pytest.mark.parametrize(("name", "own"), [("kalman", example.fixed(8.0, 2)), ("wideband", {})])
def test_seeds_side_by_side_have_the_errors_that_each_has_alone(name: str, own: dict[str, object]) -> None:
    records = [example.record([example.sine(10.0)], 0.8, seed, "unknown") for seed in (33, 34)]
    found = example.errors_and_claims(name, records, "unknown", **own)
    for (rate, z), one in zip(records, found, strict=True):
        block = example.estimate(name, z, sample_rate_hz=example.RATES, belief=example.BELIEF, verdict=False, **own)
        for k, part in enumerate((slice(4000, 8000), slice(8000, None))):
            wanted = np.degrees([example.rms((block.rate - rate)[part]), example.rms(block.std[part])])
            np.testing.assert_allclose(one[:, k], wanted, rtol=1e-9)


def test_the_wheel_is_that_of_the_scenario() -> None:
    motions, _ = example.signals()["wheel"]
    assert motions[0].lines() == pytest.approx([40.0, 80.0, 120.0, 208.0], rel=1e-9)


def test_changed_beliefs_are_off_by_what_is_said() -> None:
    freq = np.array([0.3, 5.0, 200.0])
    for belief in example.BELIEF.values():
        right = belief.realisation()
        gain = example.changed(belief, gain=0.95).realisation()
        corner = example.changed(belief, corner=1.05).realisation()
        np.testing.assert_allclose(gain.response(freq), 0.95 * right.response(freq), rtol=1e-9)
        np.testing.assert_allclose(corner.response(freq), right.response(freq / 1.05), rtol=1e-9)


@pytest.mark.parametrize("sensor", ["mhd_ars", "mems_gyro"])
@pytest.mark.parametrize(("key", "factor"), [("gain", 1.05), ("gain", 0.95), ("corner", 1.05), ("corner", 0.95)])
def test_a_wrong_belief_costs_what_it_forces(sensor: str, key: str, factor: float) -> None:
    """At most 1.3 sqrt(ideal^2 + forced^2), 5 % of scale factor or corner, both signs, both sensors; 10 Hz, where both
    count.
    """
    wrong = example.BELIEF | {sensor: example.changed(example.BELIEF[sensor], **{key: factor})}
    error, ideal, forced = example.mismatch_ratios(10.0, example.MISMATCH_AT[10.0], wrong, (33, 34), 2.0).T
    assert np.all(error <= 1.3 * np.hypot(ideal, forced))


@pytest.mark.parametrize("label", list(example.CHANGES))
def test_a_change_in_the_middle_costs_no_more_than_a_third(label: str) -> None:
    """From 0.1 s after the change on, against the second signal from the start, both rms over six seeds (single ones
    scatter from 0.6 to 1.9); slow states that a fast signal spoilt would cost 20 times.
    """
    found = np.array([example.change_errors(label, seed, 4.0) for seed in range(31, 37)])
    real, ideal = np.sqrt(np.mean(found[:, :2] ** 2, axis=0))
    # Without belief error the bound of a wrong belief is 1.3 of the ideal; NaN would fail.
    assert real <= 1.3 * ideal
    assert np.isfinite(found[:, 2]).all()
