"""Every term of the gyro's error chain alone, against its closed form."""

from __future__ import annotations

import math
from itertools import pairwise
from typing import Any

import numpy as np
import pytest
from pydantic import ValidationError

from testbed.allan import allan_deviation
from testbed.models.temperature import TemperatureProfile
from testbed.sensors import load_preset, mems_gyro, noise
from testbed.sensors.gyro_errors import Fir
from testbed.sensors.mems_gyro import MemsGyro
from testbed.sensors.noise import GyroNoise
from testbed.sensors.stages import Surroundings
from testbed.signals import random_stream

FS = 20_000.0
# No low-pass, no rounding to speak of: what is left is the term under test.
BARE: dict[str, Any] = {
    "sample_rate": 2000.0,
    "numerator": (1.0,),
    "denominator": (1.0,),
    "range": 10.0,
    "sensitivity": 1e14,
    "word_bits": 32,
}
# Of every kind, for tests of bits.
ALL: dict[str, Any] = {
    "scale_factor_error": 0.01,
    "scale_factor_asymmetry": 0.01,
    "cross_axis": (0.01, 0.02),
    "turn_on_bias": 0.01,
    "g_sensitivity": (1e-4, 2e-4, 3e-4),
    "bias_temperature": 1e-4,
    "scale_factor_temperature": 1e-4,
    "fir": "average",
    "jitter": 1.2e-4,
    "dead_band": 1e-3,
    "dropped": 0.1,
    "angle_random_walk": 1e-4,
}


def bare(**errors: Any) -> MemsGyro:
    return MemsGyro.model_validate({**BARE, "sensitivity": 1e8, "noise": False, **errors})


def noisy(**errors: Any) -> MemsGyro:
    return bare(noise=True, **errors)


def times(seconds: float) -> Any:
    return np.arange(round(seconds * FS)) / FS


def test_the_default_is_the_perfect_instrument() -> None:
    rate = np.random.default_rng(0).standard_normal(2000)
    assert np.array_equal(bare().sample(rate, FS), rate[::10])


@pytest.mark.oracle
def test_scale_factor_and_its_asymmetry() -> None:
    rate = np.array([0.3, -0.3, 0.0]).repeat(10)
    readings = bare(scale_factor_error=2e-3, scale_factor_asymmetry=1e-3).sample(rate, FS)
    # The mean scale factor is 1 + s; that of positive rates is above that of negative ones by a.
    np.testing.assert_allclose(readings, [0.3 * (1.002 + 5e-4), -0.3 * (1.002 - 5e-4), 0.0], rtol=1e-14, atol=0)


@pytest.mark.oracle
def test_cross_axis_couples_the_other_two_rates() -> None:
    cross = np.random.default_rng(1).standard_normal((100, 2))
    readings = bare(cross_axis=(0.02, -0.01)).start(FS, 0, "gyro").process_in(np.ones(100), Surroundings(cross))
    np.testing.assert_allclose(readings, (1.0 + 0.02 * cross[:, 0] - 0.01 * cross[:, 1])[::10], rtol=1e-14, atol=0)


@pytest.mark.oracle
def test_g_sensitivity_is_a_bias_per_specific_force() -> None:
    force = np.random.default_rng(2).standard_normal((100, 3))
    sensor = bare(g_sensitivity=(1e-3, 2e-3, -3e-3))
    readings = sensor.start(FS, 0, "gyro").process_in(np.zeros(100), Surroundings(specific_force=force))
    np.testing.assert_allclose(readings, (force @ [1e-3, 2e-3, -3e-3])[::10], rtol=1e-12, atol=1e-17)
    # Level and at rest it feels standard gravity along z.
    np.testing.assert_allclose(sensor.sample(np.zeros(10), FS), -3e-3 * 9.80665, rtol=1e-14)


@pytest.mark.oracle
def test_temperature_moves_bias_and_scale_factor() -> None:
    warming = TemperatureProfile(start=298.15, stop=318.15, over=0.5).at(0, 20_000, FS)
    sensor = bare(bias_temperature=1e-4, scale_factor_temperature=5e-5, reference_temperature=293.15)
    readings = sensor.start(FS, 0, "gyro").process_in(np.full(20_000, 0.2), Surroundings(temperature=warming))
    excess = 5.0 + 20.0 * np.minimum(times(1.0)[::10] / 0.5, 1.0)
    # Temperatures around 300 K carry eps * 300 = 7e-14 K.
    np.testing.assert_allclose(readings, 0.2 * (1.0 + 5e-5 * excess) + 1e-4 * excess, rtol=1e-15, atol=1e-16)


