"""The frozen compensator: what it reaches on unseen cycles, and what it must never do."""

from __future__ import annotations

import itertools
import json
from dataclasses import replace

import numpy as np
import pytest

from testbed.allan import allan_deviation, fit_allan
from testbed.compensation.model_only import METHODS, DriftModel, train
from testbed.compensation.record import GyroRecord
from testbed.compensation.training import block_means
from tests.compensation.thermal_record import DEG_H, UNSEEN, cycle

SEEDS = range(6)


@pytest.fixture(scope="module")
def cycles():
    """One training cycle of each direction."""
    return [cycle(name, 1 + k) for k, name in enumerate(("up", "down"))]


@pytest.fixture(scope="module")
def models(cycles):
    return {method: train([each.record for each in cycles], method=method) for method in METHODS}


def judged(model, unseen):
    """Return drift reduction and 100 s block std over the oracle's (true drift subtracted)."""
    out = model.apply(unseen.record)
    left = block_means(unseen.drift - out.drift, 100)
    return block_means(unseen.drift, 100).std() / left.std(), block_means(out.rate, 100).std() / block_means(
        unseen.noise, 100
    ).std()


@pytest.fixture(scope="module")
def table():
    """Reduction and ratio to the oracle, by method and training: shape (n_seed, n_programme, 2)."""
    trainings = {1: ("up",), 2: ("up", "down"), "two rates": ("two_rates",)}
    found = {(method, key): [] for method in ("gradient", "process") for key in trainings}
    for seed in SEEDS:
        known = {name: cycle(name, 100 * seed + k).record for k, name in enumerate(("up", "down", "two_rates"))}
        unseen = [cycle(name, 100 * seed + 50 + k) for k, name in enumerate(UNSEEN)]
        for (method, key), rows in found.items():
            model = train([known[name] for name in trainings[key]], method=method)
            rows.append([judged(model, each) for each in unseen])
    return {key: np.array(rows) for key, rows in found.items()}


@pytest.mark.slow
@pytest.mark.parametrize("method", ["gradient", "process"])
def test_drift_of_an_unseen_cycle_shrinks_five_and_six_fold(table, method):
    """Issue 5: medians over six seeds and the four programmes, on a generator the model's features do not repeat."""
    assert np.median(table[method, 1][..., 0]) >= 5.0
    assert np.median(table[method, 2][..., 0]) >= 6.0
    # After two cycles it holds for every programme, not only over all.
    assert np.all(np.median(table[method, 2][..., 0], axis=0) >= 6.0)


@pytest.mark.slow
@pytest.mark.parametrize("method", ["gradient", "process"])
def test_after_two_cycles_blocks_scatter_little_more_than_with_the_drift_known(table, method):
    assert np.median(table[method, 2][..., 1]) <= 1.25
    assert np.max(table[method, 2][..., 1]) <= 1.4


@pytest.mark.slow
@pytest.mark.parametrize("method", ["gradient", "process"])
def test_one_cycle_at_two_rates_tells_temperature_from_time(table, method):
    """It crosses each temperature at two rates and comes back: every programme meets the limits of two cycles, the
    worst one too.
    """
    assert np.median(table[method, "two rates"][..., 0]) >= 6.0
    assert np.median(table[method, "two rates"][..., 1]) <= 1.25
    assert np.max(table[method, "two rates"][..., 1]) < np.max(table[method, 1][..., 1])


@pytest.mark.slow
def test_compensation_leaves_the_noise_coefficients_alone(models, cycles):
    """Issue 5: N by less than 2 %, B by less than 6 %, weighted fit, against the same record before.

    Before, the drift is no term of the noise model: the fit is of averaging times up to 300 s, where it is below the
    noise.
    """
    for seed in (7, 8):
        unseen = cycle("slow_up", seed).record
        after = models["gradient"].apply(unseen).rate
        fits = [fit_allan(allan_deviation(rate, 1.0).between(1.0, 300.0)) for rate in (unseen.rate, after)]
        assert fits[1].angle_random_walk.value == pytest.approx(fits[0].angle_random_walk.value, rel=0.02)
        assert fits[1].bias_instability.value == pytest.approx(fits[0].bias_instability.value, rel=0.06)


