"""The loop between two paths: its closed forms, and the shaped one against the two-sensor bound, in running filters."""

from __future__ import annotations

import time
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from testbed.fusion.belief import load_belief
from testbed.fusion.filters.complementary import Complementary
from testbed.fusion.two_paths.design import band_end, input_psd, inverse, low_pass, over
from testbed.fusion.two_paths.loop import Loop, butterworth_loop, shaped_loop
from testbed.fusion.two_paths.paths import parallel
from testbed.sensors import load_preset
from tests.contract.test_filters_on_beliefs import CASES, FAST, SLOW, case

BELIEF = load_belief("identified")
RATES = {"mems_gyro": 2000.0, "mhd_ars": 20_000.0}
PRESETS = {"mems_gyro": load_preset("adis16505_filtered"), "mhd_ars": load_preset("sx300")}
FREQ = np.geomspace(1e-3, 1e3, 301)
SHAPED = Loop(gain=0.05, slope_gain=0.005, leak=0.16, crossover=0.07)


@pytest.mark.oracle
@pytest.mark.parametrize("order", [1, 2])
def test_butterworth_loop_has_the_low_pass_of_its_order(order: int) -> None:
    L = over(butterworth_loop(order, 0.3).low_pass(), FREQ)
    np.testing.assert_allclose(L, over(low_pass(order, 0.3), FREQ), rtol=1e-12)


@pytest.mark.oracle
def test_shaped_loop_has_the_low_pass_of_its_equations() -> None:
    """L = C / (1 + C) with C = k / s + q / (s (s + z)), for u' = k e + c, c' = q e - z c, e = y - u."""
    s = 2j * np.pi * FREQ
    C = SHAPED.gain / s + SHAPED.slope_gain / (s * (s + SHAPED.leak))
    np.testing.assert_allclose(over(SHAPED.low_pass(), FREQ), C / (1.0 + C), rtol=1e-9)


@pytest.mark.oracle
@pytest.mark.parametrize("loop", [butterworth_loop(1, 0.3), butterworth_loop(2, 0.3), SHAPED])
def test_paths_are_the_shares_through_the_inverses(loop: Loop) -> None:
    slow, fast = BELIEF["mems_gyro"], BELIEF["mhd_ars"]
    band = band_end(slow, fast, 2.0 * np.pi * 150.0)
    paths = parallel(slow, fast, loop, band)
    resolved = np.linalg.inv(2j * np.pi * FREQ[:, None, None] * np.eye(len(paths.A)) - paths.A)
    L, B = over(loop.low_pass(), FREQ), over(band, FREQ)
    for enters, through, wanted in (
        (paths.B, paths.D, B * (1.0 - L) / fast.realisation().response(FREQ)),
        (paths.E, 0.0, B * L / slow.realisation().response(FREQ)),
    ):
        np.testing.assert_allclose(resolved @ enters @ paths.C + through, wanted, rtol=1e-7)


def test_a_bandwidth_may_meet_a_zero_of_a_sensor() -> None:
    """The band end's pole and the inverse's are one then."""
    zero = np.abs(np.roots(inverse(BELIEF["mhd_ars"])[1])).min()
    Complementary(BELIEF, RATES, Complementary.Parameters(bandwidth=zero / (2.0 * np.pi)))


# The shape


def excess(loop: Loop, slow: Any, fast: Any) -> Any:
    """Return by how much the fused density exceeds the bound over `FREQ` [dB], and its root mean square [deg/s]."""
    L, of_slow, of_fast = over(loop.low_pass(), FREQ), slow(FREQ), fast(FREQ)
    density = np.abs(L) ** 2 * of_slow + np.abs(1.0 - L) ** 2 * of_fast
    rms = np.degrees(np.sqrt(2.0 * np.trapezoid(density * FREQ, np.log(FREQ))))
    return 10.0 * np.log10(density * (1.0 / of_slow + 1.0 / of_fast)), rms


@pytest.mark.oracle
def test_no_loop_nearby_is_nearer_to_the_bound() -> None:
    slow, fast = (input_psd(BELIEF[name]) for name in ("mems_gyro", "mhd_ars"))
    best = shaped_loop(slow, fast)
    least = excess(best, slow, fast)[0].max()
    assert least < 4.0
    for key in ("gain", "slope_gain", "leak"):
        for factor in (0.8, 0.95, 1.05, 1.25):
            other = replace(best, **{key: factor * getattr(best, key)})
            # The search ends within 0.03 dB, and below 1 mHz, which is not looked at here, the bound is as near.
            assert excess(other, slow, fast)[0].max() > least - 0.03


