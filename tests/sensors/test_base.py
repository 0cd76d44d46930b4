from __future__ import annotations

import numpy as np
import pytest

from testbed.errors import UnknownNameError
from testbed.models.turntable.parameters import Mounting
from testbed.parts import preset_names
from testbed.sensors import SENSORS, load_preset
from testbed.sensors.base import Sensor
from testbed.sensors.converter import Converter
from testbed.sensors.decimation import Decimator, rate_ratio
from testbed.sensors.mems_gyro import MemsGyro

PRESETS = preset_names("testbed.sensors")


@pytest.mark.contract
@pytest.mark.parametrize("name", PRESETS)
def test_every_preset_is_an_instrument(name: str) -> None:
    sensor = load_preset(name)
    assert isinstance(sensor, Sensor)
    assert sensor.full_scale() > 0.0
    freq = np.array([0.01, 1.0, 100.0])
    assert sensor.response(freq).shape == (3,)
    assert np.all(sensor.input_noise_psd(freq) > 0.0)


@pytest.mark.contract
@pytest.mark.parametrize("name", PRESETS)
def test_reading_std_is_about_that_of_the_readings_at_rest(name: str) -> None:
    """Within a factor of two of their steps over root two, which slow noise does not reach."""
    sensor = load_preset(name)
    steps = np.diff(sensor.sample(np.zeros(1000 * round(20_000.0 / sensor.sample_rate)), 20_000.0))
    assert sensor.reading_std / 2.0 < np.std(steps) / np.sqrt(2.0) < 2.0 * sensor.reading_std


def test_presets_cover_every_sensor() -> None:
    assert {type(load_preset(name)).__module__ for name in PRESETS} == {t.split(":")[0] for t in SENSORS.values()}


def test_unknown_preset_gives_the_nearest() -> None:
    with pytest.raises(UnknownNameError, match="did you mean 'sx300'"):
        load_preset("sx30")


@pytest.mark.contract
@pytest.mark.oracle
@pytest.mark.parametrize("name", PRESETS)
@pytest.mark.parametrize("freq", [1.0, 10.0, 100.0, 900.0])
def test_noise_off_equals_the_response(name: str, freq: float) -> None:
    sensor = load_preset(name).model_copy(update={"noise": False})
    if (2.0 * freq / sensor.sample_rate).is_integer():
        pytest.skip("half the sample rate, where a sine has no phase")
    settle, periods = 4.0, max(round(freq), 1)
    t = np.arange(round(20000.0 * (settle + periods / freq))) / 20000.0
    # A sine begins at its mean, with which the sensor is in equilibrium.
    readings = sensor.sample(0.1 * np.sin(2.0 * np.pi * freq * t), 20000.0)
    tail = readings[round(sensor.sample_rate * settle) :]
    t_tail = settle + np.arange(tail.size) / sensor.sample_rate
    basis = np.stack(
        [np.cos(2 * np.pi * freq * t_tail), np.sin(2 * np.pi * freq * t_tail), np.ones(t_tail.size)], axis=1
    )
    a, b, _ = np.linalg.lstsq(basis, tail, rcond=None)[0]
    # A straight line between samples loses (pi f T)^2 / 3 of a low-passed tone and its images add up to half of that
    # (0.01 at 900 Hz); four seconds leave e^-60 of the MHD channel's start and 1e-4 of the filtered gyro's slow pole
    # (zero at 0.1 rad/s almost on it).
    hold = (np.pi * freq / 20000.0) ** 2 / 2.0
    assert abs((b + 1j * a) / 0.1 - sensor.response(np.array([freq]))[0]) < hold + 1e-3 * 0.1 + 1e-6


@pytest.mark.contract
@pytest.mark.parametrize("name", PRESETS)
def test_noise_is_repeatable_and_belongs_to_seed_and_name(name: str) -> None:
    sensor = load_preset(name)
    still = np.zeros(2000)
    record = sensor.start(20000.0, 1, "a").process(still)
    assert np.array_equal(record, sensor.start(20000.0, 1, "a").process(still))
    assert not np.array_equal(record, sensor.start(20000.0, 2, "a").process(still))
    assert not np.array_equal(record, sensor.start(20000.0, 1, "b").process(still))


@pytest.mark.parametrize("name", PRESETS)
def test_saturation_at_full_scale(name: str) -> None:
    for noise in (True, False):
        sensor = load_preset(name).model_copy(update={"noise": noise})
        t = np.arange(20000) / 20000.0
        readings = sensor.sample(3.0 * sensor.full_scale() * np.sin(2 * np.pi * 5.0 * t), 20000.0)
        # The highest code of a two's complement word is one count short of the lowest.
        assert readings.max() == pytest.approx(sensor.full_scale(), rel=2.0**-14)
        assert readings.min() == pytest.approx(-sensor.full_scale(), rel=2.0**-14)
        assert readings.max() <= sensor.full_scale()


@pytest.mark.parametrize("word", [("off", False), ("on", True), (False, False)])
def test_noise_is_a_switch(word: tuple[object, bool]) -> None:
    gyro = MemsGyro.model_validate(
        {"sample_rate": 2000.0, "corner": 50.0, "range": 1.0, "sensitivity": 1e6, "noise": word[0]}
    )
    assert gyro.noise is word[1]
    assert gyro.mounting == Mounting()


def test_sample_refuses_a_matrix() -> None:
    with pytest.raises(ValueError, match=r"rate: expected shape \(n_time,\), got \(2, 2\)"):
        load_preset("sx300").sample(np.zeros((2, 2)), 20000.0)


@pytest.mark.parametrize(("input_rate", "rate", "ratio"), [(20000.0, 20000.0, 1), (20000.0, 2000.0, 10), (0.3, 0.1, 3)])
def test_rate_ratio(input_rate: float, rate: float, ratio: int) -> None:
    assert rate_ratio(input_rate, rate) == ratio


@pytest.mark.parametrize("rate", [3000.0, 40000.0, 19999.0])
def test_rate_ratio_refuses_fractions(rate: float) -> None:
    with pytest.raises(ValueError, match="sample_rate: expected 20000 Hz over a whole number, got"):
        rate_ratio(20000.0, rate)


@pytest.mark.parametrize("cuts", [[1], [0, 1, 2, 3], [10], [3, 4, 5, 29]])
def test_decimator_keeps_its_clock_across_blocks(cuts: list[int]) -> None:
    samples = np.arange(31.0)
    decimator = Decimator(10)
    taken = np.concatenate([decimator.process(block) for block in np.split(samples, cuts)])
    assert np.array_equal(taken, [0.0, 10.0, 20.0, 30.0])


def test_converter_rounds_to_the_nearest_count_and_saturates() -> None:
    converter = Converter(0.25, 4, 10.0, rounding=True)
    values = np.array([0.0, 0.1249, 0.1251, -0.3, 1.9, -1.9, -2.1, 99.0, np.nan])
    wanted = np.array([0.0, 0.0, 0.25, -0.25, 1.75, -2.0, -2.0, 1.75, np.nan])
    assert np.array_equal(converter.process(values), wanted, equal_nan=True)
    smooth = Converter(0.25, 4, 1.5, rounding=False)
    assert np.array_equal(smooth.process(np.array([0.1, 9.0, -9.0])), [0.1, 1.5, -1.5])