@pytest.mark.property
@pytest.mark.parametrize("method", METHODS)
def test_the_drift_does_not_depend_on_the_rate(models, method, rng):
    unseen = cycle("mixed_down", 4).record
    rates = unseen.rate[:6000], DEG_H * rng.normal(size=6000)
    drifts = [models[method].apply(GyroRecord(rate, unseen.temperature[:6000], 1.0)).drift for rate in rates]
    assert np.array_equal(*drifts)


@pytest.mark.property
@pytest.mark.parametrize("method", ["gradient", "polynomial", "process"])
def test_a_true_rate_passes_whole(models, method):
    """Issue 5: gain 1.00 +- 0.01 from 10 s to 6 h. The rate does not enter the drift, so it is one to rounding of the
    rate.
    """
    unseen = cycle("slow_up", 9).record
    t = np.arange(unseen.rate.size)
    base = models[method].apply(unseen)
    for period in (10.0, 60.0, 600.0, 3600.0, 21_600.0):
        rate = 5.0 * DEG_H * np.sin(2.0 * np.pi * t / period)
        moved = models[method].apply(GyroRecord(unseen.rate + rate, unseen.temperature, 1.0))
        assert np.array_equal(moved.drift, base.drift)
        gain = (moved.rate - base.rate) @ rate / (rate @ rate)
        assert gain == pytest.approx(1.0, abs=1e-9)


@pytest.mark.property
@pytest.mark.parametrize("method", METHODS)
def test_any_division_into_blocks_gives_the_same_bits(models, method, rng):
    unseen = cycle("mixed_down", 4).record
    part = GyroRecord(unseen.rate[:9000], unseen.temperature[:9000], 1.0)
    whole, stage = models[method].apply(part), models[method].start()
    cuts = [0, 1, 2, 3, *np.sort(rng.integers(3, 9000, 12)), 9000]
    blocks = [stage.process(part.rate[a:b], part.temperature[a:b]) for a, b in itertools.pairwise(cuts)]
    for name in ("rate", "drift", "extrapolated"):
        assert np.array_equal(np.concatenate([getattr(each, name) for each in blocks]), getattr(whole, name))


@pytest.mark.property
def test_the_future_does_not_change_the_past(models):
    unseen = cycle("up", 4).record
    other = GyroRecord(unseen.rate, np.r_[unseen.temperature[:30_000], unseen.temperature[30_000:] + 9.0], 1.0)
    past, changed = (models["gradient"].apply(record).rate[:30_001] for record in (unseen, other))
    assert np.array_equal(past[:30_000], changed[:30_000])
    # Latency: the very sample that is new has moved already.
    assert past[30_000] != changed[30_000]


def test_a_frozen_model_does_not_learn(models):
    model = models["lssvm"]
    before, unseen = json.dumps(model.to_dict()), cycle("up", 4).record
    part = GyroRecord(unseen.rate[:5000], unseen.temperature[:5000], 1.0)
    first = model.apply(part)
    model.apply(GyroRecord(part.rate + 1.0, part.temperature - 30.0, 1.0))
    assert json.dumps(model.to_dict()) == before
    assert np.array_equal(model.apply(part).drift, first.drift)


@pytest.mark.parametrize("method", METHODS)
def test_a_model_survives_json(models, method):
    model = models[method]
    again = DriftModel.from_dict(json.loads(json.dumps(model.to_dict())))
    unseen = cycle("up", 4).record
    part = GyroRecord(unseen.rate[:3000], unseen.temperature[:3000], 1.0)
    assert np.array_equal(again.apply(part).rate, model.apply(part).rate)
    assert again.to_dict() == model.to_dict()


