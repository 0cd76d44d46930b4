"""A true rate that follows temperature while a model is trained, or on the record that it corrects, is found out."""

from dataclasses import replace

import numpy as np
import pytest

from testbed.compensation.model_only import train
from testbed.drift.findings import MOST_ORACLE_RATIO
from testbed.drift.injection import heat_rate
from testbed.drift.leak import find_leaks
from testbed.drift.quality import block_std
from testbed.reproduce import paper3
from testbed.units import DEG_H

FS = 0.1
SEEDS = range(1, 6)
# About the drift's own std: the model learns as much rate as drift.
LEARNED = 0.1


def warmed(record, rate=LEARNED):
    """Return the record with a true rate of this std [deg/h] that follows its thermometer."""
    return replace(record, rate=record.rate + heat_rate(record.temperature, rate * DEG_H))


def two(seed):
    return [paper3.cycle(name, 100 * seed + k, FS).record for k, name in enumerate(("up first", "down first"))]


@pytest.fixture(scope="module")
def models():
    return {
        (seed, learned): train([warmed(one) if learned else one for one in two(seed)])
        for seed in SEEDS
        for learned in (False, True)
    }


@pytest.fixture(scope="module")
def judged():
    return {seed: paper3.cycle("paper", 100 * seed + 50, FS) for seed in SEEDS}


def audited(model, thermal):
    def compensate(record):
        return model.apply(record).rate

    return find_leaks(compensate, thermal.record, compensate(thermal.record), thermal.drift)


def test_a_model_that_learned_a_rate_is_refused_and_an_honest_one_is_not(models, judged):
    """Every seed: 0.1 deg/h of learned rate over 0.021 deg/h of noise is a ratio of 4.8, the limit is 2."""
    for (seed, learned), model in models.items():
        record, drift = judged[seed].record, judged[seed].drift
        ratio = block_std(model.apply(record).rate, FS) / block_std(record.rate - drift, FS)
        assert (ratio > MOST_ORACLE_RATIO) is learned, (seed, ratio)


def test_the_audit_says_so_and_names_no_leak(models, judged):
    """A frozen model passes every rate that is added: only what it leaves tells on it."""
    found = audited(models[1, True], judged[1])
    assert not found.passed
    assert found.leaks == ()
    assert found.heat_gain == pytest.approx(1.0, abs=1e-9)
    (excess,) = found.excess
    assert "a true rate that followed temperature was trained on" in excess
    honest = audited(models[1, False], judged[1])
    assert honest.passed
    assert honest.excess == ()


def test_a_learned_rate_on_a_record_that_has_it_too_leaves_less_than_noise_and_rate(models, judged):
    """The same rate is taken away again: what is left is quieter than what removing the drift alone leaves."""
    found = audited(models[1, True], replace(judged[1], record=warmed(judged[1].record)))
    assert found.excess == ()
    assert any(leak.startswith("the scatter of the 100 s means is 0.2") for leak in found.leaks)


@pytest.mark.parametrize("method", ["gradient", "polynomial"])
def test_what_trains_on_the_record_loses_a_rate_that_follows_temperature_whole(judged, method):
    """Sines of up to two hours survive a smooth function of temperature; this rate is one."""
    thermal = judged[1]

    def compensate(record):
        return train([record], method=method).apply(record).rate

    found = find_leaks(compensate, thermal.record, compensate(thermal.record), thermal.drift)
    assert abs(found.heat_gain) < 0.05
    assert any("a rate that follows temperature" in leak for leak in found.leaks)
    assert min(line.gain for line in found.gains if line.period <= 7200.0) > 0.9


def test_a_record_whose_temperature_never_moves_is_refused(judged):
    record = replace(judged[1].record, temperature=np.full(judged[1].record.rate.size, 300.0))
    with pytest.raises(ValueError, match="temperature: expected one that moves, got 300 K throughout"):
        find_leaks(lambda of: of.rate, record, record.rate)
