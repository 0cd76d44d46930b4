"""Checks of noise and instruments, run on the real code and on code with a well-known simulator's mistake planted.

A check that passes on the mistake would be no check. The defects are published ones; their plants and checks below:

======================================  ===============================================
================================ where                                   defect
check that fails on it
======================================  ===============================================
================================ NaveGo                                  rate random walk in steps of K dt
check_rate_random_walk RocketPy                                precedence makes the random walk white
check_rate_random_walk RocketPy                                unit in prose only
check_units gnss-ins-sim                            input density changed in place
check_inputs_unchanged gnss-ins-sim                            noise repeats every 16384 samples
check_no_period gnss-ins-sim                            custom profile overwrites the built-in one
check_presets_apart Basilisk                                noise per step, so it depends on the task rate
check_angle_random_walk,
                                                                                         check_rate_of_the_task
Basilisk                                two instruments share a seed                     check_streams, check_axes
Pegasus, PX4, RotorS, S2E, Elodin       wrong time constant                              check_markov
Pegasus, PX4, RotorS, S2E, Elodin       bias added every step                            check_markov, check_turn_on
Pegasus, PX4, RotorS, S2E, Elodin       misspelt key silently ignored                    check_unknown_key
Pegasus, PX4, RotorS, S2E, Elodin       key without effect                               check_every_key_counts
Pegasus, PX4, RotorS, S2E, Elodin       one random number on three axes                  check_axes
Pegasus, PX4, RotorS, S2E, Elodin       one key of the generator for two terms           check_streams
Isaac Lab, Gazebo                       wrong dt: sensor rate is not the physics rate    check_dynamics_at_two_rates,
                                                                                         check_rate_of_the_task
Isaac Lab, Gazebo                       every n-th value taken without a filter          check_aliasing
MuJoCo sysid.apply_delay                writes into its input                            check_inputs_unchanged
======================================  ===============================================
================================
"""

from __future__ import annotations

import functools
import itertools
import math
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest
from pydantic import ConfigDict, ValidationError
from scipy import stats

from testbed import sensors, units
from testbed.allan import allan_deviation
from testbed.allan import curve as allan
from testbed.allan.freedom import equivalent_freedom
from testbed.sensors import base, load_preset, mems_gyro, noise, noise_terms
from testbed.sensors.sampled_noise import sampled
from testbed.signals import LinearFilter, random_stream

if TYPE_CHECKING:
    from collections.abc import Callable

    from testbed.signals import FloatArray

RATES = (100.0, 2000.0, 20000.0)
N, B, K, Q = 4e-5, 1e-5, 1e-5, 1e-6
FULL = {"quantization": Q, "angle_random_walk": N, "bias_instability": B, "rate_random_walk": K, "markov_bias": B}


def check_allan(term: str, value: float, exponent: int) -> None:
    """Compare with the closed-form Allan variance at three averaging times, the same at three sample rates."""
    n = 200_000
    for fs, m in itertools.product(RATES, (16, 64, 256)):
        tau = m / fs
        wanted = {
            "quantization": 3.0 * value**2 / tau**2,
            "angle_random_walk": value**2 / tau,
            "bias_instability": 2.0 * math.log(2.0) / math.pi * value**2,
            # A walk in steps: the continuous K^2 tau / 3 times 1 + 1/(2 m^2).
            "rate_random_walk": value**2 * tau / 3.0 * (1.0 + 0.5 / m**2),
        }[term]
        record = noise.GyroNoise(**{term: value}).sample(n, fs, 11)
        got = allan_deviation(record, fs, [tau]).deviation[0] ** 2
        # 5 standard deviations of a variance with these degrees of freedom (an upper bound for bounded, uniform
        # errors); the flicker's 1/f holds to 0.05 dB = 1.2 %, and averaging 16 samples instead of continuously is worth
        # 1/m^2 = 0.4 %.
        spread = 5.0 * math.sqrt(2.0 / equivalent_freedom(m, n + 1, exponent))
        assert abs(got / wanted - 1.0) < spread + 0.016 * (term == "bias_instability"), (fs, m, got / wanted)


def check_quantization() -> None:
    check_allan("quantization", Q, 2)