@pytest.mark.parametrize(
    "change",
    [{"version": 1}, {"format": "other"}, {"machine": {}}, {"method": "magic"}, {"features": {"lags": [-1.0]}}],
)
def test_a_document_that_is_no_model_is_refused(models, change):
    with pytest.raises(ValueError, match=r"ModelDocument"):
        DriftModel.from_dict({**models["gradient"].to_dict(), **change})


def test_earth_rate_stays_and_is_told(models, cycles):
    """The mean over the training rows is no drift: a model trained at another latitude subtracts the same."""
    elsewhere = [GyroRecord(each.record.rate + 3.0 * DEG_H, each.record.temperature, 1.0) for each in cycles]
    other, unseen = train(elsewhere), cycle("up", 4).record
    shift = other.mean_rate - models["gradient"].mean_rate
    assert shift == pytest.approx(3.0 * DEG_H, rel=1e-9)
    # 13 deg/h and its noise are rounded at 1e-16 of it; the weights amplify that by their condition, below 1e6.
    assert np.allclose(other.apply(unseen).drift, models["gradient"].apply(unseen).drift, rtol=0.0, atol=1e-9 * DEG_H)
    drift = np.concatenate([block_means(models["gradient"].apply(each.record).drift, 100) for each in cycles])
    assert abs(drift.mean()) < 1e-3 * DEG_H


def test_extrapolation_is_flagged(models):
    """Twice the trained slope, and 10 K beyond the trained range; the trained cycles themselves are inside."""
    seen = cycle("up", 5).record
    assert not models["gradient"].apply(seen).extrapolated.any()
    fast = GyroRecord(seen.rate[::2], seen.temperature[::2], 1.0)
    assert models["gradient"].apply(fast).extrapolated.mean() > 0.5
    hot = GyroRecord(seen.rate, seen.temperature + 10.0, 1.0)
    flagged = models["gradient"].apply(hot).extrapolated
    assert flagged[seen.temperature > seen.temperature.max() - 4.0].all()
    assert not flagged[:7200].any()


def test_another_start_is_told_by_its_distance_from_the_nearest_of_training(models):
    """Both cycles of training start at 20 degC; nothing of the temperatures is outside what was trained on."""
    seen = cycle("up", 5).record
    model = models["gradient"]
    assert model.starts == pytest.approx([293.15, 293.15], abs=0.0625)
    assert model.start_distance(seen) == 0.0
    late = slice(7200 + 18_000, None)  # 30 K up the ramp, a lag of 900 s behind
    other = GyroRecord(seen.rate[late], seen.temperature[late], 1.0)
    assert model.start_distance(other) == pytest.approx(28.5, abs=0.1)
    assert replace(model, starts=(293.15, 325.0)).start_distance(other) == pytest.approx(325.0 - 321.65, abs=0.1)


def test_the_machine_far_outside_falls_back_to_its_bias_and_says_so(models):
    seen = cycle("up", 5).record
    far = models["lssvm"].apply(GyroRecord(seen.rate[:500], seen.temperature[:500] + 1e4, 1.0))
    assert far.drift == pytest.approx(models["lssvm"].machine.bias, abs=1e-15)
    assert far.extrapolated.all()


def test_training_repeats(cycles, models):
    again = train([each.record for each in cycles], method="gradient")
    assert again.to_dict() == models["gradient"].to_dict()


def test_bad_readings_are_refused(models):
    stage = models["gradient"].start()
    for rate, temperature in (([0.0, np.nan], [300.0, 300.0]), ([0.0], [np.nan]), ([0.0], [300.0, 300.0])):
        with pytest.raises(ValueError, match=r"rate|temperature"):
            stage.process(np.array(rate), np.array(temperature))


def test_an_unknown_method_is_refused(cycles):
    with pytest.raises(ValueError, match="gradient, lssvm, polynomial, process"):
        train([cycles[0].record], method="magic")
