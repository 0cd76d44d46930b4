"""`check` in seconds and bounded memory: sizes, durations and bands beyond measure, what is seen of long runs."""

from __future__ import annotations

import itertools
import shutil
import time

import numpy as np
import pytest

import testbed
from testbed.errors import ScenarioError
from testbed.models.turntable.realisation import MOST_POINTS, gaussian_rate, grid, periodic_spline
from testbed.scenario.peaks import command_peaks, windows
from tests.scenes import short

SINE = "- sine: {frequency: 10 Hz, rate: 1 deg/s}"
FLOOR = "{floor: {bands: [{axis: rz, low: LOW, high: HIGH, angular_acceleration_psd: 1e-6 (rad/s^2)^2/Hz}]}}"


def floor(low, high):
    return ("{preset: air_bearing}", FLOOR.replace("LOW", low).replace("HIGH", high))


TABLE = {
    "1e9 s": (("duration: 0.5 s", "duration: 1e9 s"), "at most 5.498e+07 s"),
    "1e300 s": (("duration: 0.5 s", "duration: 1e300 s"), "magnitude"),
    "1e29 s": (("duration: 0.5 s", "duration: 1e29 s"), "at most 5.498e+07 s"),
    **{
        f"noise {low} to {high}": ((SINE, f"- random: {{psd: 1e-6 (deg/s)^2/Hz, low: {low}, high: {high}}}"), "points")
        for low, high in (("99.99999999 Hz", "100 Hz"), ("1e-12 Hz", "1e-3 Hz"), ("1 Hz", "1.0000001 Hz"))
        if low != "1e-12 Hz"
    },
    "olympus": ((SINE, "- platform_psd: {spectrum: olympus, low: 99.99999 Hz, high: 100 Hz}"), "points"),
    "floor": (floor("99.99999999 Hz", "100 Hz"), "points"),
    "slow gyro": (("preset: adis16505_filtered", "preset: adis16505_filtered, sample_rate: 1e-9 Hz"), "at least 0.005"),
    "many filters": (
        ("  kalman: {}\n", "  kalman: {}\n" + "".join(f"  k{i}: {{type: kalman}}\n" for i in range(70))),
        "at most 64",
    ),
    "poles": (
        ("  kalman: {}", f"  kalman: {{belief: {{mhd_ars: {{numerator: [1], denominator: {[1] * 500}}}}}}}"),
        "at most 33",
    ),
    "delay": (("preset: sx300", "preset: sx300, delay: 1e12 us"), "at most 1.0 s"),
    "delay of a belief": (
        ("  kalman: {}", "  kalman: {belief: {mhd_ars: {numerator: [1], denominator: [1], delay: 1e12 us}}}"),
        "at most 1.0 s",
    ),
    "latency": (("fusion:", "pointing: {mirror: {bandwidth: 1 kHz, latency: 1e12 us}}\nfusion:"), "at most 1.0 s"),
    "offset of a clock": (
        ("preset: adis16505_filtered", "preset: adis16505_filtered, clock: {offset: 1e12 s}"),
        "at most 3600.0 s",
    ),
    **{
        f"temperature {value}": (("duration: 0.5 s", f"duration: 0.5 s\ntemperature: {value}"), "at most 1000.0 K")
        for value in ("1e30 K", "1e6 K", "1000 degC", "{start: 20 degC, steps: [{ramp: 1e6 K, over: 1 s}]}")
    },
    "temperature of a sensor": (("preset: sx300", "preset: sx300, temperature: 1e12 K"), "at most 1000.0 K"),
    **{
        f"drift {value}": (("preset: sx300", f"preset: sx300, channel: {{field_drift: {value} 1/K}}"), bound)
        for value, bound in (("1e30", "at most 1.0"), ("-2", "at least -1.0"))
    },
    **{
        f"step {value}": (("{preset: air_bearing}", f"{{mode: {mode}, step: {value}}}"), bound)
        for value, bound in (("1e30 s", "at most 0.01 s"), ("50 s", "at most 0.01 s"), ("1e-12 s", "at least 1e-07 s"))
        for mode in ("ideal", "servo", "fixed")
    },
    "sojourn": (("  kalman: {}", "  kalman: {type: imm, sojourn: 1e15 s}"), "at most 1000000.0 s"),
    "ratios": (("  kalman: {}", "  kalman: {type: imm, ratios: [1.0e-300, 1]}"), "ratios.0"),
}


@pytest.mark.parametrize("name", TABLE)
def test_what_is_beyond_measure_is_refused_in_seconds(tmp_path, name):
    edit, message = TABLE[name]
    begin = time.process_time()
    with pytest.raises(ScenarioError) as caught:
        short(tmp_path, edit)
    assert time.process_time() - begin < 5.0
    assert message in str(caught.value)