def check_angle_random_walk() -> None:
    check_allan("angle_random_walk", N, 0)


def check_bias_instability() -> None:
    check_allan("bias_instability", B, -1)


def check_rate_random_walk() -> None:
    check_allan("rate_random_walk", K, -2)


def check_rate_ramp() -> None:
    """R t from the sample's number: after a million samples within the two roundings on either side, 4 * eps / 2."""
    slope = 1e-6
    for fs in RATES:
        record = noise.GyroNoise(rate_ramp=slope).sample(1_000_000, fs, 0)
        np.testing.assert_allclose(record, slope * np.arange(1_000_000) / fs, rtol=4.5e-16, atol=0)


def check_markov() -> None:
    """Expect standard deviation sigma_b and correlation exp(-t / T_c) at three sample rates."""
    std, time_constant = 1e-4, 0.2
    for fs in RATES:
        # 4000 time constants hold about 4000 independent values of y^2 (correlation time T_c / 2 on both sides).
        record = noise.GyroNoise(markov_bias=std, markov_time=time_constant).sample(int(800 * fs), fs, 3)
        lag = round(time_constant * fs)
        bound = 5.0 * math.sqrt(2.0 / 4000.0)
        assert abs(np.mean(record**2) / std**2 - 1.0) < bound
        assert abs(np.mean(record[lag:] * record[:-lag]) / std**2 - math.exp(-1.0)) < bound


def check_white() -> None:
    """Expect normal samples with sigma = N sqrt(fs) (Kolmogorov-Smirnov) and without memory."""
    for fs in RATES:
        record = noise.GyroNoise(angle_random_walk=N).sample(100_000, fs, 5)
        assert stats.kstest(record / (N * math.sqrt(fs)), "norm").pvalue > 1e-4
        assert abs(np.corrcoef(record[1:], record[:-1])[0, 1]) < 5.0 / math.sqrt(record.size)


def check_electronic() -> None:
    """Compare white and 1/f noise of an amplifier with closed-form Allan variances, each alone, at three rates."""
    n, m, density = 200_000, 64, 1e-7
    spread = 5.0 * math.sqrt(2.0 / equivalent_freedom(m, n + 1, -1))
    for fs in RATES:
        knee = fs / 50.0
        terms = noise.ElectronicTerms(noise_density=density, noise_knee=knee).noise_terms(fs, 6, "mhd_ars")
        # n^2 f_knee / f is the flicker of B^2 = 2 pi f_knee n^2; its margin as in `check_allan`.
        wanted = {"white": density**2 * fs / m, "flicker": 4.0 * math.log(2.0) * knee * density**2}
        for name, variance in wanted.items():
            got = allan_deviation(terms[name].process(n), fs, [m / fs]).deviation[0] ** 2
            assert abs(got / variance - 1.0) < spread + 0.016, (fs, name, got / variance)


def check_turn_on() -> None:
    """Expect a Markov bias to begin with its own standard deviation and to keep it: nothing adds up."""
    std, runs = 1e-4, 1000
    term = noise.GyroNoise(markov_bias=std, markov_time=0.01)
    records = np.array([term.sample(2000, 2000.0, seed)[[0, -1]] for seed in range(runs)])
    # One second is a hundred time constants; 5 sigma of a variance of this many normal values.
    assert np.all(np.abs(np.var(records, axis=0) / std**2 - 1.0) < 5.0 * math.sqrt(2.0 / runs))


def check_no_period() -> None:
    """No lag of the autocorrelation stands out: nothing repeats."""
    record = noise.GyroNoise(angle_random_walk=N).sample(2**17, 2000.0, 5)
    spectrum = np.abs(np.fft.rfft(record, 2**18)) ** 2
    correlation = np.fft.irfft(spectrum)[: 2**16] / (record @ record)
    # At most 2^16 lags of standard deviation 1/sqrt(n): 6.5 sigma is exceeded once in 2e5 such records.
    assert np.abs(correlation[1:]).max() < 6.5 / math.sqrt(record.size)


