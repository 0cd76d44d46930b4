"""Every shipped sensor preset keeps the contract."""

from __future__ import annotations

import typing
from itertools import pairwise

import numpy as np
import pytest
from numpy.testing import assert_allclose
from pydantic import BaseModel

from testbed.parts import preset, preset_names, resolve
from testbed.sensors import SENSORS, load_preset
from testbed.sensors.base import Sensor
from testbed.sensors.stages import ExposedStage, Surroundings, ThermalStage
from testbed.units import Quantity
from tests.examples.programs import example

PRESETS = preset_names("testbed.sensors")
# What is shipped, and what has no preset (a new type, the example) as it is without any parameter.
INSTRUMENTS = {name: load_preset(name) for name in PRESETS}
INSTRUMENTS |= {
    name: kind()
    for name, kind in {name: resolve("sensor", name, SENSORS) for name in SENSORS}.items()
    if not any(isinstance(shipped, kind) for shipped in INSTRUMENTS.values())
}
INSTRUMENTS["own_sensor"] = example("own_sensor").BandPass()
FS = 20_000.0

pytestmark = pytest.mark.contract


def record(n=20_000):
    t = np.arange(n) / FS
    rate = 0.02 * np.sin(2 * np.pi * 7.0 * t) * np.minimum(t / 0.1, 1.0)
    rate.flags.writeable = False
    return rate


def test_every_concrete_sensor_is_registered():
    shipped = {kind for kind in Sensor.__subclasses__() if kind.__module__.startswith("testbed.")}
    assert shipped <= {resolve("sensor", name, SENSORS) for name in SENSORS}


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