# Values that are each within their bounds and together no instrument.
NO_INSTRUMENTS = {
    "knee at the sample rate": ("mhd_ars", "preset: sx300", "preset: sx300, lowest_frequency: 10 kHz"),
    "a field beyond all": ("mhd_ars", "preset: sx300", "preset: sx300, channel: {field: 1e30 T}"),
    "a fluid that boils off": (
        "mhd_ars",
        "preset: sx300",
        "preset: sx300, temperature: 900 K, channel: {fluid: FLUID}",
    ),
}
FLUID = "{density: 13534 kg/m^3, viscosity: 1 mPa*s, viscosity_drift: -1 1/K, conductivity: 1e6 S/m}"


@pytest.mark.parametrize("name", NO_INSTRUMENTS)
def test_values_that_are_no_instrument_together_are_a_finding_of_the_sensor(tmp_path, name):
    sensor, given, edit = NO_INSTRUMENTS[name]
    with pytest.raises(ScenarioError) as caught:
        short(tmp_path, (given, edit.replace("FLUID", FLUID)))
    assert {problem.key for problem in caught.value.problems} == {f"sensors.{sensor}"}
    assert all(problem.line for problem in caught.value.problems)


@pytest.mark.parametrize("bits", [8, 12, 14])
def test_a_coarse_encoder_at_standstill_is_named_as_the_cause(tmp_path, bits):
    """One count, 2 pi / 2^bits, times the gain of the loop; not the motion, which there is none of."""
    table = f"{{mode: digital, digital: {{encoder_bits: {bits}}}}}"
    with pytest.raises(ScenarioError) as caught:
        short(tmp_path, ("{preset: air_bearing}", table), (SINE, "- static: {}"))
    (problem,) = caught.value.problems
    assert problem.key == "turntable.digital.encoder_bits"
    assert f"{1e6 * 2 * np.pi / 2**bits:.3g} urad" in problem.message
    assert "take more bits" in problem.message


def test_a_long_run_is_seen_from_its_first_to_its_last_step(tmp_path):
    for n_time in (1, 100, 5_000_000, 10**9, 1 << 40):
        for cost in (4, 100, 20_000):
            found = list(windows(n_time, cost))
            assert found[0][0] == 0
            assert sum(found[-1]) == n_time
            assert sum(length for _, length in found) * cost <= 2.1 * 24_000_000
            assert all(a + n <= b for (a, n), (b, _) in itertools.pairwise(found))


def test_windows_find_the_peak_of_a_sine(tmp_path):
    """An hour of 10 Hz: every window of a second has whole periods, so the peak is found."""
    whole, hour = (command_peaks(short(tmp_path, ("duration: 0.5 s", f"duration: {t}"))) for t in ("2 s", "1 h"))
    assert hour.rate == pytest.approx(whole.rate, rel=1e-9)
    assert hour.torque == pytest.approx(whole.torque, rel=1e-3)


@pytest.mark.oracle
@pytest.mark.parametrize("n", [30, 64, 1001])
def test_the_spline_by_lines_is_the_one_through_the_points(n):
    """SciPy's periodic interpolation solves for the same coefficients; its condition is 7.5, eps times that and n."""
    from scipy.interpolate import make_interp_spline

    rng = np.random.default_rng(1)
    x, period, t = rng.standard_normal(n), 3.7, rng.uniform(-4.0, 8.0, 500)
    ours = periodic_spline(np.fft.rfft(x), n, period)
    theirs = make_interp_spline(np.arange(n + 1) * (period / n), np.append(x, x[0]), k=5, bc_type="periodic")
    np.testing.assert_allclose(ours(t), theirs(t), atol=1e-11)


def test_the_most_noise_fits_its_memory():
    """At the limit: the points are no more than allowed by more than the next good length of a transform."""
    duration = MOST_POINTS / 16.0 / 100.0 / 1.05 * 0.999
    assert grid((1.0, 100.0), duration)[1] <= 1.01 * MOST_POINTS
    with pytest.raises(ScenarioError, match="lower the upper edge"):
        gaussian_rate(np.ones_like, (1.0, 100.0), 1.01 * duration, np.random.default_rng(0))


def test_a_run_that_the_disk_cannot_hold_is_refused_and_leaves_nothing(tmp_path, monkeypatch):
    usage = shutil.disk_usage(tmp_path)
    monkeypatch.setattr(shutil, "disk_usage", lambda _place: usage._replace(free=1_000_000))
    with pytest.raises(ScenarioError, match=r"takes about 0\.00\d+ GB, but its disk has room for 0\.001 GB") as caught:
        testbed.run(short(tmp_path), out=tmp_path / "run")
    assert caught.value.problems[0].file == str(tmp_path / "run")
    assert [path.name for path in tmp_path.iterdir()] == ["short.yaml"]


@pytest.mark.parametrize("block", [0.0, -1.0, float("inf"), float("nan")])
def test_a_block_that_is_no_length_is_refused(tmp_path, block):
    with pytest.raises(ValueError, match="block: expected more than 0 s"):
        testbed.run(short(tmp_path), block=block)