def check_streams() -> None:
    """Terms, sensors and seeds are uncorrelated with each other."""
    n, fs = 100_000, 2000.0

    def white_parts(seed: int, name: str) -> list[FloatArray]:
        terms = noise.GyroNoise(**FULL).noise_terms(fs, seed, name)
        walk = np.diff(terms["rate_random_walk"].process(n + 1))
        return [terms["angle_random_walk"].process(n), walk, terms["quantization"].process(n)]

    parts = [part for owner in ((1, "a"), (1, "b"), (2, "a")) for part in white_parts(*owner)]
    correlation = np.corrcoef(parts) - np.eye(len(parts))
    # Between two independent records, one of them white, the correlation has standard deviation 1/sqrt(n);
    # two quantisation records (lag-one correlation -1/2): sqrt(1.5 / n).
    assert np.abs(correlation).max() < 5.0 * math.sqrt(1.5 / n)


def check_axes() -> None:
    """Instruments of one run read independent noise: three gyros as three axes, and another kind of sensor."""
    still = np.zeros(200_000)
    named = [("x", "adis16505"), ("y", "adis16505"), ("z", "adis16505"), ("mhd", "sx300")]
    records = [load_preset(kind).start(20000.0, 1, name).process(still) for name, kind in named]
    records[-1] = records[-1][::10]
    # 20000 readings at 2 kHz behind 480 Hz: neighbours correlate over 1 / (4 * 480 s) = two readings at most.
    assert np.abs(np.corrcoef(records) - np.eye(4)).max() < 5.0 * math.sqrt(2.0 / 20_000)


def check_switching_off() -> None:
    """Each term keeps its bits when any other is switched off."""
    full = {k: term.process(1000) for k, term in noise.GyroNoise(**FULL).noise_terms(2000.0, 7, "gyro").items()}
    for off in FULL:
        rest = noise.GyroNoise(**{**FULL, off: 0.0}).noise_terms(2000.0, 7, "gyro")
        assert set(rest) == set(full) - {off}
        for name, term in rest.items():
            assert np.array_equal(term.process(1000), full[name])
    amplifier = [
        noise.ElectronicTerms(noise_density=N, noise_knee=knee).noise_terms(2000.0, 7, "mhd_ars")["white"].process(1000)
        for knee in (10.0, None)
    ]
    assert np.array_equal(*amplifier)
    alone = {k: noise.GyroNoise(**{k: v}).start(2000.0, 7, "gyro").process(1000) for k, v in FULL.items()}
    for first, second in itertools.combinations(alone, 2):
        shared = np.corrcoef(np.diff(alone[first]), np.diff(alone[second]))[0, 1]
        # 1000 samples whose differences correlate at lag one only (at most 2/3): 5 sqrt(1 + 2 (2/3)^2) / sqrt(n).
        assert abs(shared) < 5.0 * math.sqrt((1.0 + 2.0 * (2.0 / 3.0) ** 2) / 1000)


def check_rate_of_the_task() -> None:
    """Expect a density of the readings at low frequency that does not depend on the rate at which the physics runs."""
    gyro = load_preset("adis16505")
    assert isinstance(gyro, mems_gyro.MemsGyro)
    for input_rate in (4000.0, 20000.0):
        record = gyro.sample(np.zeros(int(100 * input_rate)), input_rate, seed=4)
        # 2000 averages of 100 readings each: white at 20 Hz, so the variance is N^2 / 0.05 s; 5 sigma of 2000 values.
        means = record.reshape(-1, 100).mean(axis=1)
        assert abs(np.var(means) * 0.05 / gyro.angle_random_walk**2 - 1.0) < 5.0 * math.sqrt(2.0 / 2000)


def check_dynamics_at_two_rates() -> None:
    """Expect the low-pass to act at its own frequencies, whatever the ratio of physics rate to reading rate."""
    gyro = load_preset("crs03").model_copy(update={"noise": False})
    for input_rate in (2000.0, 20000.0):
        t = np.arange(int(2 * input_rate)) / input_rate
        readings = gyro.sample(np.sin(2 * np.pi * 10.0 * t), input_rate)
        line = np.exp(-2j * np.pi * 10.0 * np.arange(readings.size) / 2000.0)
        got = 2j * np.mean((readings * line)[2000:])
        # A straight line between samples loses (pi f T)^2 / 3 = 8e-5 at 10 Hz and 2 kHz.
        assert abs(got - gyro.response([10.0])[0]) < 2e-4