@pytest.mark.oracle
def test_turn_on_bias_is_drawn_once_per_run() -> None:
    sensor = noisy(turn_on_bias=0.01)
    runs = np.array([sensor.start(FS, seed, "gyro").process(np.zeros(40)) for seed in range(400)])
    assert np.ptp(runs, axis=1).max() == 0.0
    # 400 normal draws: mean within 5 / sqrt(400), standard deviation within 5 / sqrt(800) of itself.
    assert abs(runs[:, 0].mean()) < 0.01 * 5.0 / math.sqrt(400.0)
    assert runs[:, 0].std() == pytest.approx(0.01, rel=5.0 / math.sqrt(800.0))
    assert not sensor.model_copy(update={"noise": False}).sample(np.zeros(40), FS).any()


@pytest.mark.oracle
def test_dead_band_swallows_what_is_smaller() -> None:
    rate = np.array([0.0, 0.99e-3, -0.99e-3, 1.01e-3, -1.01e-3, 1.0]).repeat(10)
    readings = bare(dead_band=1e-3).sample(rate, FS)
    np.testing.assert_array_equal(readings, [0.0, 0.0, 0.0, 1.01e-3, -1.01e-3, 1.0])


def dirichlet(freq: Any, n_tap: int) -> Any:
    """Response of a mean over n samples at 20 kHz: sin(pi f n T) / (n sin(pi f T)), delayed by (n - 1) T / 2."""
    turn = np.pi * freq / FS
    return np.sin(n_tap * turn) / (n_tap * np.sin(turn)) * np.exp(-1j * (n_tap - 1) * turn)


@pytest.mark.oracle
def test_fir_response_is_the_closed_form() -> None:
    freq = np.geomspace(0.1, 9000.0, 200)
    np.testing.assert_allclose(bare(fir="average").response(freq), dirichlet(freq, 10), rtol=0, atol=1e-13)
    # A triangle of 2 n - 1 weights, of any scale, is the mean over n, twice.
    triangle = 7.0 * np.convolve(np.ones(10), np.ones(10))
    np.testing.assert_allclose(bare(fir=tuple(triangle)).response(freq), dirichlet(freq, 10) ** 2, rtol=0, atol=1e-13)
    # Newest first: 3/4 of this sample and 1/4 of the one before.
    np.testing.assert_allclose(
        bare(fir=(3.0, 1.0)).response(freq), (3.0 + np.exp(-2j * np.pi * freq / FS)) / 4.0, rtol=1e-13
    )


def phasor(readings: Any, freq: float, sample_rate: float) -> complex:
    turn = np.exp(-2j * np.pi * freq * np.arange(readings.size) / sample_rate)
    return complex(2.0 * np.mean(readings * turn))


@pytest.mark.oracle
@pytest.mark.parametrize("freq", [10.0, 130.0, 1500.0, 2300.0])
def test_decimation_attenuates_a_tone_as_modelled_below_and_above_nyquist(freq: float) -> None:
    """1.5 kHz read at 2 kHz shows up at 500 Hz with the amplitude that the response at 1.5 kHz says."""
    for errors in ({"fir": "average"}, {"fir": (3.0, 1.0)}, {}):
        sensor = bare(**errors)
        readings = sensor.sample(np.cos(2 * np.pi * freq * times(1.1)), FS)[200:]
        alias = freq - 2000.0 * round(freq / 2000.0)
        # The first reading used is at 0.1 s, a whole number of periods.
        got = phasor(readings, alias, 2000.0)
        assert abs(got - sensor.response([freq])[0]) < 1e-9
    # Unfiltered, the same tone comes through whole.
    assert abs(got) == pytest.approx(1.0, rel=1e-9)


@pytest.mark.oracle
def test_a_mean_over_the_period_removes_a_tone_at_the_sample_rate() -> None:
    tone = np.cos(2 * np.pi * 2000.0 * times(0.1))
    assert np.abs(bare(fir="average").sample(tone, FS)[1:]).max() < 1e-12  # arguments up to 1257 rad, in eps
    assert np.abs(bare().sample(tone, FS)).max() == 1.0


