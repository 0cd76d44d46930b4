"""Crossover, noise budget and the optimum of real instruments, against closed forms."""

from __future__ import annotations

import numpy as np
import pytest

from testbed.judging.budget import (
    budget_summary,
    crossovers,
    noise_budget,
)
from testbed.metrics.errors import floor_density, floor_rmse
from testbed.scenario.beliefs import believed
from testbed.sensors import load_preset

DEG = np.pi / 180.0
SENSORS = {"mems_gyro": load_preset("adis16505_filtered"), "mhd_ars": load_preset("sx300")}
RATES = {"mems_gyro": 2000.0, "mhd_ars": 20000.0}


@pytest.mark.oracle
def test_crossover_of_white_noise_behind_a_high_pass():
    """N^2 = n^2 (1 + (f_c / f)^2) at f = f_c / sqrt((N / n)^2 - 1)."""
    N, n, corner = 4e-5, 1e-7, 2.4
    found = crossovers(lambda f: np.full(f.shape, N**2), lambda f: n**2 * (1.0 + (corner / f) ** 2))
    # 500 points per decade, straight in logarithm between them.
    assert found == pytest.approx([corner / np.sqrt((N / n) ** 2 - 1.0)], rel=1e-4)
    assert crossovers(lambda f: np.ones(f.shape), lambda f: np.full(f.shape, 2.0)).size == 0


@pytest.mark.oracle
def test_budget_of_two_white_sensors():
    """Equal ones share evenly; with densities 1 and 3 the weights are 3/4 and 1/4, so the variances are 9/16 and 3/16
    per hertz.
    """
    budget = noise_budget({"a": lambda f: np.ones(f.shape), "b": lambda f: np.full(f.shape, 3.0)}, [1.0, 2.0, 6.0])
    # Trapezoid in ln f of f itself: (h^2 / 12) relative, h = ln(3) / 399.
    np.testing.assert_allclose(budget["a"], 2.0 * 9.0 / 16.0 * np.array([1.0, 4.0]), rtol=1e-6)
    np.testing.assert_allclose(budget["b"], 2.0 * 3.0 / 16.0 * np.array([1.0, 4.0]), rtol=1e-6)


def test_budget_adds_up_to_the_floor():
    psds = {name: sensor.input_noise_psd for name, sensor in SENSORS.items()}
    total = sum(part.sum() for part in noise_budget(psds, np.logspace(-6, 3, 10)).values())
    # `floor_rmse` takes the density as constant below 1e-6 Hz; both by trapezoids of at least 200 points per decade.
    total += 2.0 * 1e-6 * floor_density(list(psds.values()), np.array([1e-6]))[0]
    assert np.sqrt(total) == pytest.approx(floor_rmse(list(psds.values()), 1000.0), rel=1e-3)


@pytest.mark.oracle
def test_summary_of_a_white_gyro_and_a_high_pass():
    """S_g = N^2, S_m = (a / f)^2: weights f_x^2 / (f^2 + f_x^2) and the rest, crossover f_x = a / N, all bands in
    closed form.
    """
    N, crossing = 1e-5, 0.05
    psds = {
        "gyro": lambda f: np.full(f.shape, N**2),
        "mhd": lambda f: (N * crossing / f) ** 2,
    }
    found = budget_summary(psds, 300.0)
    assert found["crossovers_hz"] == pytest.approx([crossing], rel=1e-4)
    assert [band["low_hz"] for band in found["bands"]] == [0.0, 1e-3, 1e-2, 0.1, 1.0, 10.0, 100.0]
    assert found["bands"][-1]["high_hz"] == 300.0

    # With x = f / f_x: 2 N^2 / (1 + x^2)^2 and 2 N^2 x^2 / (1 + x^2)^2, whose integrals are (atan x +- x / (1 + x^2)) /
    # 2.
    def leaves(f, sign):
        x = f / crossing
        return N**2 * crossing * (np.arctan(x) + sign * x / (1.0 + x**2))

    for band in found["bands"]:
        for name, sign in (("gyro", 1.0), ("mhd", -1.0)):
            variance = leaves(band["high_hz"], sign) - leaves(band["low_hz"], sign)
            # The first band is integrated from 1e-6 Hz: 1e-3 of its variance; above f_x the closed form cancels.
            wanted = pytest.approx(np.rad2deg(np.sqrt(variance)), rel=2e-3, abs=1e-12)
            assert band["sensors_deg_s"][name] == wanted
        whole = np.sqrt(sum(value**2 for value in band["sensors_deg_s"].values()))
        assert band["floor_deg_s"] == pytest.approx(whole, rel=1e-12)
    at = np.array(found["frequency_hz"])
    assert found["densities"]["mhd"] == pytest.approx(np.rad2deg(N * crossing / at), rel=1e-12)


def test_a_crossing_above_a_better_third_sensor_is_none():
    psds = {
        "a": lambda f: 1.0 + f**2,
        "b": lambda f: 2.0 + 0.0 * f,
        "best": lambda f: 0.1 + 0.0 * f,
    }
    assert budget_summary(psds, 100.0)["crossovers_hz"] == []
    del psds["best"]
    assert budget_summary(psds, 100.0)["crossovers_hz"] == pytest.approx([1.0], rel=1e-4)


@pytest.mark.parametrize("edges", [[1.0], [0.0, 1.0], [2.0, 1.0]])
def test_edges_that_make_no_bands_are_refused(edges):
    with pytest.raises(ValueError, match="edges_hz: expected"):
        noise_budget({"a": np.ones_like}, edges)


def test_an_instrument_is_believed_to_be_what_it_is():
    gyro, mhd = believed(SENSORS["mems_gyro"]), believed(SENSORS["mhd_ars"])
    freq = np.logspace(-1, 2.9, 40)
    for sensor, belief in ((SENSORS["mems_gyro"], gyro), (SENSORS["mhd_ars"], mhd)):
        np.testing.assert_allclose(belief.realisation().response(freq), sensor.response(freq), rtol=1e-3)
    # Noise of the presets; the 18-bit step adds 0.7 % of variance, the 1/f knee of 0.1 Hz 1 % of the mean from 1 Hz up.
    assert gyro.input_noise == pytest.approx(0.15 / 60.0 * DEG, rel=0.02, abs=0.0)
    assert mhd.output_noise == pytest.approx(1e-7, rel=0.02, abs=0.0)
    assert mhd.input_noise < 1e-9


def test_a_gyro_that_is_a_resonance_is_believed():
    resonant = SENSORS["mems_gyro"].model_copy(
        update={"numerator": None, "denominator": None, "corner": 80.0, "damping": 0.1}
    )
    assert len(believed(resonant).denominator) == 3