def check_aliasing() -> None:
    """Expect a tone above half the reading rate folded and attenuated by the low-pass as modelled."""
    gyro = load_preset("adis16505").model_copy(update={"noise": False})
    t = np.arange(40000) / 20000.0
    readings = gyro.sample(np.sin(2 * np.pi * 3300.0 * t), 20000.0)
    folded = 3300.0 - 2 * 2000.0
    line = np.exp(-2j * np.pi * folded * np.arange(readings.size) / 2000.0)
    got = abs(2.0 * np.mean((readings * line)[2000:]))
    # The tone between samples is a straight line: sinc^2(f T) of it remains, and its image at fs - f, |H| times 0.01.
    model = abs(gyro.response([3300.0])[0]) * np.sinc(3300.0 / 20000.0) ** 2
    assert abs(got / model - 1.0) < 0.02
    assert got < 0.02


def check_inputs_unchanged() -> None:
    """Expect a record that cannot be written to go through, and one that can to come out as it went in."""
    record = np.random.default_rng(1).standard_normal(2000) * 1e-2
    before = record.copy()
    for name in ("sx300", "adis16505"):
        record.flags.writeable = True
        load_preset(name).sample(record, 20000.0)
        assert np.array_equal(record, before)
        record.flags.writeable = False
        load_preset(name).sample(record, 20000.0)
    frozen = np.geomspace(0.1, 10.0, 20)
    frozen.flags.writeable = False
    for name in ("sx300", "adis16505"):
        load_preset(name).response(frozen)
        load_preset(name).input_noise_psd(frozen)
    noise.GyroNoise(**FULL).noise_psd(frozen, 100.0)
    allan_deviation(record, 100.0)
    allan_deviation(record, 100.0, frozen[frozen < 5.0])


def check_blocks() -> None:
    """Any division into blocks gives the same bits."""
    record = np.random.default_rng(2).standard_normal(50_000) * 1e-2
    for name in ("sx300", "adis16505_filtered", "adis16505", "crs03"):
        sensor = load_preset(name)
        whole = sensor.sample(record, 20000.0, seed=9)
        for cuts in ([1, 2, 3, 20_001], [7, 16_384, 16_391, 40_000], list(range(13, 50_000, 4099))):
            stage = sensor.start(20000.0, 9, "sensor")
            assert np.array_equal(np.concatenate([stage.process(b) for b in np.split(record, cuts)]), whole)


def check_units() -> None:
    """Expect a quantity from a file to need its unit, and the unit its dimension."""
    border = {"context": {"border": True}}
    good = noise.GyroNoise.model_validate({"angle_random_walk": "0.15 deg/sqrt(h)"}, **border)
    assert good.angle_random_walk == pytest.approx(np.deg2rad(0.15) / 60.0, rel=1e-14, abs=0)
    for bad in (0.15, "0.15", "0.15 deg/h", "0.15 K", "0.15 deg/sqrt(m)"):
        with pytest.raises(ValidationError):
            noise.GyroNoise.model_validate({"angle_random_walk": bad}, **border)


def check_unknown_key() -> None:
    with pytest.raises(ValidationError):
        noise.GyroNoise(angel_random_walk=1e-5)  # type: ignore[call-arg]


def check_every_key_counts() -> None:
    """Every coefficient changes the output."""
    changes = {**FULL, "rate_ramp": 1e-6, "markov_time": 1.0, "lowest_frequency": 1.0}
    start = noise.GyroNoise(**FULL).sample(100, 2000.0, 1)
    for key, value in changes.items():
        other = noise.GyroNoise(**{**FULL, key: 2.0 * value}).sample(100, 2000.0, 1)
        assert not np.array_equal(start, other), key
    assert set(changes) == set(noise.GyroTerms.model_fields)


def check_presets_apart() -> None:
    """Expect the shipped preset as it was after an instrument was changed."""
    first = sensors.load_preset("adis16505")
    changed = first.model_copy(update={"angle_random_walk": 1.0})
    second = sensors.load_preset("adis16505")
    assert second == first
    assert second != changed


