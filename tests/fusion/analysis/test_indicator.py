"""The frequency indicator against closed forms, without a signal, under noise, and divided into blocks."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from testbed.fusion.analysis.indicator import (
    ENOUGH,
    LAGS_S,
    FrequencyIndicator,
    FrequencyRows,
    energies,
    noise_energies,
    turn,
)
from testbed.fusion.belief import load_belief
from testbed.signals import random_stream

DEG = np.pi / 180.0
RATES = {"mems_gyro": 2000.0, "mhd_ars": 20000.0}
BELIEF = load_belief("eq39")


def sine(freq: float, amplitude: float, n: int, fs: float = 2000.0, phase: float = 0.7) -> Any:
    return amplitude * np.sin(2.0 * np.pi * freq * np.arange(n) / fs + phase)


@pytest.mark.oracle
@pytest.mark.parametrize("freq", [0.5, 10.0, 120.0])
def test_energies_of_a_sine_are_its_closed_forms(freq: float) -> None:
    lag, amplitude = 4, 3.0
    theta = 2.0 * np.pi * freq * lag / 2000.0
    signal, increments = energies(sine(freq, amplitude, 500), lag)
    # eps of the argument of the sine, up to 200 rad, in products of A^2; four of them, of increments up to 2 A.
    atol = 16 * 200 * np.finfo(float).eps * amplitude**2
    np.testing.assert_allclose(signal, amplitude**2 * np.sin(theta) ** 2, rtol=0, atol=atol)
    np.testing.assert_allclose(
        increments, (2.0 * amplitude * np.sin(theta / 2) * np.sin(theta)) ** 2, rtol=0, atol=atol
    )
    assert signal.size == 500 - 3 * lag


@pytest.mark.oracle
@pytest.mark.parametrize("theta", [1e-3, 0.3, 1.5, 3.1])
def test_turn_inverts_the_ratio_and_has_no_answer_without_a_signal(theta: float) -> None:
    assert turn(5.0, 5.0 * 4.0 * np.sin(theta / 2.0) ** 2) == pytest.approx(theta, rel=1e-12, abs=0.0)
    assert np.isnan(turn([1.0, 0.0, -1.0, 1.0], [0.0, 1.0, -1.0, -1.0])).all()


@pytest.mark.oracle
def test_noise_energies_are_the_means_over_noise() -> None:
    """White noise through the gyro's response, by its autocovariance, against 400 s of it."""
    from testbed.signals import LinearFilter

    believed, lag, fs, n = BELIEF["mems_gyro"], 4, 2000.0, 800_000
    white = believed.input_noise * np.sqrt(10 * fs) * random_stream(2, "noise").standard_normal(10 * n)
    passed = LinearFilter(list(believed.numerator), list(believed.denominator), 10 * fs).process(white)[::10]
    behind = random_stream(3, "behind").standard_normal(n) * believed.output_noise * np.sqrt(fs)
    found = [float(np.mean(e)) for e in energies(passed + behind, lag)]
    # The response forgets within 1/30 s, so there are 1e4 independent pieces: 6 sqrt(3 / 1e4) = 10 %.
    np.testing.assert_allclose(noise_energies(believed, fs, lag), found, rtol=0.1)


def test_the_indication_is_the_same_for_every_amplitude() -> None:
    """Without noise in belief and readings, a factor of 2^20 changes no bit."""
    silent = {name: one.model_copy(update={"input_noise": 0.0, "output_noise": 0.0}) for name, one in BELIEF.items()}
    blocks = []
    for factor in (1.0, 2.0**20):
        z = {name: factor * sine(7.0, 0.1, round(fs), fs) for name, fs in RATES.items()}
        # After 25 memories the start, whose mean is not the later one, has faded to 1e-11.
        blocks.append(FrequencyIndicator(silent, RATES, memory=0.04).process(z))
    small, large = blocks
    for name in RATES:
        assert np.array_equal(small.by_increments[name], large.by_increments[name], equal_nan=True)
        # Rounding of the products, over sin(theta) of the shortest lag that turns by a sixteenth.
        assert small.by_increments[name][-1] == pytest.approx(7.0, rel=1e-9, abs=0.0)
    assert np.array_equal(small.by_sensors, large.by_sensors, equal_nan=True)


