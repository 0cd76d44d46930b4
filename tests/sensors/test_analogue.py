"""Analogue stages in time against their responses and closed forms."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import pytest
from scipy import signal

from testbed.sensors.analogue import DelayStage, LowPassStage, OnePole, SaturationStage, saturate
from testbed.sensors.mhd_electronics import Delay, LowPass, Transformer

if TYPE_CHECKING:
    from testbed.sensors.analogue import AnalogueStage
    from testbed.signals import FloatArray

FS = 20000.0
# Corner 0.32 Hz.
TRANSFORMER = Transformer(magnetizing_inductance=10e-6, source_resistance=20e-6)


def settled_gain(stage: AnalogueStage, freq: float, *, seconds: float = 1.0, wait: float = 1.0) -> complex:
    """Return output over input of a sine, after `wait`."""
    t = np.arange(int((wait + seconds) * FS)) / FS
    y = stage.process(np.sin(2 * np.pi * freq * t))
    tail = t >= wait
    return complex(2j * np.mean((y * np.exp(-2j * np.pi * freq * t))[tail]))


def in_blocks(stage: AnalogueStage, u: FloatArray, cuts: list[int]) -> FloatArray:
    return np.concatenate([stage.process(block) for block in np.split(u, cuts)])


@pytest.mark.oracle
@pytest.mark.parametrize("order", range(1, 9))
def test_low_pass_is_scipys_butterworth(order: int) -> None:
    freq = np.geomspace(1.0, 1e5, 200)
    b, a = signal.butter(order, 2 * np.pi * 4000.0, analog=True)
    _, expected = signal.freqs(b, a, 2 * np.pi * freq)
    # Coefficients of order 8 span 35 decades, but each is a rounded product: order times eps.
    np.testing.assert_allclose(LowPass(corner=4000.0, order=order).response(freq), expected, rtol=1e-12)


@pytest.mark.oracle
@pytest.mark.parametrize("order", [1, 2, 3, 4, 8])
@pytest.mark.parametrize("corner", [300.0, 4000.0, 8000.0])
@pytest.mark.parametrize("freq", [10.0, 300.0, 1000.0])
def test_low_pass_in_time_meets_its_response(order: int, corner: float, freq: float) -> None:
    part = LowPass(corner=corner, order=order)
    # The input's backward cubic misses 19/720 (2 pi f T)^4 at most of what each section passes; all share the cubic.
    bound = 1.5 * 19.0 / 720.0 * (2 * np.pi * freq / FS) ** 4 + 1e-9
    assert settled_gain(part.start(FS), freq) == pytest.approx(part.response(np.array([freq]))[0], abs=bound)


def test_low_pass_of_order_one_is_the_amplifiers_pole() -> None:
    u = np.random.default_rng(3).standard_normal(1000)
    np.testing.assert_allclose(
        LowPass(corner=1352.0).start(FS).process(u), OnePole(1352.0, FS).process(u), rtol=0, atol=1e-13
    )


@pytest.mark.oracle
@pytest.mark.parametrize("order", [2, 4])
def test_anti_alias_filter_attenuates_a_tone_above_nyquist(order: int) -> None:
    """What the converter folds down is what the filter lets through at the tone's own frequency."""
    part, tone = LowPass(corner=1000.0, order=order), 3500.0
    fine = 200000.0
    t = np.arange(200000) / fine
    taken = part.start(fine).process(np.sin(2 * np.pi * tone * t))[:: round(fine / 4000.0)]
    # Sampled at 4 kHz the tone appears at 500 Hz.
    got = 2 * abs(np.mean((taken * np.exp(-2j * np.pi * 500.0 * np.arange(taken.size) / 4000.0))[2000:]))
    assert got == pytest.approx(abs(part.response(np.array([tone]))[0]), rel=1e-3)


@pytest.mark.oracle
@pytest.mark.parametrize("freq", [0.1, 0.5, 10.0, 1000.0])
def test_transformer_in_time_meets_its_response(freq: float) -> None:
    corner = 20e-6 / (2 * np.pi * 10e-6)
    assert TRANSFORMER.corner_freq_hz == pytest.approx(corner, rel=1e-15)
    expected = 1j * freq / (1j * freq + corner)
    assert TRANSFORMER.response(np.array([freq]))[0] == pytest.approx(expected, rel=1e-14)
    # The start decays at 2 1/s: e^-20; the hold, (pi f T)^2/3, acts on H - 1 only: 3e-6 at 1 kHz.
    got = settled_gain(TRANSFORMER.start(FS), freq, wait=10.0, seconds=10.0)
    assert got == pytest.approx(expected, abs=1e-5)


@pytest.mark.oracle
def test_transformer_forgets_a_step_with_l_over_r() -> None:
    t = np.arange(20000) / FS
    np.testing.assert_allclose(TRANSFORMER.start(FS).process(np.ones(t.size)), np.exp(-2.0 * t), rtol=0, atol=1e-11)