CHECKS: list[Callable[[], None]] = [
    check_quantization,
    check_angle_random_walk,
    check_bias_instability,
    check_rate_random_walk,
    check_rate_ramp,
    check_markov,
    check_turn_on,
    check_electronic,
    check_white,
    check_no_period,
    check_streams,
    check_axes,
    check_switching_off,
    check_rate_of_the_task,
    check_dynamics_at_two_rates,
    check_aliasing,
    check_inputs_unchanged,
    check_blocks,
    check_units,
    check_unknown_key,
    check_every_key_counts,
    check_presets_apart,
]


@pytest.mark.oracle
@pytest.mark.parametrize("check", CHECKS, ids=lambda check: check.__name__)
def test_check_passes_on_the_real_code(check: Callable[[], None]) -> None:
    check()


class Walk:
    """A bank with one section, for planting."""

    def __init__(self, decay: float, gain: float) -> None:
        self.decay, self.gain = np.array([decay]), np.array([gain])

    def __call__(self, stream: np.random.Generator) -> noise_terms.FirstOrderBank:
        return noise_terms.FirstOrderBank(self.decay, self.gain, stream)


def plant_walk_stepped_with_dt(patch: pytest.MonkeyPatch) -> None:
    patch.setattr(noise, "random_walk", lambda k, fs, stream: Walk(0.0, k / fs)(stream))


def plant_white_random_walk(patch: pytest.MonkeyPatch) -> None:
    patch.setattr(noise, "random_walk", lambda k, fs, stream: noise_terms.White(k / fs, fs, stream))


def plant_noise_per_step(patch: pytest.MonkeyPatch) -> None:
    patch.setattr(noise, "White", lambda n, fs, stream: noise_terms.White(n * math.sqrt(2000.0 / fs), fs, stream))


def plant_noise_of_another_rate(patch: pytest.MonkeyPatch) -> None:
    patch.setattr(noise, "sampled", lambda shape, passed, fs: sampled(shape, passed, 10.0 * fs))


def plant_one_sided_density(patch: pytest.MonkeyPatch) -> None:
    patch.setattr(noise, "White", lambda n, fs, stream: noise_terms.White(n / math.sqrt(2.0), fs, stream))


def plant_one_sided_flicker(patch: pytest.MonkeyPatch) -> None:
    patch.setattr(noise, "flicker", lambda b, *rest: noise_terms.flicker(b / math.sqrt(2.0), *rest))


def plant_markov_for_flicker(patch: pytest.MonkeyPatch) -> None:
    patch.setattr(noise, "flicker", lambda b, low, fs, stream: noise_terms.markov(b, 100.0, fs, stream))


def plant_undifferenced_quantization(patch: pytest.MonkeyPatch) -> None:
    patch.setattr(noise, "Quantization", lambda q, fs, stream: noise_terms.White(q * math.sqrt(fs), fs, stream))


def plant_step_for_its_deviation(patch: pytest.MonkeyPatch) -> None:
    patch.setattr(
        noise, "Quantization", lambda q, fs, stream: noise_terms.Quantization(q / math.sqrt(12.0), fs, stream)
    )


def plant_accumulated_ramp(patch: pytest.MonkeyPatch) -> None:
    def process(self: Any, n_time: int) -> FloatArray:
        return np.cumsum(np.full(n_time, self._slope / self._sample_rate_hz))

    patch.setattr(noise_terms.Ramp, "process", process)


def plant_wrong_time_constant(patch: pytest.MonkeyPatch) -> None:
    patch.setattr(noise, "markov", lambda s, t, fs, stream: noise_terms.markov(s, 1.0 / t, fs, stream))


def plant_bias_added_every_step(patch: pytest.MonkeyPatch) -> None:
    patch.setattr(noise, "markov", lambda s, t, fs, stream: Walk(0.0, s * math.sqrt(2.0 / (t * fs)))(stream))


def plant_bias_from_zero(patch: pytest.MonkeyPatch) -> None:
    patch.setattr(noise_terms, "_stationary_root", lambda decay, gain: np.zeros((decay.size, decay.size)))


