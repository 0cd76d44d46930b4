"""Noise behind a low-pass at the rate of its readings: its density is the sum over the aliases, nothing else."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from scipy.signal import welch

from testbed.sensors import load_preset, noise, sampled_noise
from testbed.sensors.mems_gyro import MemsGyro
from testbed.sensors.mhd_ars import MhdArs
from testbed.sensors.noise_terms import continuous_flicker
from testbed.sensors.sampled_noise import Rational, SampledNoise, Shape, run_sampled, sampled
from testbed.signals import transfer

FLICKER = Shape(poles=tuple(continuous_flicker(1e-4, 2e4)[0]), gains=tuple(continuous_flicker(1e-4, 2e4)[1]))
SHAPES = {
    "white": Shape(white=1.0),
    "flicker": FLICKER,
    "walk": Shape(poles=(0.0,), gains=(1.0,)),
    "markov": Shape(poles=(0.01,), gains=(0.1,)),
    "angle": Shape(white=1.0, slope=True),
}
# Their two-sided densities.
DENSITY = {
    "white": np.ones_like,
    "flicker": lambda f: 1.0 / (2.0 * np.pi * f),
    "walk": lambda f: (2.0 * np.pi * f) ** -2.0,
    "markov": lambda f: 0.01 / ((2.0 * np.pi * f) ** 2 + 1e-4),
}
ALIASES = np.arange(-400, 401)


def butterworth(corner: float) -> Rational:
    w = 2.0 * np.pi * corner
    return Rational((w**2,), (1.0, math.sqrt(2.0) * w, w**2))


EQ39 = Rational((154.537, 15.626), (5.2175, 148.0, 15.444))


def folded(name: str, passed: Rational, freq: Any, fs: float) -> Any:
    """Sum over the aliases of |H|^2 S at f + k fs, H as it is bounded for a derivative."""
    images = np.abs(freq[:, None] + ALIASES * fs)
    numerator, denominator = passed.bounded(slope=SHAPES[name].slope)
    # The derivative is in the numerator already.
    density = np.ones_like if SHAPES[name].slope else DENSITY[name]
    gain = np.abs(transfer(numerator, denominator, images.ravel()).reshape(images.shape))
    return (gain**2 * density(images)).sum(axis=1)


def density_of(system: sampled_noise.Sampled, freq: Any, fs: float) -> Any:
    """|c (z - F)^-1 L|^2 T of the joint system."""
    m, n = system.decay.size, len(system.F)
    joint = np.block([[np.diag(system.decay), np.zeros((m, n))], [system.M, system.F]])
    root, out = np.vstack([system.Lv, system.Lx]), np.concatenate([np.zeros(m), system.c])
    z = np.exp(2j * np.pi * freq / fs)
    paths = [out @ np.linalg.solve(each * np.eye(m + n) - joint, root) for each in z]
    return (np.abs(np.array(paths)) ** 2).sum(axis=1) / fs


@pytest.mark.oracle
@pytest.mark.parametrize("name", SHAPES)
@pytest.mark.parametrize(
    ("passed", "fs"),
    [(EQ39, 2000.0), (butterworth(480.0), 2000.0), (butterworth(98.0), 200.0), (butterworth(480.0), 20000.0)],
    ids=["eq39", "480", "98", "run"],
)
def test_density_is_the_sum_over_the_aliases(name: str, passed: Rational, fs: float) -> None:
    freq = np.concatenate([np.geomspace(3e-4, fs / 2, 60), np.linspace(0.02, 0.5, 25) * fs])
    got = density_of(sampled(SHAPES[name], passed, fs), freq, fs)
    # Directions of less than 0.5 % are left out; flicker keeps to 1/f within 0.3 %.
    assert np.abs(got / folded(name, passed, freq, fs) - 1.0).max() < 0.01


@pytest.mark.oracle
def test_continuous_flicker_is_one_over_f() -> None:
    freq = np.geomspace(1e-4, 2e4, 3000)
    gain = (np.array(FLICKER.gains) / (2j * np.pi * freq[:, None] + np.array(FLICKER.poles))).sum(axis=1)
    assert np.abs(10.0 * np.log10(np.abs(gain) ** 2 * 2.0 * np.pi * freq)).max() < 0.05


@pytest.mark.oracle
def test_start_is_stationary_and_a_walk_begins_at_zero() -> None:
    passed = butterworth(98.0)
    first = np.array(
        [
            SampledNoise(sampled(Shape(white=1.0), passed, 200.0), np.random.default_rng(s)).process(1)[0]
            for s in range(4000)
        ]
    )
    # Two-sided noise bandwidth of a second-order Butterworth: pi/sqrt(2) times its corner; 5 sigma of 4000 values.
    assert np.mean(first**2) == pytest.approx(math.pi / math.sqrt(2.0) * 98.0, rel=5.0 * math.sqrt(2.0 / 4000.0))
    walk = SampledNoise(sampled(SHAPES["walk"], passed, 200.0), np.random.default_rng(1)).process(1)
    assert walk[0] == 0.0


@pytest.mark.oracle
def test_kernel_equals_its_plain_twin() -> None:
    system = sampled(FLICKER, butterworth(480.0), 2000.0)
    w = np.random.default_rng(2).standard_normal((3000, system.Lx.shape[1]))
    m = system.decay.size
    v, x, y = np.ones(m), np.ones(len(system.F)), np.empty(3000)
    run_sampled(v, x, system.decay, system.F, system.M, system.Lv, system.Lx, system.c, w, y)
    v, x, wanted = np.ones(m), np.ones(len(system.F)), []
    for each in w:
        wanted.append(system.c @ x)
        v, x = system.decay * v + system.Lv @ each, system.F @ x + system.M @ v + system.Lx @ each
    # Sums of 20 numbers in another order, over the memory of the low-pass.
    np.testing.assert_allclose(y, wanted, rtol=0, atol=1e-12 * np.abs(wanted).max())


def test_a_low_pass_with_a_direct_path_has_the_power_of_the_base_clock() -> None:
    # All of white noise passes: its band is that of 20 kHz, so its variance is 20 000.
    system = sampled(Shape(white=1.0), Rational((1.0,), (1.0,)), 2000.0)
    power = np.sum((system.start_x.T @ system.c) ** 2)
    assert power == pytest.approx(20_000.0, rel=1e-9)


def gyro(**keys: Any) -> MemsGyro:
    return MemsGyro.model_validate({"range": 10.0, "sensitivity": 1e8, **keys})


def measured(sensor: Any, n: int, fs: float, input_rate: float) -> tuple[Any, Any, float]:
    """Frequencies, two-sided density of the readings over them in bands of 12 lines, and 5 sigma of its ratio."""
    readings = sensor.start(input_rate, 4, "sensor").process(np.zeros(round(n * input_rate / fs)))
    freq, one_sided = welch(readings, fs, nperseg=256, detrend=False)
    lines = slice(3, 123)
    # Segments half overlapped under a Hann window are worth 0.95 of the record's own; lines share their neighbours.
    spread = 5.0 / math.sqrt(0.9 * n / 256 * 12 / 1.5)
    return freq[lines], one_sided[lines] / 2.0, spread


def banded(ratio: Any) -> Any:
    return ratio.reshape(-1, 12).mean(axis=1)


@pytest.mark.oracle
@pytest.mark.parametrize(
    ("keys", "fs"),
    [
        ({"corner": 480.0, "angle_random_walk": 1e-4}, 2000.0),
        ({"corner": 98.0, "angle_random_walk": 1e-4}, 200.0),
        ({"corner": 98.0, "bias_instability": 1e-4}, 200.0),
        ({"corner": 98.0, "quantization": 1e-5, "sensitivity": 1e5}, 200.0),
        ({"corner": 5000.0, "angle_random_walk": 1e-4}, 20000.0),
    ],
    ids=["white", "slow", "flicker", "angle and rounding", "fast"],
)
def test_readings_have_the_density_that_the_sensor_claims(keys: dict[str, Any], fs: float) -> None:
    sensor = gyro(sample_rate=fs, **keys)
    freq, got, spread = measured(sensor, 4_000_000, fs, fs)
    images = np.abs(freq[:, None] + ALIASES * fs)
    rounding = 1.0 / sensor.sensitivity**2 / 12.0 / fs
    seen = np.abs(sensor.response(images.ravel())).reshape(images.shape) ** 2
    # What is referred to the input holds the rounding, which is no alias: taken out, folded, put back.
    claimed = ((sensor.input_noise_psd(images.ravel()).reshape(images.shape) * seen) - rounding).sum(axis=1) + rounding
    assert spread < 0.015
    assert np.abs(banded(got / claimed) - 1.0).max() < 0.006 + spread


@pytest.mark.oracle
def test_behind_a_fir_the_noise_passes_its_weights() -> None:
    sensor = gyro(sample_rate=2000.0, corner=480.0, angle_random_walk=1e-4, fir="average")
    freq, got, spread = measured(sensor, 400_000, 2000.0, 20000.0)
    # Folded at 20 kHz in front of the weights, then by the clock; `response` has both.
    images = np.abs(freq[:, None] + np.arange(-5, 5) * 2000.0)
    seen = np.abs(sensor.response(images.ravel())).reshape(images.shape) ** 2
    claimed = 1e-8 * seen.sum(axis=1) + 1.0 / sensor.sensitivity**2 / 12.0 / 2000.0
    assert np.abs(banded(got / claimed) - 1.0).max() < 0.006 + spread


@pytest.mark.oracle
@pytest.mark.parametrize("fs", [20000.0, 5000.0])
@pytest.mark.parametrize(
    "blocks", [{}, {"anti_alias": {"corner": 4000.0, "order": 4}}, {"saturation": {"limit": 1.0}}], ids=str
)
def test_johnson_noise_has_the_density_of_its_electronics(blocks: dict[str, Any], fs: float) -> None:
    preset = load_preset("mhd03")
    # Loud, so that it shows beside the rounding of the converter.
    ring = {"width": 1e-4, "radius": 1e-4}
    values = {**preset.model_dump(), "noise_density": 0.0, "sample_rate": fs, "adc_bits": 32, "ring": ring, **blocks}
    sensor = MhdArs.model_validate(values)
    freq, got, spread = measured(sensor, 400_000, fs, 20000.0)
    images = np.abs(freq[:, None] + np.arange(-40, 41) * fs)
    slip = np.abs(sensor.warm_channel.response(images.ravel()).reshape(images.shape))
    electronics = np.abs(sensor.response(images.ravel()).reshape(images.shape)) / slip
    claimed = sensor.johnson_noise**2 * (electronics**2).sum(axis=1)
    assert np.abs(banded(got / claimed) - 1.0).max() < 0.006 + spread


def check_white_density() -> None:
    test_readings_have_the_density_that_the_sensor_claims({"corner": 480.0, "angle_random_walk": 1e-4}, 2000.0)


PLANTS = {
    "drawn for another rate": lambda shape, passed, fs: sampled(shape, passed, 2.0 * fs),
    "one-sided taken for two-sided": lambda shape, passed, fs: sampled(
        replace(shape, white=shape.white * math.sqrt(2.0)), passed, fs
    ),
    "another low-pass": lambda shape, passed, fs: sampled(shape, butterworth(440.0), fs),
}


@pytest.mark.parametrize("plant", PLANTS)
def test_the_density_sees_a_planted_mistake(plant: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(noise, "sampled", PLANTS[plant])
    with pytest.raises(AssertionError):
        check_white_density()


def test_the_density_sees_noise_without_its_aliases(monkeypatch: pytest.MonkeyPatch) -> None:
    """Noise at 2 kHz through the low-pass, as between straight lines: sinc^4 of it is left, and no alias."""
    from testbed.signals import LinearFilter, random_stream

    class Joined:
        def __init__(self, *_: Any) -> None:
            w = 2.0 * np.pi * 480.0
            self._stream = random_stream(4, "sensor", "angle_random_walk")
            self._filter = LinearFilter([w**2], [1.0, math.sqrt(2.0) * w, w**2], 2000.0)

        def process(self, n_time: int) -> Any:
            return self._filter.process(self._stream.standard_normal(n_time) * 1e-4 * math.sqrt(2000.0))

    monkeypatch.setattr(noise, "SampledNoise", Joined)
    with pytest.raises(AssertionError):
        check_white_density()
