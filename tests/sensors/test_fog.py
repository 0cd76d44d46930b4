"""The fibre-optic gyro: each noise term alone, scale factor and bias by temperature, mean over the interval,
thermometer.
"""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import pytest

from testbed.allan import allan_deviation, fit_allan
from testbed.sensors import load_preset
from testbed.sensors.fog import Fog, IntervalMean
from testbed.sensors.noise_terms import NoiseStage
from testbed.sensors.stages import Surroundings, ThermalStage

HOUR = np.deg2rad(1.0) / 3600.0  # deg/h
PRESET = load_preset("fog_paper3")
NOISE = ("quantization", "angle_random_walk", "bias_instability")


def fog(sample_rate=1.0, **changes):
    return PRESET.model_copy(update={"sample_rate": sample_rate, **changes})


def quiet(**changes):
    return fog(noise=False, **changes)


def sense(sensor, rate, temperature, fs=1.0, seed=0):
    stage = sensor.start(fs, seed, "fog")
    return stage.process_in(np.asarray(rate, float), Surroundings(temperature=np.asarray(temperature, float))), stage


def alone(term, sample_rate):
    return fog(sample_rate, **dict.fromkeys(set(NOISE) - {term}, 0.0))


@pytest.mark.oracle
def test_preset_has_the_papers_coefficients():
    assert PRESET.angle_random_walk == pytest.approx(np.deg2rad(7.8034e-4) / 60.0, rel=1e-12, abs=0)
    assert PRESET.bias_instability == pytest.approx(1.5323e-2 * HOUR, rel=1e-12, abs=0)
    assert PRESET.quantization == pytest.approx(np.deg2rad(6.1269e-4 / 3600.0), rel=1e-12, abs=0)
    assert PRESET.full_scale() == pytest.approx(np.deg2rad(500.0), rel=1e-12)
    # "Bandwidth over 100 Hz": half power is above.
    assert abs(PRESET.response(np.array([100.0]))[0]) ** 2 > 0.5
    assert abs(PRESET.response(np.array([148.3]))[0]) ** 2 == pytest.approx(0.5, abs=1e-3)


@pytest.mark.oracle
@pytest.mark.parametrize(("term", "fs", "slope"), [("quantization", 100.0, -1.0), ("angle_random_walk", 1.0, -0.5)])
def test_allan_slope_and_coefficient_of_a_term_alone(term, fs, slope):
    """sigma^2 = 3 Q^2 / tau^2 and N^2 / tau, from the readings."""
    readings = alone(term, fs).sample(np.zeros(200_000), fs, seed=4)
    tau = np.array([1.0, 4.0, 16.0, 64.0]) / fs
    curve = allan_deviation(readings, fs, tau)
    wanted = [getattr(PRESET, term) * (3.0**0.5 / t if slope == -1.0 else t**-0.5) for t in tau]
    # At least 200 000 / 64 / 2 degrees of freedom: 5 / sqrt(2 * 1560) = 9 %.
    np.testing.assert_allclose(curve.deviation, wanted, rtol=0.09)
    assert np.polyfit(np.log(tau), np.log(curve.deviation), 1)[0] == pytest.approx(slope, abs=0.03)


@pytest.mark.oracle
def test_bias_instability_alone_is_flat():
    readings = alone("bias_instability", 1.0).sample(np.zeros(200_000), 1.0, seed=5)
    tau = np.array([16.0, 64.0, 256.0])
    deviation = allan_deviation(readings, 1.0, tau).deviation
    floor = np.sqrt(2.0 * np.log(2.0) / np.pi) * PRESET.bias_instability
    # 200 000 / 256 / 2 = 390 degrees of freedom: 5 / sqrt(780) = 18 %.
    np.testing.assert_allclose(deviation, floor, rtol=0.18)


@pytest.mark.oracle
def test_all_terms_are_identified_at_100_hz_and_q_is_not_at_1_hz():
    """Where sqrt(3) Q / tau meets N / sqrt(tau) is tau = 3 Q^2 / N^2 = 0.5 ms: at 1 Hz nothing of Q is left, at 100 Hz
    a trace.

    With N out of the way Q is found to a percent.
    """
    both = fog(100.0, angle_random_walk=0.0).sample(np.zeros(400_000), 100.0, seed=6)
    assert fit_allan(allan_deviation(both, 100.0)).quantization.value == pytest.approx(
        PRESET.quantization, rel=0.03, abs=0
    )
    day = fog(1.0).sample(np.zeros(85_200), 1.0, seed=6)
    fit = fit_allan(allan_deviation(day, 1.0))
    # The limits of the issue for the weighted fit are 2.5 % and 6 %, medians; one seed within twice that.
    assert fit.angle_random_walk.value == pytest.approx(PRESET.angle_random_walk, rel=0.05, abs=0)
    assert fit.bias_instability.value == pytest.approx(PRESET.bias_instability, rel=0.12, abs=0)