@pytest.mark.parametrize("name", INSTRUMENTS)
def test_readings_are_finite_repeatable_and_follow_the_seed(name):
    sensor, rate = INSTRUMENTS[name], record()
    first = sensor.sample(rate, FS, seed=3)
    assert np.isfinite(first).all()
    assert first.size == -(-rate.size // round(FS / sensor.sample_rate))
    assert np.array_equal(first, sensor.sample(rate, FS, seed=3))
    assert not np.array_equal(first, sensor.sample(rate, FS, seed=4))


@pytest.mark.parametrize("name", INSTRUMENTS)
@pytest.mark.parametrize("sizes", [[1, 9, 4990, 15_000], [777] * 25 + [575]], ids=["uneven", "odd"])
def test_any_blocks_give_the_same_bits(name, sizes):
    sensor, rate = INSTRUMENTS[name], record()
    stage = sensor.start(FS, 3, "sensor")
    cuts = np.cumsum([0, *sizes])
    parts = [stage.process(rate[a:b]) for a, b in pairwise(cuts)]
    assert np.array_equal(np.concatenate(parts), sensor.start(FS, 3, "sensor").process(rate))


@pytest.mark.parametrize("name", INSTRUMENTS)
def test_instances_have_streams_of_their_own(name):
    sensor, rate = INSTRUMENTS[name], np.zeros(20_000)
    a, b = (sensor.start(FS, 3, instance).process(rate) for instance in ("left", "right"))
    # n independent pairs correlate with a standard deviation of 1/sqrt(n); low-passed noise has fewer: count 2 per
    # hertz of 4.5 Hz at least.
    n_independent = min(a.size, 9)
    assert not np.array_equal(a, b)
    assert abs(np.corrcoef(np.diff(a), np.diff(b))[0, 1]) < 5 / np.sqrt(n_independent)


@pytest.mark.parametrize("name", INSTRUMENTS)
def test_noise_off_equals_the_response(name):
    """Steady state of a sine: gain and phase of `response`, within the hold between samples."""
    sensor = INSTRUMENTS[name].model_copy(update={"noise": False})
    freq, settle, n = 10.0, 30.0, 10
    t = np.arange(int((settle + n / freq) * FS)) / FS
    # The eq. (39) low-pass has a pole at 0.105 rad/s: a smooth start and 30 s of waiting leave exp(-3) of almost
    # nothing.
    readings = sensor.sample(0.01 * np.sin(2 * np.pi * freq * t) * np.clip(t / 5.0, 0, 1), FS)
    tr = np.arange(readings.size) / sensor.sample_rate
    last = tr >= settle
    # sin = Re(-j exp): the phasor of the input is -0.01 j.
    phasor = 2 * np.mean(readings[last] * np.exp(-2j * np.pi * freq * tr[last])) / -0.01j
    expected = sensor.response(np.array([freq]))[0]
    assert_allclose(phasor, expected, rtol=3e-4)


@pytest.mark.parametrize("name", INSTRUMENTS)
def test_input_noise_psd_is_positive_and_full_scale_is_held(name):
    sensor = INSTRUMENTS[name]
    assert np.all(sensor.input_noise_psd(np.logspace(-3, 2, 30)) > 0)
    quiet = sensor.model_copy(update={"noise": False})
    t = np.arange(20_000) / FS
    readings = quiet.sample(20 * sensor.full_scale() * np.sin(2 * np.pi * 8.0 * t), FS)
    assert np.max(np.abs(readings)) == pytest.approx(sensor.full_scale(), rel=1e-12)


@pytest.mark.parametrize("name", INSTRUMENTS)
def test_preset_survives_the_round_trip_through_its_resolved_form(name):
    sensor = INSTRUMENTS[name]
    written = sensor.model_dump(mode="json", context={"border": True}, exclude_none=True)
    assert type(sensor).model_validate(written, context={"border": True}) == sensor


@pytest.mark.parametrize("name", INSTRUMENTS)
def test_datasheet_is_rows_of_text(name):
    rows = INSTRUMENTS[name].datasheet()
    assert all(isinstance(text, str) and text for row in rows for text in row)
    assert len(dict(rows)) == len(rows)


# What a key needs beside it to mean something, by sensor type.
COMPANIONS = {
    "markov_time": {"markov_bias": 1e-3},
    "lowest_frequency": {"bias_instability": 1e-3, "noise_knee": 1.0},
    "damping": {"corner": 50.0, "numerator": None, "denominator": None},
    "corner": {"corner": 50.0, "numerator": None, "denominator": None},
    "numerator": {"corner": None, "numerator": (1.0,), "denominator": (0.01, 1.0)},
    "denominator": {"corner": None, "numerator": (1.0,), "denominator": (0.01, 1.0)},
    "reference_temperature": {"bias_temperature": 1e-3, "linear": 1e-6},
    "hysteresis": {"half_width": (4.0, 12.0)},
    "half_width": {"hysteresis": (1e-6, 1e-6), "half_width": (4.0, 12.0)},
    "coil_lag": {"linear": 1e-6, "shupe": 1e-4},
    "spool_lag": {"gradient": 1e-6},
    "core_lag": {"hysteresis": (1e-6, 1e-6), "half_width": (4.0, 12.0)},
    "load_fraction": {"closure": "radial_field"},
    "scatter": {"linear": 1e-6},
}
# Keys whose changed value is no neighbour of the old one.
VALUES = {
    "numerator": (0.9,),
    "denominator": (0.02, 1.0),
    "corner": 77.0,
    "fir": "average",
    "noise": False,
    "channel.fluid": "galinstan",
    # Short-circuited, `axial_field` is `local`.
    "channel.closure": "radial_field",
    "channel.load_fraction": 0.5,
    "channel.nodes": 40,
    "jitter": 1e-4,
    # Beyond the count of a 16-bit word within the record.
    "rate_random_walk": 1e-3,
    "rate_ramp": 0.1,
    "scale_factor_asymmetry": 0.1,
    "scale_factor_temperature": 1e-3,
    # So that the signal below, up to 0.02 rad/s, reaches them.
    "range": 0.01,
    "adc_range": 0.5,
    "word_bits": 2,
    "adc_bits": 12,
    "sample_rate": 500.0,
    "dead_band": 0.005,
    "dropped": 0.2,
    "faults": [{"kind": "rail", "at": 0.0, "length": 1.0}],
    "clock": {"error": 0.05},
    "lost": {"bursts": {"every": 1e-3, "length": 0.1}},
    # A second moves the core of a fibre-optic gyro by millikelvins: no half-width but zero is left.
    "thermal.half_width": (0.0, 0.0),
    "thermometer.lag": 1e-3,
    # Blocks that are left out by default; the ring is so small that its Johnson noise shows beside the 18-bit word.
    "scale_factor_error": 0.01,
    "ring": {"width": 1e-4, "radius": 1e-4},
    "transformer": {"magnetizing_inductance": 1e-5, "source_resistance": 2e-5},
    "saturation": {"limit": 0.01},
    "anti_alias": {"corner": 4000.0, "order": 4},
}


# Where it sits is a matter of the plant; what its data sheet says of its noise is compared with it, and no more; the
# secondary flow of 1 deg/s is below a word of the converter (tests/models/mhd_channel/test_similarity.py shows it).
UNHEARD = {"mounting", "total_rms_noise", "channel.flow"}


def changed(field, value):
    """Return a value of a field that is another one: its half if it has a size, or else the example of its unit."""
    if isinstance(value, bool):
        return not value
    if isinstance(value, int):
        return value + 1
    if isinstance(value, float) and value:
        return 0.5 * value
    if isinstance(value, tuple):
        return tuple(changed(None, v) if v else 1e-3 for v in value)
    quantities = [m for m in (field.metadata if field else []) if isinstance(m, Quantity)]
    quantities += (
        [m for a in typing.get_args(field.annotation) for m in getattr(a, "__metadata__", ())] if field else []
    )
    return next(m.example for m in quantities if isinstance(m, Quantity))


def keys(part, prefix=""):
    """Yield the dotted names of all fields of a parameter set, nested ones too."""
    for name in type(part).model_fields:
        value = getattr(part, name)
        if isinstance(value, BaseModel) and name not in {"mounting", "fluid"}:
            yield from keys(value, f"{prefix}{name}.")
        else:
            yield prefix + name


def with_change(sensor, key, *, change):
    """Return the sensor with the companions of `key`, and the key itself changed or not."""
    *parents, name = key.split(".")
    part = sensor
    for parent in parents:
        part = getattr(part, parent)
    values = {k: v for k, v in COMPANIONS.get(name, {}).items() if k in type(part).model_fields}
    if change:
        values[name] = VALUES[key] if key in VALUES else changed(type(part).model_fields[name], getattr(part, name))
    part = type(part).model_validate({**part.model_dump(), **values})
    for parent in reversed(parents):
        part = type(sensor).model_validate({**sensor.model_dump(), parent: part.model_dump()})
    return part


def output(sensor):
    """Return readings in rich surroundings, those of a thermometer inside, and the response."""
    rate = np.abs(record())
    around = Surroundings(np.outer(rate, [1, -2]), np.outer(1 + rate, [1, 2, 3]), 310.0 + 100 * rate)
    stage = sensor.start(FS, 1, "sensor")
    readings = stage.process_in(rate, around) if isinstance(stage, ExposedStage) else stage.process(rate)
    readings = sensor.start_losses(1, "sensor").process(sensor.start_faults().process(readings))
    temperature = stage.temperature if isinstance(stage, ThermalStage) else np.empty(0)
    return readings, temperature, sensor.response(np.array([1.0, 100.0]))


@pytest.mark.parametrize(
    ("name", "key"),
    [
        (name, key)
        for name, sensor in INSTRUMENTS.items()
        for key in keys(sensor)
        # A scenario refuses a clock for what takes none.
        if key not in UNHEARD and (key != "clock" or sensor.any_clock)
    ],
)
def test_every_key_changes_the_output(name, key):
    """No key is silently ignored: each changes readings or response of each preset (where it sits: see the plant's
    tests).
    """
    sensor = INSTRUMENTS[name]
    if key.endswith("_drift"):
        sensor = sensor.model_copy(update={"temperature": 310.0})
    before, after = (output(with_change(sensor, key, change=change)) for change in (False, True))
    same = all(np.array_equal(a, b, equal_nan=True) for a, b in zip(before, after, strict=True))
    assert not same


def test_the_check_of_keys_sees_an_ignored_one(monkeypatch):
    from testbed.sensors.gyro_errors import GyroErrors

    monkeypatch.setattr(GyroErrors, "distort", lambda self, rate, around: rate)
    with pytest.raises(AssertionError):
        test_every_key_changes_the_output("crs03", "g_sensitivity")