@pytest.mark.parametrize("amplitude", [0.1, 1.0, 100.0])
@pytest.mark.parametrize("freq", [0.5, 10.0, 100.0])
def test_frequency_within_the_error_that_the_noise_leaves(freq: float, amplitude: float) -> None:
    """Sine through the believed responses plus white noise, 14.4 s, of whose start e^-18 is left in means of 0.8 s."""
    fs, memory = RATES["mhd_ars"], 0.8
    quiet = BELIEF["mems_gyro"].model_copy(update={"input_noise": 0.0, "output_noise": 1e-7})
    belief = {"mems_gyro": quiet, "mhd_ars": BELIEF["mhd_ars"]}
    z, level = {}, {}
    for name, rate in RATES.items():
        level[name] = amplitude * DEG * abs(belief[name].realisation().response(np.array([freq]))[0])
        noise = belief[name].output_noise * np.sqrt(rate) * random_stream(4, name).standard_normal(round(14.4 * rate))
        z[name] = sine(freq, level[name], noise.size, rate) + noise
    block = FrequencyIndicator(belief, RATES, memory=memory).process(z)
    R, n = belief["mhd_ars"].output_noise ** 2 * fs, 2.0 * memory * fs
    tau = next(lag for lag in LAGS_S if 2.0 * np.pi * freq * lag >= np.pi / 8.0)
    theta = 2.0 * np.pi * freq * tau
    # What the mean of the readings leaves of the line, the high-pass of the same memory.
    left = abs(1.0 / (1.0 + 1.0 / (2j * np.pi * freq * memory)))
    A, c = left * level["mhd_ars"], 2.0 - 2.0 * np.cos(theta)
    # Variances of the mean energies. Signal times noise: a reading's noise is weighed by at most four neighbours of the
    # signal (by the window, nothing need cancel), mean square 8 A^2; for the increments, c times larger in square, two
    # of them per reading. Noise times noise: three products of variance R^2, or (2 R)^2, each correlated with two more.
    of_signal = np.sqrt((8.0 * A**2 * R + 9.0 * R**2) / n) / (A * np.sin(theta)) ** 2
    of_increments = np.sqrt((32.0 * A**2 * c * R + 108.0 * R**2) / n) / (c * (A * np.sin(theta)) ** 2)
    error = c * (of_signal + of_increments) / (4.0 * np.pi * tau * np.sin(theta))
    assert block.by_increments["mhd_ars"][-1] == pytest.approx(freq, rel=1e-9, abs=6.0 * error)
    # The bound says something: a tenth of the frequency at the worst, which is 0.02 deg/s in the reading.
    assert 6.0 * error < 0.1 * freq
    if amplitude >= 1.0:
        # One percent of the ratio of powers is half a percent of frequency or less; the gyro has little left at 100 Hz.
        assert block.by_sensors[-1] == pytest.approx(freq, rel=0.02, abs=0.0)


@pytest.mark.parametrize("seed", range(5, 9))
def test_no_signal_has_no_frequency_from_the_first_reading_on(seed: int) -> None:
    """Whatever the constant beside the noise, even while the means hold few readings."""
    z = {
        name: DEG + BELIEF[name].output_noise * np.sqrt(fs) * random_stream(seed, name).standard_normal(round(2 * fs))
        for name, fs in RATES.items()
    }
    block = FrequencyIndicator(BELIEF, RATES).process(z)
    for values in (*block.by_increments.values(), block.by_sensors):
        assert np.isnan(values).all()