@pytest.mark.oracle
def test_scale_factor_follows_the_coil():
    """An injected rate of 1 deg/s through a slow warming: the reading grows by s_T times the coil's temperature."""
    t = np.arange(20_000.0)
    rate = np.full(t.size, np.deg2rad(1.0))
    ambient = 293.15 + np.clip((t - 1000.0) / 300.0, 0.0, 30.0)
    sensor = quiet(scale_factor_temperature=40e-6, scale_factor_error=2e-3)
    readings, stage = sense(sensor, rate, ambient)
    coil = np.empty(t.size)
    coil[0] = ambient[0]
    for k in range(1, t.size):  # The lag by its recursion for the middle of each step; (T/tau)^2 / 24 is 5e-8.
        coil[k] = coil[k - 1] * np.exp(-1 / 900.0) + (ambient[k] + ambient[k - 1]) / 2 * -np.expm1(-1 / 900.0)
    wanted = np.deg2rad(1.0) * (1.002 + 40e-6 * (coil - 293.15)) + stage.drift
    np.testing.assert_allclose(readings, wanted, rtol=2e-9)
    assert (readings[-1] - stage.drift[-1]) / rate[-1] - 1.002 == pytest.approx(40e-6 * 30.0, rel=1e-3, abs=0)


@pytest.mark.oracle
def test_the_reading_is_the_mean_over_its_interval():
    """At the base clock of 20 kHz: mean of the samples since the last reading, before the start the first one."""
    rate = np.random.default_rng(1).normal(size=1001)
    wanted = [rate[0], *(rate[k - 99 : k + 1].mean() for k in range(100, 1001, 100))]
    wanted[0] = rate[0]
    np.testing.assert_allclose(IntervalMean(100).process(rate), wanted, rtol=1e-12, atol=1e-15)


@pytest.mark.property
def test_blocks_give_the_same_bits_in_rate_temperature_and_drift():
    rng = np.random.default_rng(2)
    rate, ambient = rng.normal(size=5000) * 1e-3, 293.15 + np.cumsum(rng.normal(size=5000)) * 0.05
    sensor, cuts = fog(2.0), [0, 1, 2, 7, 7, 1234, 5000]
    whole, stage = sense(sensor, rate, ambient, 20.0)
    parts = sensor.start(20.0, 0, "fog")
    found = []
    for a, b in pairwise(cuts):
        readings = parts.process_in(rate[a:b], Surroundings(temperature=ambient[a:b]))
        found.append((readings, parts.temperature, parts.drift))
    for got, one in zip(zip(*found, strict=True), (whole, stage.temperature, stage.drift), strict=True):
        assert np.array_equal(np.concatenate(got), one)


@pytest.mark.oracle
def test_drift_is_that_of_the_model_and_noise_off_reads_it():
    t = np.arange(20_000.0)
    ambient = 293.15 + 20.0 * np.sin(2 * np.pi * t / 15_000.0)
    readings, stage = sense(quiet(), np.zeros(t.size), ambient)
    assert isinstance(stage, ThermalStage)
    assert np.array_equal(stage.drift, PRESET.thermal.bias(ambient, 1.0))
    # The low-pass of 300 Hz is 0.5 ms behind.
    np.testing.assert_allclose(readings, stage.drift, rtol=0, atol=1e-3 * np.abs(np.diff(stage.drift)).max())


@pytest.mark.oracle
def test_thermometer_is_late_and_counts():
    """A ramp of 0.1 K/min: 900 s behind is 1.5 K; counts of 1/16 degC, none with the noise off."""
    t = np.arange(12_000.0)
    ambient = 293.15 + 0.1 / 60.0 * t
    _, stage = sense(fog(), np.zeros(t.size), ambient)
    _, exact = sense(quiet(), np.zeros(t.size), ambient)
    assert ambient[-1] - exact.temperature[-1] == pytest.approx(1.5 * -np.expm1(-t[-1] / 900.0), rel=1e-6)
    counts = (stage.temperature - 273.15) / 0.0625
    np.testing.assert_allclose(counts, np.round(counts), atol=1e-8)
    assert np.abs(stage.temperature - exact.temperature).max() <= 0.03125 + 1e-9