@pytest.mark.oracle
@pytest.mark.parametrize(
    ("errors", "delay"),
    [
        ({"fir": "average"}, 4.5 / FS),
        ({"fir": (1.0, 2.0, 1.0)}, 1.0 / FS),
        ({"fir": (3.0, 1.0)}, 0.25 / FS),
        ({"jitter": 3e-5}, 1.5e-5),
        ({"fir": "average", "jitter": 5e-4}, 4.5 / FS + 2.5e-4),
    ],
)
def test_a_ramp_lags_by_slope_times_delay(errors: dict[str, Any], delay: float) -> None:
    sensor, t = bare(**errors), times(0.1)
    readings = sensor.sample(3.0 * t, FS)[10:]
    np.testing.assert_allclose(readings, 3.0 * (t[::10][10:] - delay), rtol=0, atol=1e-14)
    assert sensor.delay(2000.0, FS) == pytest.approx(delay, rel=1e-12, abs=0)
    # The response says the same: phase -2 pi f delay at low frequency.
    assert np.angle(sensor.response([0.1])[0]) == pytest.approx(-2 * np.pi * 0.1 * delay, rel=1e-5, abs=0)


@pytest.mark.oracle
@pytest.mark.parametrize("spread", [1e-6, 2e-5, 5e-4])
def test_jitter_on_a_slope_has_its_standard_deviation(spread: float) -> None:
    """Ages uniform from 0 to J: rate slope times J / sqrt(12) rms about slope times J / 2, whatever lies between
    samples.
    """
    slope, t = 2.0, times(4.0)
    readings = noisy(jitter=spread).sample(slope * t, FS)
    age = (t[::10] - readings / slope)[10:]
    # Rounded to a count of 1e-8 rad/s: 2.5e-9 s of age at most.
    assert age.min() > -3e-9
    assert age.max() < spread + 3e-9
    # 7990 uniform values: mean within 5 J / sqrt(12 n); kurtosis 1.8, so the standard deviation within 5 sqrt(0.8 /
    # 4n).
    assert age.mean() == pytest.approx(0.5 * spread, abs=5.0 * spread / math.sqrt(12.0 * age.size))
    assert age.std() == pytest.approx(spread / math.sqrt(12.0), rel=5.0 * math.sqrt(0.2 / age.size))


@pytest.mark.oracle
def test_lost_readings_are_as_many_as_stated_and_independent() -> None:
    lost = np.isnan(noisy(dropped=0.1).sample(np.zeros(400_000), FS, seed=3))
    # 40 000 draws: 5 sqrt(p (1 - p) / n); two in a row as often as p^2.
    assert lost.mean() == pytest.approx(0.1, abs=5.0 * math.sqrt(0.09 / 40_000))
    assert (lost[1:] & lost[:-1]).mean() == pytest.approx(0.01, abs=5.0 * math.sqrt(0.01 / 40_000))
    assert not np.isnan(bare(dropped=1.0).sample(np.zeros(100), FS)).any()
    assert np.isnan(noisy(dropped=1.0).sample(np.zeros(100), FS)).all()


def test_switching_a_random_term_off_leaves_the_others_bit_identical() -> None:
    rate = 0.5 * np.sin(2 * np.pi * 5.0 * times(1.0))
    full = noisy(**{**ALL, "sensitivity": 1e6})
    whole = full.sample(rate, FS, seed=1)
    there = ~np.isnan(whole)
    assert np.array_equal(whole[there], full.model_copy(update={"dropped": 0.0}).sample(rate, FS, seed=1)[there])
    for off in ("turn_on_bias", "jitter", "angle_random_walk"):
        other = full.model_copy(update={off: 0.0}).sample(rate, FS, seed=1)
        # Every stream is its own, so the same readings are lost; and the term did something.
        assert np.array_equal(np.isnan(other), ~there)
        assert not np.array_equal(other[there], whole[there])
    still = noisy(angle_random_walk=1e-4)
    alone = still.sample(np.zeros(2000), FS, seed=1)
    shifted = still.model_copy(update={"turn_on_bias": 0.01}).sample(np.zeros(2000), FS, seed=1)
    # The same noise on another bias, to the count.
    assert np.ptp(shifted - alone) <= 2.1e-8
    assert abs(shifted[0] - alone[0]) > 1e-5


