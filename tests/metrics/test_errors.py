"""Metrics against closed forms."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.testing import assert_allclose

from testbed.metrics.errors import ErrorMetrics, floor_density, floor_rmse

FS = 2000.0
T = np.arange(20_000) / FS  # 10 s: whole periods of 0.5 and 10 Hz


def judged(estimate, truth, lines=(), std=None, t=T):
    metrics = ErrorMetrics(lines)
    metrics.add(t, estimate, truth, std)
    return metrics


def tone(amplitude, freq, phase=0.0, t=T):
    return amplitude * np.sin(2 * np.pi * freq * t + phase)


def test_rmse_includes_the_phase():
    """Equal sines, apart by phi: rms of the difference is A sqrt(1 - cos phi)."""
    phi = 0.3
    result = judged(tone(1.0, 10.0, phi), tone(1.0, 10.0), (10.0,)).result()
    assert result["rmse_deg_s"] == pytest.approx(np.rad2deg(np.sqrt(1 - np.cos(phi))), rel=1e-12)
    # A pure phase error vanishes once the phase is removed; the square root of a rounding residue is left.
    assert result["rmse_aligned_deg_s"] < 1e-6
    assert result["lines"] == [
        {
            "frequency_hz": 10.0,
            "gain": pytest.approx(1.0, abs=1e-12),
            "gain_ci95": None,
            "phase_ci95_deg": None,
            "phase_deg": pytest.approx(np.rad2deg(phi), abs=1e-10),
            # One line and nothing else: all of the error.
            "error_deg_s": pytest.approx(np.rad2deg(np.sqrt(1 - np.cos(phi))), rel=1e-9),
        }
    ]
    assert result["peak_error_deg_s"] == pytest.approx(np.rad2deg(2 * np.sin(phi / 2)), rel=1e-3)


def test_aligned_keeps_gain_error_noise_and_offset(rng):
    """rmse_aligned^2 = offset^2 + noise^2 + sum A^2 (|g| - 1)^2 / 2 for the definition's two lines."""
    noise = 0.01 * rng.standard_normal(T.size)
    estimate = tone(1.02, 0.5, 0.2) + tone(0.18 * 0.9, 10.0, -0.1) + 0.003 + noise
    result = judged(estimate, tone(1.0, 0.5) + tone(0.18, 10.0), (0.5, 10.0)).result()
    expected = np.sqrt(0.003**2 + 0.01**2 + 0.02**2 / 2 + (0.18 * 0.1) ** 2 / 2)
    # The noise power of n samples is known to sqrt(2/n): 4 sigma of it, weighted with its share.
    assert np.deg2rad(result["rmse_aligned_deg_s"]) == pytest.approx(expected, rel=4 * np.sqrt(2 / T.size))
    gains = [(line["gain"], line["phase_deg"]) for line in result["lines"]]
    # Standard error of a fitted amplitude: sigma sqrt(2/n) = 1e-4, over the amplitude of 0.18: 4 sigma are 2.3e-3.
    assert_allclose([g for g, _ in gains], [1.02, 0.9], atol=2.5e-3)
    assert_allclose([p for _, p in gains], np.rad2deg([0.2, -0.1]), atol=np.rad2deg(2.8e-3))


def test_error_of_a_line_is_its_own_and_what_is_on_no_line(rng):
    """sqrt(A^2 |g - 1|^2 / 2 + offset^2 + noise^2): the other line does not count."""
    noise = 0.01 * rng.standard_normal(T.size)
    estimate = tone(1.02, 0.5) + tone(0.18, 10.0, 0.1) + 0.003 + noise
    result = judged(estimate, tone(1.0, 0.5) + tone(0.18, 10.0), (0.5, 10.0)).result()
    rest = 0.003**2 + 0.01**2
    late = 0.18**2 * (1.0 - np.cos(0.1))
    found = np.deg2rad([line["error_deg_s"] for line in result["lines"]])
    # 4 sigma of the noise power, sqrt(2/n), and of the fitted amplitudes, 1e-4 each, against errors of 0.014 and 0.013.
    assert_allclose(found, np.sqrt([0.02**2 / 2 + rest, late + rest]), rtol=4 * 0.01)
    assert np.hypot(*found) ** 2 - rest == pytest.approx(np.deg2rad(result["rmse_deg_s"]) ** 2, rel=0.05)


def test_lines_are_separated_also_over_broken_periods():
    t = np.arange(3_333) / FS
    truth = tone(1.0, 0.5, t=t) + tone(0.2, 10.0, t=t)
    result = judged(tone(0.9, 0.5, 0.1, t) + tone(0.21, 10.0, t=t), truth, (0.5, 10.0), t=t).result()
    assert_allclose([line["gain"] for line in result["lines"]], [0.9, 1.05], rtol=1e-9)


def test_without_lines_aligned_is_undefined():
    result = judged(np.ones(T.size), np.zeros(T.size)).result()
    assert result["rmse_aligned_deg_s"] is None
    assert result["lines"] == []
    assert result["rmse_deg_s"] == pytest.approx(np.rad2deg(1.0))


