"""Every shipped sensor preset keeps the contract."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import pytest
from numpy.testing import assert_allclose

from testbed.parts import preset, preset_names, resolve
from testbed.sensors import SENSORS, load_preset
from testbed.sensors.base import Sensor

PRESETS = preset_names("testbed.sensors")
FS = 20_000.0

pytestmark = pytest.mark.contract


def record(n=20_000):
    t = np.arange(n) / FS
    rate = 0.02 * np.sin(2 * np.pi * 7.0 * t) * np.minimum(t / 0.1, 1.0)
    rate.flags.writeable = False
    return rate


def test_every_concrete_sensor_is_registered():
    assert set(Sensor.__subclasses__()) <= {resolve("sensor", name, SENSORS) for name in SENSORS}


@pytest.mark.parametrize("name", PRESETS)
def test_preset_names_its_type_and_every_value_its_source(name):
    from importlib import resources

    assert preset("testbed.sensors", name)["type"] in SENSORS
    text = (resources.files("testbed.sensors") / "presets" / f"{name}.yaml").read_text()
    for line in text.splitlines():
        if line and not line.startswith("#"):
            assert "#" in line or line.startswith("type:") or line.rstrip().endswith(":"), (
                f"no source or 'assumed': {line!r}"
            )


@pytest.mark.parametrize("name", PRESETS)
def test_readings_are_finite_repeatable_and_follow_the_seed(name):
    sensor, rate = load_preset(name), record()
    first = sensor.sample(rate, FS, seed=3)
    assert np.isfinite(first).all()
    assert first.size == -(-rate.size // round(FS / sensor.sample_rate))
    assert np.array_equal(first, sensor.sample(rate, FS, seed=3))
    assert not np.array_equal(first, sensor.sample(rate, FS, seed=4))


@pytest.mark.parametrize("name", PRESETS)
@pytest.mark.parametrize("sizes", [[1, 9, 4990, 15_000], [777] * 25 + [575]], ids=["uneven", "odd"])
def test_any_blocks_give_the_same_bits(name, sizes):
    sensor, rate = load_preset(name), record()
    stage = sensor.start(FS, 3, "sensor")
    cuts = np.cumsum([0, *sizes])
    parts = [stage.process(rate[a:b]) for a, b in pairwise(cuts)]
    assert np.array_equal(np.concatenate(parts), sensor.start(FS, 3, "sensor").process(rate))


@pytest.mark.parametrize("name", PRESETS)
def test_instances_have_streams_of_their_own(name):
    sensor, rate = load_preset(name), np.zeros(20_000)
    a, b = (sensor.start(FS, 3, instance).process(rate) for instance in ("left", "right"))
    # n independent pairs correlate with a standard deviation of 1/sqrt(n); low-passed noise has fewer: count 2 per hertz of 4.5 Hz at least.
    n_independent = min(a.size, 9)
    assert not np.array_equal(a, b)
    assert abs(np.corrcoef(np.diff(a), np.diff(b))[0, 1]) < 5 / np.sqrt(n_independent)


@pytest.mark.parametrize("name", PRESETS)
def test_noise_off_equals_the_response(name):
    """Steady state of a sine: gain and phase of `response`, within the hold between samples."""
    sensor = load_preset(name).model_copy(update={"noise": False})
    freq, settle, n = 10.0, 30.0, 10
    t = np.arange(int((settle + n / freq) * FS)) / FS
    # The eq. (39) low-pass has a pole at 0.105 rad/s: a smooth start and 30 s of waiting leave exp(-3) of almost nothing.
    readings = sensor.sample(0.01 * np.sin(2 * np.pi * freq * t) * np.clip(t / 5.0, 0, 1), FS)
    tr = np.arange(readings.size) / sensor.sample_rate
    last = tr >= settle
    # sin = Re(-j exp): the phasor of the input is -0.01 j.
    phasor = 2 * np.mean(readings[last] * np.exp(-2j * np.pi * freq * tr[last])) / -0.01j
    expected = sensor.response(np.array([freq]))[0]
    assert_allclose(phasor, expected, rtol=3e-4)


@pytest.mark.parametrize("name", PRESETS)
def test_input_noise_psd_is_positive_and_full_scale_is_held(name):
    sensor = load_preset(name)
    assert np.all(sensor.input_noise_psd(np.logspace(-3, 2, 30)) > 0)
    quiet = sensor.model_copy(update={"noise": False})
    t = np.arange(20_000) / FS
    readings = quiet.sample(20 * sensor.full_scale() * np.sin(2 * np.pi * 8.0 * t), FS)
    assert np.max(np.abs(readings)) == pytest.approx(sensor.full_scale(), rel=1e-12)


@pytest.mark.parametrize("name", PRESETS)
def test_preset_survives_the_round_trip_through_its_resolved_form(name):
    sensor = load_preset(name)
    written = sensor.model_dump(mode="json", context={"border": True}, exclude_none=True)
    assert type(sensor).model_validate(written, context={"border": True}) == sensor