@pytest.mark.property
def test_noise_terms_have_streams_of_their_own():
    zeros = np.zeros(500)
    terms = sum(alone(term, 1.0).sample(zeros, 1.0, seed=3) for term in NOISE)
    np.testing.assert_allclose(fog().sample(zeros, 1.0, seed=3), terms, rtol=1e-9, atol=1e-18)


def test_noise_referred_to_the_input_ends_at_half_the_sample_rate():
    psd = fog().input_noise_psd(np.array([0.01, 0.5, 0.6, 100.0]))
    assert np.array_equal(np.isinf(psd), [False, False, True, True])
    # Far above the flicker: N^2 over the gain of the mean over a second, sinc(1/2) = 2/pi.
    assert psd[1] == pytest.approx(PRESET.angle_random_walk**2 * np.pi**2 / 4.0, rel=0.06, abs=0)


def test_readings_end_at_the_range():
    rate = np.deg2rad([400.0, 600.0, -600.0, 0.0])
    np.testing.assert_allclose(np.rad2deg(quiet(bandwidth=1e6).sample(rate, 1.0)), [400, 500, -500, 0], atol=1e-3)


def test_a_step_of_temperature_in_degc_is_refused():
    values = {**PRESET.model_dump(), "thermometer": {"step": "0.0625 degC"}}
    with pytest.raises(ValueError, match="expected at most 100"):
        Fog.model_validate(values)


@pytest.mark.oracle
@pytest.mark.parametrize("seed", range(6))
def test_a_weighted_fit_finds_the_papers_coefficients_in_a_day_of_noise(seed):
    """85,200 readings at 1 Hz: N within 2.5 %, B within 6 %, and Q, which would cross N at 0.5 ms, only as an upper
    limit.

    The density is known from 0.5 Hz to 1/day. The intervals of the fit, tested for coverage elsewhere, say what a seed
    may do: half of one is 1.96 standard deviations, so a bound is at least 2.6 of them: of six seeds and two
    coefficients one in nine trials would miss by chance.
    """
    fit = fitted_noise(1.0, 85_200, seed)
    for found, true, bound in (
        (fit.angle_random_walk, PRESET.angle_random_walk, 0.025),
        (fit.bias_instability, PRESET.bias_instability, 0.06),
    ):
        assert found.value == pytest.approx(true, rel=bound, abs=0.0)
        assert 0.5 * (found.upper - found.lower) < 0.75 * bound * true
    assert not fit.quantization.identified
    assert fit.quantization.upper > PRESET.quantization
    assert fit.goodness.accepted


@pytest.mark.oracle
@pytest.mark.parametrize("seed", range(3))
def test_quantisation_is_identified_at_100_hz(seed):
    """An hour: 3 Q^2/tau^2 is a twentieth of N^2/tau at 10 ms, and white noise is known there to sqrt(1/360,000)."""
    fit = fitted_noise(100.0, 360_000, seed)
    assert fit.quantization.identified
    # Of Q^2, 5 % of a variance known to 0.3 % (a few neighbouring averaging times): 6 % of Q^2, 3 % of Q; four of them.
    assert fit.quantization.value == pytest.approx(PRESET.quantization, rel=0.12, abs=0.0)


def fitted_noise(fs, n_time, seed):
    return fit_allan(allan_deviation(NoiseStage(PRESET.noise_terms(fs, seed, "fog")).process(n_time), fs))


def test_a_seed_is_a_cycle_where_coefficients_scatter():
    """Another drift for another seed, the same with and without noise, and no clean reading that all seeds share."""
    heat = 293.15 + 30.0 * np.sin(np.linspace(0.0, 6.0, 5000))
    thermal = PRESET.thermal.model_copy(update={"scatter": 0.1})
    drifts = {
        (seed, noise): sense(fog(noise=noise, thermal=thermal), np.zeros(5000), heat, seed=seed)[1].drift
        for seed in (1, 2)
        for noise in (True, False)
    }
    np.testing.assert_array_equal(drifts[1, True], drifts[1, False])
    assert np.std(drifts[1, True] - drifts[2, True]) > 0.01 * np.std(drifts[1, True])
    assert not fog(thermal=thermal).start(1.0, 1, "fog").separable
    assert fog().start(1.0, 1, "fog").separable
