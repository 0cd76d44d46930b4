from __future__ import annotations

import numpy as np
import pytest
from pydantic import ValidationError
from scipy.signal import welch

from testbed.sensors import load_preset
from testbed.sensors.mems_gyro import MemsGyro
from testbed.signals import transfer

REST = {"sample_rate": 2000.0, "range": 1.0, "sensitivity": 1e6}


def gyro(name: str) -> MemsGyro:
    sensor = load_preset(name)
    assert isinstance(sensor, MemsGyro)
    return sensor


@pytest.mark.oracle
def test_filtered_preset_is_equation_39() -> None:
    freq = np.geomspace(0.01, 1000.0, 50)
    wanted = transfer([154.537, 15.626], [5.2175, 148.0, 15.444], freq)
    np.testing.assert_allclose(gyro("adis16505_filtered").response(freq), wanted, rtol=1e-14)


@pytest.mark.oracle
def test_second_order_has_its_corner() -> None:
    crs03, adis = gyro("crs03"), gyro("adis16505")
    at_corner = crs03.response([10.0])[0]
    # At the natural frequency a second order turns by 90 deg and is 1 / (2 zeta).
    assert np.rad2deg(np.angle(at_corner)) == pytest.approx(-90.0, abs=1e-9)
    assert abs(at_corner) == pytest.approx(1.0 / 1.4, rel=1e-12)
    assert abs(adis.response([480.0])[0]) == pytest.approx(np.sqrt(0.5), rel=1e-12)
    assert crs03.response([0.0])[0] == 1.0


@pytest.mark.oracle
def test_data_sheet_units_convert_exactly() -> None:
    adis = gyro("adis16505_filtered")
    # 0.15 deg/sqrt(h) / 60 is deg/sqrt(s), the two-sided root density in deg/s/sqrt(Hz).
    assert adis.angle_random_walk == pytest.approx(np.deg2rad(0.15) / 60.0, rel=1e-12)
    assert adis.bias_instability == pytest.approx(np.deg2rad(2.7) / 3600.0, rel=1e-12)
    assert adis.rate_random_walk == pytest.approx(np.deg2rad(0.1) / 3600.0 / 60.0, rel=1e-12)
    assert 1.0 / adis.sensitivity == pytest.approx(np.deg2rad(1.0) / 2621440.0, rel=1e-12)
    assert adis.full_scale() == pytest.approx(np.deg2rad(500.0), rel=1e-12)


@pytest.mark.oracle
@pytest.mark.parametrize("name", ["adis16505_filtered", "adis16505"])
def test_noise_passes_the_low_pass(name: str) -> None:
    sensor = gyro(name)
    readings = sensor.sample(np.zeros(2_000_000), 20000.0, seed=6)
    freq, one_sided = welch(readings, 2000.0, nperseg=2000, detrend=False)
    for low, high in ((2, 6), (10, 30), (100, 200)):
        band = slice(low, high)
        images = np.arange(-5, 5)[:, None] * 2000.0
        folded = np.abs(freq[band] + images)
        # Everything that the reading clock folds in: |H|^2 at each image.
        power = np.abs(sensor.response(folded.ravel()).reshape(folded.shape)) ** 2
        density = sensor.angle_random_walk**2 * power.sum(axis=0) + (1.0 / sensor.sensitivity) ** 2 / 12.0 / 2000.0
        # 100 s in 1 s segments, half overlapped, Hann: at least 100 values per line of which neighbours share; 5 sigma.
        bound = 5.0 / np.sqrt(100.0 * (high - low) / 2.0)
        # Flicker at 2.7 deg/h is 1e-3 of the white noise at 2 Hz.
        assert abs(np.mean(one_sided[band] / 2.0 / density) - 1.0) < bound + 2e-3


@pytest.mark.oracle
def test_filtered_preset_has_the_noise_of_its_band() -> None:
    readings = gyro("adis16505_filtered").sample(np.zeros(1_000_000), 20000.0, seed=1)
    # N^2 integral |H|^2 df of (b1 s + b0)/(a2 s^2 + a1 s + a0) = (b1^2 a0 + b0^2 a2)/(2 a0 a1 a2); about 2 pi 4.5 Hz *
    # 50 s / 2 independent values; bias instability adds the square of 2.7 deg/h, 1e-2.
    variance = (
        (154.537**2 * 15.444 + 15.626**2 * 5.2175)
        / (2 * 15.444 * 148.0 * 5.2175)
        * gyro("adis16505").angle_random_walk ** 2
    )
    assert np.var(readings) == pytest.approx(variance, rel=5.0 * np.sqrt(2.0 / 700.0) + 0.02)


@pytest.mark.oracle
def test_noisy_preset_has_the_noise_of_table_1() -> None:
    readings = gyro("adis16505_filtered_noisy").sample(np.zeros(1_000_000), 20000.0, seed=1)
    # 700 independent values as above, in standard deviation.
    assert np.rad2deg(np.std(readings)) == pytest.approx(0.045, rel=5.0 * np.sqrt(0.5 / 700.0) + 0.001)


def test_readings_are_whole_counts() -> None:
    sensor = gyro("crs03")
    readings = sensor.sample(0.5 * np.sin(np.arange(20000) / 1000.0), 20000.0)
    counts = readings * sensor.sensitivity
    assert np.abs(counts - np.rint(counts)).max() < 1e-9


def test_range_may_be_the_word() -> None:
    short = MemsGyro.model_validate({**REST, "corner": 100.0, "word_bits": 8, "sensitivity": 1000.0})
    assert short.full_scale() == pytest.approx(0.127)


@pytest.mark.parametrize(
    ("keys", "message"),
    [
        ({}, "expected either numerator and denominator or corner"),
        ({"numerator": (1.0,)}, "expected either numerator and denominator or corner"),
        ({"numerator": (1.0,), "denominator": (1.0, 1.0), "corner": 1.0}, "expected either"),
        (
            {"numerator": (1.0, 1.0, 1.0), "denominator": (1.0, 1.0)},
            "numerator: expected at most the denominator's degree",
        ),
        ({"numerator": (1.0,), "denominator": (1.0, -1.0)}, "denominator: expected roots with negative real parts"),
        ({"corner": 10.0, "damping": 0.0}, "damping"),
        ({"corner": 10.0, "word_bits": 64}, "word_bits"),
        ({"corner": 10.0, "gian": 1.0}, "gian"),
    ],
)
def test_low_pass_is_checked(keys: dict[str, object], message: str) -> None:
    with pytest.raises(ValidationError, match=message):
        MemsGyro.model_validate({**REST, **keys})


def test_it_reads_at_most_as_often_as_there_are_samples() -> None:
    sensor = MemsGyro.model_validate({**REST, "sample_rate": 3000.0, "corner": 100.0})
    assert sensor.start(20000.0, 0, "gyro").process(np.zeros(20001)).size == 3000
    with pytest.raises(ValueError, match="sample_rate: expected 2000 Hz over a whole number, got 3000 Hz"):
        sensor.start(2000.0, 0, "gyro")