def plant_one_sided_electronics(patch: pytest.MonkeyPatch) -> None:
    # A vendor's one-sided density taken for a two-sided one: the 1/f part alone has the factor of two.
    patch.setattr(noise, "flicker", lambda level, *rest: noise_terms.flicker(level * math.sqrt(2.0), *rest))


def plant_euler_markov(patch: pytest.MonkeyPatch) -> None:
    # Equation (22) of the paper as printed: gain beta B sqrt(dT), which is no standard deviation of B.
    patch.setattr(noise, "markov", lambda s, t, fs, stream: Walk(1.0 / (t * fs), s / t / math.sqrt(fs))(stream))


def plant_uniform_noise(patch: pytest.MonkeyPatch) -> None:
    def process(self: Any, n_time: int) -> Any:
        return (self._stream.random(n_time) - 0.5) * math.sqrt(12.0) * self._std

    patch.setattr(noise_terms.White, "process", process)


def plant_periodic_noise(patch: pytest.MonkeyPatch) -> None:
    def process(self: Any, n_time: int) -> Any:
        return np.resize(self._stream.standard_normal(16384), n_time) * self._std

    patch.setattr(noise_terms.White, "process", process)
    patch.setattr(noise_terms, "_PIECE", 2**20)


def plant_shared_stream(patch: pytest.MonkeyPatch) -> None:
    patch.setattr(noise, "random_stream", lambda seed, *names: np.random.default_rng(seed))


def plant_one_stream_per_sensor(patch: pytest.MonkeyPatch) -> None:
    patch.setattr(noise, "random_stream", lambda seed, *names: np.random.default_rng([seed, len(names[0])]))


def plant_owner_forgotten(patch: pytest.MonkeyPatch) -> None:
    patch.setattr(noise, "random_stream", lambda seed, *names: random_stream(seed, names[-1]))


def plant_one_number_on_three_axes(patch: pytest.MonkeyPatch) -> None:
    patch.setattr(mems_gyro.MemsGyro, "start", lambda self, fs, seed, name: mems_gyro.MemsGyroStage(self, fs, seed, ""))


def plant_streams_in_order_of_use(patch: pytest.MonkeyPatch) -> None:
    counter = itertools.count()
    patch.setattr(noise, "random_stream", lambda seed, *names: np.random.default_rng([seed, next(counter)]))


def plant_filter_at_reading_rate(patch: pytest.MonkeyPatch) -> None:
    patch.setattr(mems_gyro, "LinearFilter", lambda num, den, fs: LinearFilter(num, den, 2000.0))


def plant_decimation_without_filter(patch: pytest.MonkeyPatch) -> None:
    patch.setattr(LinearFilter, "process", lambda self, u: u.copy())


def plant_input_written(patch: pytest.MonkeyPatch) -> None:
    def process(self: Any, true_rate: FloatArray) -> Any:
        true_rate += self._noise.process(true_rate.size)
        return self._converter.process(self._decimator.process(self._low_pass.process(true_rate)))

    patch.setattr(mems_gyro.MemsGyroStage, "process", process)


def plant_density_changed_in_place(patch: pytest.MonkeyPatch) -> None:
    original = noise.GyroTerms.noise_psd

    def noise_psd(self: Any, freq_hz: FloatArray, *sample_rate_hz: float) -> FloatArray:
        freq_hz *= 1.0
        return original(self, freq_hz, *sample_rate_hz)

    patch.setattr(noise.GyroTerms, "noise_psd", noise_psd)


def plant_mean_removed_in_place(patch: pytest.MonkeyPatch) -> None:
    def checked(rate: FloatArray, _: float) -> FloatArray:
        rate -= rate.mean()
        return rate

    patch.setattr(allan, "_checked", checked)


def plant_unit_in_prose_only(patch: pytest.MonkeyPatch) -> None:
    original = units.Quantity._read
    patch.setattr(units.Quantity, "_read", lambda self, value, border: original(self, value, border=False))


def plant_dimension_unchecked(patch: pytest.MonkeyPatch) -> None:
    original = units._factor

    def factor(unit: str, si: str, **options: Any) -> float:
        try:
            return original(unit, si, **options)
        except ValueError:
            return 1.0

    patch.setattr(units, "_factor", factor)