@pytest.mark.parametrize("bias_deg_s", [0.2, 20.0])
def test_a_constant_beside_a_line_does_not_change_its_frequency(bias_deg_s: float) -> None:
    """A tenth of a degree per second beside the bias of a gyro from the shelf."""
    fs = RATES["mems_gyro"]
    noise = BELIEF["mems_gyro"].output_noise * np.sqrt(fs) * random_stream(6, "noise").standard_normal(round(2 * fs))
    line = sine(10.0, 0.1 * DEG, noise.size) + noise
    plain, biased = (
        FrequencyRows(BELIEF, {"mems_gyro": fs}).process({"mems_gyro": z}, noise.size)["frequency_mems_gyro"]
        for z in (line, line + bias_deg_s * DEG)
    )
    there = np.isfinite(plain)
    assert there[noise.size // 2 :].all()
    # A mean of 2000 terms rounds by 2000 eps of the bias at the most; the ratio of energies doubles it.
    error = 2 * 2000 * np.finfo(float).eps * bias_deg_s / 0.1
    np.testing.assert_allclose(biased[there], plain[there], rtol=10 * error, atol=0.0)


def test_a_gap_has_no_frequency_once_its_readings_have_faded_and_the_next_line_is_seen_behind_it() -> None:
    fs = RATES["mems_gyro"]
    z = np.concatenate([sine(10.0, DEG, 4000), np.full(8000, np.nan), sine(25.0, DEG, 4000)])
    rows = FrequencyRows(BELIEF, {"mems_gyro": fs}).process({"mems_gyro": z}, z.size)["frequency_mems_gyro"]
    faded = 4000 + round(fs * np.log(1.0 / ENOUGH))
    assert np.isnan(rows[faded:12_000]).all()
    assert rows[5000] == pytest.approx(10.0, rel=1e-2, abs=0.0)
    # exp(-4) of what was, at a sixth of the weight per energy, is left when the gap ends; a second later e^-5.
    assert rows[14_000] == pytest.approx(25.0, rel=1e-2, abs=0.0)


@pytest.mark.parametrize("edges", [(1, 40, 9000), (333, 20_000)])
def test_blocks_of_any_length_give_the_same_bits(reference: Any, edges: tuple[int, ...]) -> None:
    z = reference.readings(reference.sines((4.0, 1.0), duration=2.0), 3)
    z["mhd_ars"][12_000:12_100], z["mems_gyro"][700] = np.nan, np.nan
    # Short means, so that the start has faded at the end.
    whole, stage = (FrequencyIndicator(BELIEF, RATES, memory=0.1) for _ in range(2))
    whole = whole.process(z)
    parts = [
        stage.process({"mems_gyro": z["mems_gyro"][-(-a // 10) : -(-b // 10)], "mhd_ars": z["mhd_ars"][a:b]})
        for a, b in zip((0, *edges), (*edges, 40_000), strict=True)
    ]
    for name in RATES:
        joined = np.concatenate([part.by_increments[name] for part in parts])
        assert np.array_equal(joined, whole.by_increments[name], equal_nan=True)
    assert np.array_equal(np.concatenate([part.by_sensors for part in parts]), whole.by_sensors, equal_nan=True)
    # The missing readings were left out, not taken for a signal.
    assert whole.by_increments["mhd_ars"][-1] == pytest.approx(4.0, rel=1e-3, abs=0.0)


def test_memory_and_margin_have_their_effect(reference: Any) -> None:
    """A late change is followed within a few memories; a signal below the margin is not one."""
    slow, fast = reference.sines((4.0, 1.0), duration=2.0), reference.sines((40.0, 1.0), duration=1.0)
    z = reference.readings(np.concatenate([slow, fast]), 3)
    short = FrequencyIndicator(BELIEF, RATES, memory=0.1).process(z).by_increments["mhd_ars"][-1]
    # After ten memories 5e-5 of the old energy is left; a longer memory would still hold both.
    assert short == pytest.approx(40.0, rel=1e-3, abs=0.0)
    assert np.isnan(FrequencyIndicator(BELIEF, RATES, margin=1e9).process(z).by_increments["mhd_ars"]).all()


def test_it_wants_two_sensors_with_rates_that_fit() -> None:
    with pytest.raises(ValueError, match="two sensors"):
        FrequencyIndicator(BELIEF, {"mhd_ars": 20000.0})
    with pytest.raises(ValueError, match="multiple of 2000 Hz"):
        FrequencyIndicator(BELIEF, {"mems_gyro": 500.0, "mhd_ars": 20000.0})


def test_a_block_may_be_empty() -> None:
    assert FrequencyIndicator(BELIEF, RATES).process({"mems_gyro": [], "mhd_ars": []}).by_sensors.size == 0


@pytest.mark.parametrize("wrong", [{"memory": 0.0}, {"memory": float("nan")}, {"margin": -1.0}])
def test_it_refuses_a_memory_or_margin_without_meaning(wrong: dict[str, float]) -> None:
    with pytest.raises(ValueError, match="memory, margin: expected"):
        FrequencyIndicator(BELIEF, RATES, **wrong)


def test_rows_are_those_of_each_sensor_at_its_readings_whatever_the_blocks() -> None:
    """A sensor of 3 kHz does not fit the lags and has none."""
    belief = BELIEF | {"odd": BELIEF["mems_gyro"]}
    z = {name: sine(50.0, 0.1, round(0.2 * fs), fs) for name, fs in RATES.items()}
    wanted = FrequencyIndicator(BELIEF, RATES).process(z).by_increments
    rows = FrequencyRows(belief, RATES | {"odd": 3000.0}).process(z, 4000)
    assert set(rows) == {"frequency_mems_gyro", "frequency_mhd_ars"} == set(FrequencyRows(BELIEF, RATES).blank(1))
    assert np.array_equal(rows["frequency_mhd_ars"], wanted["mhd_ars"], equal_nan=True)
    assert np.array_equal(rows["frequency_mems_gyro"][::10], wanted["mems_gyro"], equal_nan=True)
    assert np.isnan(rows["frequency_mems_gyro"].reshape(-1, 10)[:, 1:]).all()
    divided, parts = FrequencyRows(BELIEF, RATES), []
    for a, b in ((0, 3), (3, 11), (11, 4000)):
        given = {name: values[-(-a // step) : -(-b // step)] for name, step, values in _strided(z)}
        parts.append(divided.process(given, b - a))
    for key, row in rows.items():
        assert np.array_equal(np.concatenate([part[key] for part in parts]), row, equal_nan=True)


def _strided(z: dict[str, Any]) -> list[tuple[str, int, Any]]:
    return [(name, round(20000.0 / RATES[name]), values) for name, values in z.items()]