def test_a_line_that_is_not_in_the_truth_has_no_gain():
    result = judged(tone(1.0, 5.0), np.zeros(T.size), (5.0,)).result()
    unknown = dict.fromkeys(("gain", "gain_ci95", "phase_deg", "phase_ci95_deg", "error_deg_s"))
    assert result["lines"] == [{"frequency_hz": 5.0, **unknown}]
    assert result["rmse_aligned_deg_s"] is None


def test_no_samples_and_nan_give_null():
    assert ErrorMetrics((1.0,)).result()["rmse_deg_s"] is None
    assert judged(np.full(T.size, np.nan), np.zeros(T.size)).result()["rmse_deg_s"] is None


def test_lost_readings_are_left_out_and_counted(rng):
    """The same as if the record had been taken at the other instants only; without gaps a NaN stays undefined."""
    truth = tone(1.0, 10.0)
    estimate = tone(1.02, 10.0, 0.1) + 0.01 * rng.standard_normal(T.size)
    lost = rng.random(T.size) < 0.1
    gappy = ErrorMetrics((10.0,), gaps=True)
    gappy.add(T, np.where(lost, np.nan, estimate), truth)
    result = gappy.result()
    assert result.pop("missing") == np.count_nonzero(lost)
    assert result == judged(estimate[~lost], truth[~lost], (10.0,), t=T[~lost]).result()
    assert judged(np.where(lost, np.nan, estimate), truth).result()["rmse_deg_s"] is None


def test_nothing_but_lost_readings_is_undefined():
    gappy = ErrorMetrics((), gaps=True)
    gappy.add(T, np.full(T.size, np.nan), np.zeros(T.size))
    assert gappy.result()["rmse_deg_s"] is None
    assert gappy.result()["missing"] == T.size


def test_consistency_counts_errors_within_two_std(rng):
    error = rng.standard_normal(T.size)
    result = judged(error, np.zeros(T.size), std=np.ones(T.size)).consistency()
    # Normal errors: 95.45 % within 2 sigma, known to sqrt(p (1 - p) / n); 4 sigma.
    assert result["inside_2_std"] == pytest.approx(0.9545, abs=4 * np.sqrt(0.9545 * 0.0455 / T.size))
    assert result["mean_std_deg_s"] == pytest.approx(np.rad2deg(1.0))


@pytest.mark.property
@pytest.mark.parametrize("n", [1, 777, 20_000])
def test_blocks_change_the_last_digits_only(n, rng):
    estimate, truth = tone(1.0, 0.5, 0.1) + 0.01 * rng.standard_normal(T.size), tone(1.0, 0.5)
    whole = judged(estimate, truth, (0.5,)).result()
    parts = ErrorMetrics((0.5,))
    size = max(n, 50) if n == 1 else n
    for a in range(0, T.size, size):
        parts.add(T[a : a + size], estimate[a : a + size], truth[a : a + size])
    for key in ("rmse_deg_s", "rmse_aligned_deg_s"):
        assert parts.result()[key] == pytest.approx(whole[key], rel=1e-9)


@pytest.mark.oracle
def test_floor_of_two_white_sensors_is_their_parallel_combination():
    """S_1, S_2 white: sqrt(2 W / (1/S_1 + 1/S_2))."""
    floor = floor_rmse([lambda f: np.full_like(f, 4e-14), lambda f: np.full_like(f, 1e-14)], 1000.0)
    assert floor == pytest.approx(np.sqrt(2 * 1000.0 / (1 / 4e-14 + 1 / 1e-14)), rel=1e-4)


@pytest.mark.oracle
def test_floor_of_a_high_pass_sensor_and_a_white_gyro():
    """S_m = n^2 (1 + (c/f)^2), S_g = g^2: 1/S = (A + f^2/(f^2 + c^2) B), whose inverse integrates in closed form.

    With k = sqrt(A/(A + B)) c: integral_0^W (f^2 + c^2)/((A + B) f^2 + A c^2) df = [W + (c^2 - k^2)/k atan(W/k)]/(A +
    B).
    """
    n, g, c, W = 1e-7, 4.4e-5, 2.48, 1000.0
    A, B = 1 / g**2, 1 / n**2
    k = np.sqrt(A / (A + B)) * c
    exact = (W + (c**2 - k**2) / k * np.arctan(W / k)) / (A + B)
    floor = floor_rmse([lambda f: n**2 * (1 + (c / f) ** 2), lambda f: np.full_like(f, g**2)], W)
    # Trapezoid with 200 points per decade: (ln 10 / 200)^2 / 12 = 1.1e-5 times a curvature of order one.
    assert floor == pytest.approx(np.sqrt(2 * exact), rel=1e-4)


def test_floor_is_undefined_where_no_sensor_sees():
    assert floor_rmse([], 100.0) is None
    assert floor_rmse([lambda f: np.full_like(f, np.inf)], 100.0) is None
    assert floor_density([lambda f: np.full_like(f, 2.0)] * 2, np.ones(1))[0] == 1.0