@pytest.mark.parametrize("sizes", [[1] * 40 + [19_960], [3, 9, 4990, 14_998], [777] * 25 + [575]])
@pytest.mark.parametrize("errors", [ALL, {**ALL, "fir": (1.0, 2.0, 1.0), "jitter": 0.0}, {**ALL, "fir": None}])
def test_any_blocks_give_the_same_bits_with_all_errors(sizes: list[int], errors: dict[str, Any]) -> None:
    random = np.random.default_rng(4)
    rate, around = random.standard_normal(20_000), Surroundings(
        random.standard_normal((20_000, 2)), random.standard_normal((20_000, 3)), 300.0 + random.random(20_000)
    )  # fmt: skip
    sensor = noisy(**errors)
    whole = sensor.start(FS, 3, "gyro").process_in(rate, around)
    stage = sensor.start(FS, 3, "gyro")
    parts = [stage.process_in(rate[a:b], around.part(a, b)) for a, b in pairwise(np.cumsum([0, *sizes]))]
    assert np.array_equal(np.concatenate(parts), whole, equal_nan=True)


@pytest.mark.parametrize("n_tap", [1, 3, 10, 40])
def test_decimation_filter_gives_the_same_bits_before_any_rounding(n_tap: int) -> None:
    random = np.random.default_rng(6)
    weights, u = random.random(n_tap), random.standard_normal(5000)
    fir = Fir(weights)
    parts = [fir.process(part) for part in np.split(u, [0, 1, 2, 7, 100, 3333])]
    assert np.array_equal(np.concatenate(parts), Fir(weights).process(u))


def test_every_random_term_has_a_stream_of_its_own(monkeypatch: pytest.MonkeyPatch) -> None:
    drawn: list[tuple[Any, ...]] = []

    def recorded(*key: Any) -> Any:
        drawn.append(key)
        return random_stream(*key)

    for module in (mems_gyro, noise):
        monkeypatch.setattr(module, "random_stream", recorded)
    terms = {**TERMS, **ALL}
    noisy(**terms).start(FS, 7, "left")
    # Every term but the ramp, and the three of the clock and the switch.
    assert len(drawn) == len(TERMS) - 1 + 3
    assert len(set(drawn)) == len(drawn)
    assert {key[:2] for key in drawn} == {(7, "left")}


def test_inputs_are_left_alone() -> None:
    around = Surroundings(np.ones((100, 2)), np.ones((100, 3)), np.full(100, 300.0))
    rate = np.ones(100)
    for array in (rate, around.cross_rate, around.specific_force, around.temperature):
        assert array is not None
        array.flags.writeable = False
    noisy(**ALL).start(FS, 0, "gyro").process_in(rate, around)


@pytest.mark.parametrize(
    ("errors", "message"),
    [
        ({"fir": (1.0, -1.0)}, "expected weights whose sum is not zero"),
        ({"fir": ()}, "fir"),
        ({"fir": (math.nan,)}, "fir"),
        ({"fir": "mean"}, "average"),
        ({"jitter": 6e-4}, "jitter: expected at most one period of the readings, 0.5 ms"),
        ({"dropped": 1.1}, "expected at most 1.0"),
        ({"dropped": -0.1}, "expected at least 0.0"),
        ({"scale_factor_error": -1.0}, "expected more than -1.0"),
        ({"turn_on_bias": -1.0}, "expected at least 0.0 rad/s"),
        ({"reference_temperature": 0.0}, "expected more than 0.0 K"),
        ({"reference_temperature": "25"}, "the unit is missing"),
        ({"g_sensitivity": "0.01 deg/s/g"}, "g_sensitivity"),
        ({"cross_axis": ("1 deg", 0.0)}, "expected a ratio, such as '200 ppm', got '1 deg'"),
    ],
)
def test_errors_are_checked(errors: dict[str, Any], message: str) -> None:
    with pytest.raises(ValidationError, match=message):
        bare(**errors)


def test_weights_belong_to_the_clock_of_the_run() -> None:
    with pytest.raises(ValueError, match="input_rate_hz: expected 20000 Hz, the clock of the fir's weights, got 4000"):
        bare(fir=(1.0, 1.0)).start(4000.0, 0, "gyro")


@pytest.mark.oracle
def test_hold_between_samples_loses_what_is_documented() -> None:
    """A straight line between samples loses (pi f T)^2 / 3 of a tone: 0.19 % at 480 Hz."""
    sensor = load_preset("adis16505").model_copy(update={"noise": False})
    readings = sensor.sample(0.1 * np.cos(2 * np.pi * 480.0 * times(1.1)), FS)[200:]
    loss = 1.0 - abs(phasor(readings, 480.0, 2000.0) / 0.1 / sensor.response([480.0])[0])
    expected = (np.pi * 480.0 / FS) ** 2 / 3.0
    print(f"loss {loss:.3e}, (pi f T)^2 / 3 = {expected:.3e}")
    # Images of the piecewise line, damped by the low-pass: (f / 20 kHz)^2 times |H(19.5 kHz)| / |H(480 Hz)|, 1e-6; and
    # the next order, (pi f T)^4 / 20.
    assert loss == pytest.approx(expected, rel=5e-3)