@pytest.mark.parametrize("whole", [0, 1, 2, 3, 40])
def test_whole_delays_are_exact(whole: int) -> None:
    u = np.random.default_rng(4).standard_normal(100)
    got = Delay(time=whole / FS).start(FS).process(u)
    np.testing.assert_array_equal(got, np.concatenate([np.zeros(whole), u[: u.size - whole]]))


@pytest.mark.oracle
@pytest.mark.parametrize("samples", [0.3, 0.5, 1.5, 2.25, 17.9])
@pytest.mark.parametrize("freq", [10.0, 300.0, 1000.0])
def test_fractional_delay_meets_its_response(samples: float, freq: float) -> None:
    part = Delay(time=samples / FS)
    # Cubic through four points: |D (D-1) (D-2) (D-3)| / 24 (2 pi f T)^4, at most 1/24, and 9/16 of that where the
    # instant lies between the inner two; the next order is 20 % of it at 1 kHz.
    centred = 1.0 if samples < 1.0 else 9.0 / 16.0
    bound = 1.2 * centred / 24.0 * (2 * np.pi * freq / FS) ** 4 + 1e-9
    expected = np.exp(-2j * np.pi * freq * samples / FS)
    assert part.response(np.array([freq]))[0] == pytest.approx(expected, abs=1e-12)
    assert settled_gain(part.start(FS), freq) == pytest.approx(expected, abs=bound)


def test_fractional_delay_of_a_cubic_is_exact() -> None:
    t = np.arange(50) / 50.0
    got = DelayStage(3.4).process(t**3 - t)
    late = t - 3.4 / 50.0
    np.testing.assert_allclose(got[7:], (late**3 - late)[7:], rtol=0, atol=1e-14)


@pytest.mark.oracle
@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_recovery_from_an_overload_is_the_closed_form(sign: float) -> None:
    limit, excess, tau, held = 2.0, 3.0, 5e-3, 100
    x = np.concatenate([np.full(held, limit + excess), np.zeros(400)])
    y = SaturationStage(limit, tau, FS).process(sign * x)
    charge = excess * -np.expm1(-held / FS / tau)
    assert np.array_equal(y[:held], np.full(held, sign * limit))
    expected = np.minimum(charge * np.exp(-np.arange(400) / FS / tau), limit)
    # 500 products, each rounded once.
    np.testing.assert_allclose(y[held:], sign * expected, rtol=500 * np.finfo(float).eps)


def test_rails_without_memory_clip() -> None:
    x = 3 * np.random.default_rng(5).standard_normal(1000)
    assert np.array_equal(SaturationStage(1.5, 0.0, FS).process(x), np.clip(x, -1.5, 1.5))


def test_rails_leave_a_small_signal_alone() -> None:
    x = np.random.default_rng(6).uniform(-1.0, 1.0, 1000)
    assert np.array_equal(SaturationStage(1.0, 1e-3, FS).process(x), x)


def test_rails_kernel_equals_its_numpy_twin() -> None:
    x = 2 * np.random.default_rng(7).standard_normal(2000)
    keep, charge, expected = float(np.exp(-0.01)), 0.0, []
    for value in x:
        expected.append(np.clip(value + charge, -1.0, 1.0))
        charge = keep * charge + (1 - keep) * (value - np.clip(value, -1.0, 1.0))
    got = np.empty_like(x)
    saturate(x, 1.0, keep, 1 - keep, 0.0, got)
    # The compiler may fuse a product and a sum: a rounding per step, kept for 1/(1 - keep) of them.
    np.testing.assert_allclose(got, expected, rtol=0, atol=1e-13)


@pytest.mark.parametrize("cuts", [[1], [0, 0, 7], [1, 2, 3, 4, 5], [499], [100, 101, 333], list(range(1, 500))])
@pytest.mark.parametrize("kind", ["low_pass", "odd_low_pass", "delay", "rails", "transformer"])
def test_any_division_into_blocks_gives_the_same_bits(kind: str, cuts: list[int]) -> None:
    def stage() -> AnalogueStage:
        return {
            "low_pass": LowPass(corner=4000.0, order=4).start(FS),
            "odd_low_pass": LowPass(corner=500.0, order=3).start(FS),
            "delay": Delay(time=3.7 / FS).start(FS),
            "rails": SaturationStage(0.5, 1e-3, FS),
            "transformer": TRANSFORMER.start(FS),
        }[kind]

    u = np.random.default_rng(8).standard_normal(500)
    assert np.array_equal(in_blocks(stage(), u, cuts), stage().process(u))


def test_low_pass_stage_needs_no_samples() -> None:
    stage = LowPass(corner=4000.0, order=2).start(FS)
    assert isinstance(stage, LowPassStage)
    assert stage.process(np.empty(0)).size == 0