def test_what_the_slow_path_gets_wrong_slows_the_loop_down() -> None:
    slow, fast = (input_psd(BELIEF[name]) for name in ("mems_gyro", "mhd_ars"))
    free, held = shaped_loop(slow, fast), shaped_loop(slow, fast, lag=lambda freq: 1e-4 * np.minimum(freq, 1.0) ** 2)
    assert abs(over(held.low_pass(), np.ones(1))[0]) < 0.7 * abs(over(free.low_pass(), np.ones(1))[0])


def answers(loop: Loop, freq: Any, slower: float, seconds: float) -> Any:
    """Return the density over `FREQ` that a settled filter with this loop and `slower` clocks makes of the noise of the
    simulated sensors [rad^2/s], by its answers to one reading of each.
    """

    class Fixed(Complementary):
        """A filter with this loop."""

        def _best_loop(self, *_: Any) -> Loop:
            return loop

    rates = {name: rate / slower for name, rate in RATES.items()}
    density = np.zeros_like(freq)
    for name, rate_hz in rates.items():
        stage = Fixed(BELIEF, rates, Complementary.Parameters(start="rest", gate=False))
        stage.process({other: np.zeros(round(100.0 * rate)) for other, rate in rates.items()})
        pulse = {other: np.zeros(round(seconds * rate)) for other, rate in rates.items()}
        pulse[name][0] = 1.0
        spectrum = np.abs(np.fft.rfft(stage.process(pulse).rate)) * rate_hz / rates["mhd_ars"]
        passes = np.interp(freq, np.arange(spectrum.size) / seconds, spectrum)
        density += passes**2 * PRESETS[name].input_noise_psd(freq) * np.abs(PRESETS[name].response(freq)) ** 2
    return density


@pytest.mark.oracle
@pytest.mark.slow
def test_filter_keeps_the_bar_over_six_decades() -> None:
    """At most 4.2 dB above the bound of the simulated sensors and 1.27e-3 deg/s, by the design and as it runs: below
    0.3 Hz with its clocks at a tenth, which the loop does not know, above it as they are.
    """
    noises = [sensor.input_noise_psd for sensor in PRESETS.values()]
    loop = Complementary(BELIEF, RATES, Complementary.Parameters()).loop
    designed, rms = excess(loop, *noises)
    assert designed.max() < 4.2
    assert rms < 1.27e-3
    low, high = FREQ[FREQ < 0.3], FREQ[FREQ >= 0.3]
    density = np.concatenate([answers(loop, low, 10.0, 1000.0), answers(loop, high, 1.0, 20.0)])
    over_bound = 10.0 * np.log10(density * sum(1.0 / psd(FREQ) for psd in noises))
    assert over_bound.max() < 4.2
    assert np.degrees(np.sqrt(2.0 * np.trapezoid(density * FREQ, np.log(FREQ)))) < 1.27e-3
    # Far below the ends of both paths it is the design's.
    np.testing.assert_allclose(over_bound[: low.size // 2], designed[: low.size // 2], atol=0.05)


PAIRS = dict.fromkeys([*CASES, *(f"exactly {fast} and {slow}" for fast in FAST for slow in SLOW)])


@pytest.mark.parametrize("one", PAIRS)
def test_every_shipped_pair_is_designed_within_a_second(one: str) -> None:
    belief, rates = case(one)

    def designed() -> tuple[Complementary, float]:
        begin = time.process_time()
        return Complementary(belief, rates, Complementary.Parameters()), time.process_time() - begin

    found, spent = designed()
    # What runs for the first time in this process is not the design's cost.
    assert spent < 1.0 or designed()[1] < 1.0
    assert found.loop.crossover > 0.0


def test_one_pole_is_still_to_be_had() -> None:
    one, two, given = (
        Complementary(BELIEF, RATES, Complementary.Parameters(**own)) for own in ({"poles": 1}, {}, {"crossover": 0.02})
    )
    assert (one.loop.slope_gain, given.loop.slope_gain) == (0.0, 0.0)
    assert two.loop.slope_gain > 0.0
    assert given.loop.gain == pytest.approx(0.04 * np.pi)
    with pytest.raises(ValueError, match="poles: expected 1 beside a crossover, got 2"):
        Complementary.Parameters(poles=2, crossover=0.02)