TERMS = {
    "quantization": 1e-6,
    "angle_random_walk": 4e-5,
    "bias_instability": 1e-5,
    "rate_random_walk": 1e-5,
    "rate_ramp": 1e-5,
    "markov_bias": 1e-4,
}


@pytest.mark.oracle
@pytest.mark.parametrize("term", TERMS)
def test_expected_allan_variance_is_that_of_the_record(term: str) -> None:
    terms = GyroNoise(**{term: TERMS[term]}, markov_time=0.3)
    fs, n = 100.0, 400_000
    tau = np.array([0.64, 1.28])
    got = allan_deviation(terms.sample(n, fs, 12), fs, tau).deviation ** 2
    wanted = np.array([terms.allan_variance(t) for t in tau])
    # 400 000 samples hold n / m >= 3000 independent averages, at least n / (2 m) degrees of freedom: 5 sqrt(2 / 1500) =
    # 18 %. Averages of m = 64 samples against continuous ones: at most 1 / m for the Markov term (Tc = 30 samples) and
    # 1.2 % for the filter of the flicker.
    assert np.abs(got / wanted - 1.0).max() < (1e-9 if term == "rate_ramp" else 0.19)


@pytest.mark.oracle
def test_markov_bias_peaks_as_known() -> None:
    """0.617 sigma at 1.89 T_c (physics of a first-order Markov process; no flicker's floor)."""
    terms = GyroNoise(markov_bias=2e-4, markov_time=50.0)
    tau = 50.0 * np.linspace(1.0, 3.0, 2001)
    deviation = np.sqrt([terms.allan_variance(t) for t in tau])
    assert deviation.max() / 2e-4 == pytest.approx(0.617, abs=5e-4)
    assert tau[deviation.argmax()] / 50.0 == pytest.approx(1.89, abs=5e-3)
    # Long averaging sees white noise of density 2 sigma^2 T_c, short averaging sees nearly nothing.
    assert terms.allan_variance(1e6) == pytest.approx(2.0 * 2e-4**2 * 50.0 / 1e6, rel=1e-3, abs=0)
    # Small tau: sigma^2 (2/3) tau / T_c, next order tau / T_c relative.
    assert terms.allan_variance(0.05) == pytest.approx(2.0 / 3.0 * 2e-4**2 * 1e-3, rel=2e-3, abs=0)


@pytest.mark.oracle
def test_datasheet_converts_exactly() -> None:
    """0.15 deg/sqrt(h) = 0.0025 deg/s/sqrt(Hz) two-sided = 0.0025 sqrt(2) one-sided; 2.7 deg/h has a floor of 1.793
    deg/h.
    """
    rows = dict(load_preset("adis16505").datasheet())
    assert rows["angle random walk N"] == "0.15 deg/sqrt(h)"
    assert rows["N as root density, two-sided"] == "0.0025 deg/s/sqrt(Hz)"
    assert rows["N as root density, one-sided (vendors)"] == "0.00353553 deg/s/sqrt(Hz)"
    assert rows["bias instability B"] == "2.7 deg/h"
    assert rows["its Allan floor, 0.664 B"] == f"{2.7 * math.sqrt(2 * math.log(2) / math.pi):.6g} deg/h"
    assert rows["rate random walk K"] == "0.1 deg/h/sqrt(h)"
    assert rows["one count of the word"] == f"{1 / 2621440:.6g} deg/s"
    assert rows["delay by decimation and age"] == "0 ms"
    # In deg/h with hours: N 60 deg/h over sqrt(tau / h) ... (0.15 deg/sqrt(h))^2 / tau + floor^2 + K^2 tau / 3.
    for tau in (1.0, 100.0):
        hours = tau / 3600.0
        variance = 0.15**2 / hours + 2 * math.log(2) / math.pi * 2.7**2 + 0.1**2 * hours / 3.0
        assert rows[f"Allan deviation at {tau:g} s, before the low-pass"] == f"{math.sqrt(variance):.6g} deg/h"