def plant_clock_restarted_per_block(patch: pytest.MonkeyPatch) -> None:
    patch.setattr(base.Decimator, "process", lambda self, samples: samples[:: self._ratio])


def plant_state_lost_between_blocks(patch: pytest.MonkeyPatch) -> None:
    original = noise_terms.FirstOrderBank.process

    def process(self: Any, n_time: int) -> FloatArray:
        self._state[:] = 0.0
        return original(self, n_time)

    patch.setattr(noise_terms.FirstOrderBank, "process", process)


def plant_misspelt_key_ignored(patch: pytest.MonkeyPatch) -> None:
    class Open(noise.GyroNoise):
        model_config = ConfigDict(extra="ignore")

    patch.setattr(noise, "GyroNoise", Open)


def plant_term_forgotten(patch: pytest.MonkeyPatch) -> None:
    original = noise.GyroTerms.noise_terms

    def noise_terms_without_ramp(self: Any, *arguments: Any) -> dict[str, Any]:
        return {k: v for k, v in original(self, *arguments).items() if k != "rate_ramp"}

    patch.setattr(noise.GyroTerms, "noise_terms", noise_terms_without_ramp)


def plant_profile_overwritten(patch: pytest.MonkeyPatch) -> None:
    def write(self: Any, *, update: dict[str, Any]) -> Any:
        for key, value in update.items():
            object.__setattr__(self, key, value)
        return self

    patch.setattr(sensors, "load_preset", functools.cache(load_preset))
    patch.setattr(base.Sensor, "model_copy", write)


PLANTS: list[tuple[Callable[[pytest.MonkeyPatch], None], Callable[[], None]]] = [
    (plant_walk_stepped_with_dt, check_rate_random_walk),
    (plant_white_random_walk, check_rate_random_walk),
    (plant_noise_per_step, check_angle_random_walk),
    (plant_noise_of_another_rate, check_rate_of_the_task),
    (plant_one_sided_density, check_angle_random_walk),
    (plant_one_sided_density, check_white),
    (plant_one_sided_flicker, check_bias_instability),
    (plant_markov_for_flicker, check_bias_instability),
    (plant_undifferenced_quantization, check_quantization),
    (plant_step_for_its_deviation, check_quantization),
    (plant_accumulated_ramp, check_rate_ramp),
    (plant_wrong_time_constant, check_markov),
    (plant_bias_added_every_step, check_markov),
    (plant_bias_added_every_step, check_turn_on),
    (plant_bias_from_zero, check_turn_on),
    (plant_one_sided_electronics, check_electronic),
    (plant_one_sided_density, check_electronic),
    (plant_euler_markov, check_markov),
    (plant_uniform_noise, check_white),
    (plant_periodic_noise, check_no_period),
    (plant_shared_stream, check_streams),
    (plant_shared_stream, check_switching_off),
    (plant_one_stream_per_sensor, check_streams),
    (plant_owner_forgotten, check_streams),
    (plant_owner_forgotten, check_axes),
    (plant_one_number_on_three_axes, check_axes),
    (plant_streams_in_order_of_use, check_switching_off),
    (plant_filter_at_reading_rate, check_dynamics_at_two_rates),
    (plant_decimation_without_filter, check_aliasing),
    (plant_input_written, check_inputs_unchanged),
    (plant_density_changed_in_place, check_inputs_unchanged),
    (plant_mean_removed_in_place, check_inputs_unchanged),
    (plant_unit_in_prose_only, check_units),
    (plant_dimension_unchecked, check_units),
    (plant_clock_restarted_per_block, check_blocks),
    (plant_state_lost_between_blocks, check_blocks),
    (plant_misspelt_key_ignored, check_unknown_key),
    (plant_term_forgotten, check_every_key_counts),
    (plant_profile_overwritten, check_presets_apart),
]


@pytest.mark.parametrize(("plant", "check"), PLANTS, ids=lambda part: part.__name__.split("_", 1)[1])
def test_check_fails_on_the_planted_mistake(
    plant: Callable[[pytest.MonkeyPatch], None], check: Callable[[], None], monkeypatch: pytest.MonkeyPatch
) -> None:
    plant(monkeypatch)
    with pytest.raises((AssertionError, ValueError, pytest.fail.Exception)):
        check()
