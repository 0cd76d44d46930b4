"""A fibre-optic gyro in a scenario: the clock of a held base, its thermometer in the results, injected rate, a thermal
day.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from scipy.signal import cont2discrete, lfilter

import testbed
from testbed.errors import ScenarioError
from testbed.judging.allan_records import read_run
from testbed.models.temperature import TemperatureProfile

CYCLE = Path(__file__).parents[2] / "scenarios/fog/thermal_cycle.yaml"
SCENE = """
name: held
duration: 2000 s
bandwidth: 0.5 Hz
temperature: {start: 20 degC, steps: [{hold: 100 s}, {ramp: 40 degC, rate: 1 K/min}]}
turntable: {mode: fixed}
motion:
  - static: {}
sensors:
  fog: {preset: fog_paper3, sample_rate: 1 Hz}
"""


def load(tmp_path, *edits):
    text = SCENE
    for old, new in edits:
        assert old in text
        text = text.replace(old, new)
    path = tmp_path / "held.yaml"
    path.write_text(text)
    return testbed.load_scenario(path)


@pytest.mark.parametrize(
    ("edit", "base"),
    [
        (("x", "x"), 1.0),
        (("1 Hz}", "100 Hz}"), 100.0),
        (("1 Hz}", "1 Hz}\n  second: {preset: fog_paper3, sample_rate: 4 Hz}"), 4.0),
        (("1 Hz}", "1 Hz}\n  mems_gyro: {preset: adis16505}"), 20_000.0),
        (("mode: fixed", "mode: ideal"), 20_000.0),
    ],
)
def test_a_held_base_runs_at_the_clock_that_its_sensors_ask_for(tmp_path, edit, base):
    scenario = load(tmp_path, ("2000 s", "1 s"), edit)
    run = testbed.run(scenario)
    assert scenario.base_rate_hz == base
    assert run.truth.rate.size == base
    assert np.array_equal(run.truth.time, np.arange(base) / base)


def test_clocks_that_do_not_fit_are_refused(tmp_path):
    with pytest.raises(ScenarioError, match="expected 3 Hz divided by a whole number"):
        load(tmp_path, ("1 Hz}", "3 Hz}\n  second: {preset: fog_paper3, sample_rate: 2 Hz}"))
    with pytest.raises(ScenarioError, match="multiple of the base step 1e\\+06 us"):
        load(tmp_path, ("2000 s", "2000.5 s"))
    with pytest.raises(ScenarioError, match="but fog at 1 Hz sees only what is below"):
        load(tmp_path, ("static: {}", "sine: {frequency: 0.5 Hz, rate: 1 deg/h}"))


def test_temperature_and_drift_are_results_in_memory_and_on_disk(tmp_path):
    scenario = load(tmp_path)
    run, stored = testbed.run(scenario), testbed.run(scenario, out=tmp_path / "run")
    ambient = scenario.frame.temperature.at(0, 2000, 1.0)
    sensor = scenario.sensors["fog"]
    assert np.array_equal(run.truth.fog_drift, sensor.thermal.bias(ambient, 1.0))
    assert run.sensors["fog"].temperature.shape == run.sensors["fog"].rate.shape == (2000,)
    for name in ("rate", "temperature"):
        assert np.array_equal(run.sensors["fog"][name], stored.sensors["fog"][name])
    assert np.array_equal(run.truth.fog_drift, stored.truth.fog_drift)
    page = (tmp_path / "run/report.html").read_text()
    assert 'aria-label="Temperature and thermal drift"' in page
    import h5py

    with h5py.File(tmp_path / "run/run.nc") as file:
        units = {name: file[name].attrs["units"] for name in ("sensors/fog/temperature", "truth/fog_drift")}
    assert units == {"sensors/fog/temperature": "K", "truth/fog_drift": "rad/s"}


def test_any_block_gives_the_same_bits(tmp_path):
    scenario = load(tmp_path)
    whole, parts = testbed.run(scenario), testbed.run(scenario, block=333.0)
    for name in ("rate", "temperature"):
        assert np.array_equal(whole.sensors["fog"][name], parts.sensors["fog"][name])
    assert np.array_equal(whole.truth.fog_drift, parts.truth.fog_drift)


def test_allan_takes_the_thermal_bias_off(tmp_path):
    """The record for `testbed allan` is the noise: the reading less the noise-free one at the same temperatures."""
    scenario = load(tmp_path)
    testbed.run(scenario, out=tmp_path / "run")
    record = read_run(tmp_path / "run")[0]
    noise = scenario.sensors["fog"].start(1.0, scenario.frame.seed, "fog").process(np.zeros(2000))
    # The noise was added to rates of 1e-6 rad/s.
    np.testing.assert_allclose(record.rate, noise, rtol=0, atol=1e-20)


@pytest.mark.oracle
def test_injected_rate_is_read_as_it_is(tmp_path):
    """Earth rate, a step and sines of 10 s, 10 min, 6 h through `motion`, noise off, at the reference temperature."""
    freq = [0.1, 1 / 600, 1 / 21_600]
    edits = [
        ("{start: 20 degC, steps: [{hold: 100 s}, {ramp: 40 degC, rate: 1 K/min}]}", "20 degC"),
        ("mode: fixed", "mode: fixed, earth_rate: {latitude: 45 deg}"),
        ("2000 s", "43200 s\nramp_in: 0 s"),
        ("1 Hz}", "1 Hz, noise: off, bandwidth: 1 MHz}"),
        (
            "  - static: {}",
            "  - constant: {rate: 0.05 deg/h}\n"
            + "".join(f"  - sine: {{frequency: {f!r} Hz, rate: 1 deg/h}}\n" for f in freq),
        ),
    ]
    run = testbed.run(load(tmp_path, *edits))
    hour, t = np.deg2rad(1.0) / 3600.0, np.arange(43_200.0)
    earth = 7.292115e-5 * np.sin(np.pi / 4)
    wanted = earth + hour * (0.05 + sum(np.sin(2 * np.pi * f * t) for f in freq))
    # The low-pass of 1 MHz is 0.2 us behind: 1e-7 of the change of the fastest sine.
    np.testing.assert_allclose(run.sensors["fog"].rate, wanted, rtol=0, atol=2e-6 * hour)
    lines = run.metrics["sensors"]["fog"]["lines"]
    assert [line["gain"] for line in lines] == pytest.approx([1.0] * 3, abs=1e-6)


@pytest.mark.oracle
def test_it_rides_on_the_table_like_the_others(tmp_path):
    """20 kHz truth, 400 Hz readings, mode ideal; at 25 degC the scale factor has grown by 5 K times 10 ppm/K."""
    text = CYCLE.parents[1].joinpath("static.yaml").read_text()
    text = text.replace("duration: 20 s", "duration: 1 s").replace("settle: 10 s", "settle: 0.5 s").split("expect:")[0]
    text = text.replace("sensors:\n", "sensors:\n  fog: {preset: fog_paper3, noise: off}\n").split("fusion:")[0]
    text = text.replace("static: {}", "sine: {frequency: 8 Hz, rate: 1 deg/s}").replace(
        "air_bearing}", "air_bearing, mode: ideal}"
    )
    path = tmp_path / "table.yaml"
    path.write_text(text)
    scenario = testbed.load_scenario(path)
    run = testbed.run(scenario)
    line = run.metrics["sensors"]["fog"]["lines"][0]
    response = scenario.sensors["fog"].response(np.array([8.0]))[0]
    assert line["gain"] == pytest.approx(abs(response) * (1 + 5e-5), rel=1e-6)
    assert line["phase_deg"] == pytest.approx(np.angle(response, deg=True), abs=1e-3)


def lag(tau, u):
    """Filter with 1 / (tau s + 1) at 20 kHz, straight between samples."""
    numerator, denominator, _ = cont2discrete(([1.0], [tau, 1.0]), 1.0 / 20_000.0, method="foh")
    return lfilter(numerator.ravel(), denominator, u)


@pytest.mark.oracle
def test_it_rides_on_the_moving_table_of_mode_servo(tmp_path):
    """400 Hz readings of a table that a motor turns, while its room warms, beside the sensors that it shares the table
    with.

    Reference: scipy's low-pass over the truth of 20 kHz and means of 50 samples, written here. Two identical gyros, one
    silent: the difference is the noise of the preset, of variance N^2/T + 2 Q^2/T^2 and a little 1/f noise.
    """
    text = CYCLE.parents[1].joinpath("static.yaml").read_text().split("fusion:")[0]
    text = text.replace("duration: 20 s", "duration: 2 s\ntemperature: {start: 20 degC, stop: 50 degC, over: 2 s}")
    text = text.replace("settle: 10 s", "settle: 0.5 s").replace("air_bearing}", "air_bearing, mode: servo}")
    text = text.replace(
        "sensors:\n", "sensors:\n  fog: {preset: fog_paper3}\n  silent: {preset: fog_paper3, noise: off}\n"
    )
    path = tmp_path / "servo.yaml"
    path.write_text(text.replace("static: {}", "sine: {frequency: 8 Hz, rate: 1 deg/s}"))
    scenario = testbed.load_scenario(path)
    run = testbed.run(scenario)
    assert {name: run.sensors[name].rate.size for name in ("fog", "silent")} == {"fog": 800, "silent": 800}
    # The servo leaves an error that mode ideal does not have.
    assert run.truth.rate.std() > 0.1 * np.radians(1.0)
    command = np.radians(1.0) * np.sin(2.0 * np.pi * 8.0 * run.truth.time)
    assert np.abs(run.truth.rate - command)[20_000:].max() > 1e-4 * np.radians(1.0)

    fog, true_rate = scenario.sensors["fog"], run.truth["silent_rate"]
    ambient = scenario.frame.temperature.at(0, true_rate.size, 20_000.0)
    heat = lag(fog.thermal.coil_lag, ambient - 293.15)
    felt = (1.0 + fog.scale_factor_temperature * heat) * true_rate + fog.thermal.bias(ambient, 20_000.0)
    passed = lag(1.0 / (2.0 * np.pi * fog.bandwidth), felt)
    expected = passed[1 : 1 + 799 * 50].reshape(-1, 50).mean(axis=1)
    # From rest instead of settled at the first sample: gone after 50 time constants of 0.5 ms; then rounding of 1
    # deg/s.
    np.testing.assert_allclose(run.sensors["silent"].rate[11:], expected[10:], rtol=0, atol=1e-9 * np.radians(1.0))

    noise = run.sensors["fog"].rate - run.sensors["silent"].rate
    white = fog.angle_random_walk**2 * 400.0 + 2.0 * fog.quantization**2 * 400.0**2
    # Five standard deviations of a variance of 800 readings; 1/f noise adds less than one part in a hundred.
    assert np.var(noise) == pytest.approx(white, rel=5.0 * np.sqrt(2.0 / 800.0) + 0.01, abs=0.0)


def test_the_shipped_cycle_is_the_papers_programme():
    scenario = testbed.load_scenario(CYCLE)
    assert scenario.n_time == 85_200
    again = TemperatureProfile.model_validate(scenario.resolved()["temperature"], context={"border": True})
    assert again == scenario.frame.temperature
    T = again.at(0, 85_201, 1.0) - 273.15
    assert [T[0], T[7200], T[31_200], T[85_200]] == pytest.approx([20, 20, 60, -30], abs=1e-9)
    drift = scenario.sensors["fog"].thermal.bias(T[:-1] + 273.15, 1.0)
    assert np.rad2deg(np.std(drift)) * 3600.0 == pytest.approx(0.096, abs=1e-3)


def test_a_day_is_drawn_in_hours():
    from matplotlib.figure import Figure

    from testbed.pages.axes import time_axis

    axes = Figure().subplots()
    axes.set_xlim(0, 85_200)
    time_axis(axes, 85_200.0)
    marks = [f"{axes.xaxis.get_major_formatter()(t, 0)}" for t in axes.xaxis.get_majorticklocs() if 0 <= t <= 85_200]
    assert marks == [str(h) for h in range(0, 24, 2)]
    assert axes.get_xlabel() == "time [h]"


def test_the_terminal_shows_small_errors_in_degrees_per_hour_and_no_empty_column(tmp_path, capsys):
    from testbed.cli.terminal import print_metrics

    run = testbed.run(load(tmp_path))
    print_metrics(run.metrics, tmp_path)
    printed = capsys.readouterr().out
    assert "error against the truth in deg/h" in printed
    assert f"{3600.0 * run.metrics['sensors']['fog']['rmse_deg_s']:.4g}" in printed
    assert "claimed std" not in printed
