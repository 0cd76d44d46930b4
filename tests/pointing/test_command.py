"""Angles, latency, hold and mirror in time against closed forms and plain loops, in any blocks."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.testing import assert_allclose
from scipy.signal import lsim, lti

from testbed.pointing.actuator import butterworth_mirror
from testbed.pointing.angle import RateIntegral
from testbed.pointing.command import CommandPath, Hold, Latency
from testbed.signals import LinearFilter

FS = 2000.0
CUTS = st.lists(st.integers(0, 400), max_size=5).map(sorted)


def in_blocks(stage, x, cuts=()):
    return np.concatenate([stage.process(part) for part in np.split(x, cuts)])


@pytest.mark.oracle
@pytest.mark.parametrize("delay", [0.0, 5e-3, 1.3e-3])
def test_latency_is_a_delay(delay):
    """Linear between samples: off by (2 pi f / fs)^2 / 8 of the amplitude at the most."""
    t, f = np.arange(4000) / FS, 20.0
    late = Latency(delay, FS).process(np.sin(2.0 * np.pi * f * t))
    expected = np.sin(2.0 * np.pi * f * (t - delay))
    assert_allclose(late[100:], expected[100:], atol=(2.0 * np.pi * f / FS) ** 2 / 8.0 + 1e-12)
    assert not late[: int(delay * FS)].any()


@pytest.mark.property
@settings(max_examples=25, deadline=None)
@given(cuts=CUTS)
def test_any_blocks_give_the_same(cuts):
    x = np.random.default_rng(1).standard_normal(401)
    for make in (lambda: Latency(1.3e-3, FS), lambda: Hold(7)):
        assert_allclose(in_blocks(make(), x, cuts), in_blocks(make(), x), rtol=0, atol=0)
    for ratio in (1, 4):
        whole, parts = RateIntegral(ratio, FS), RateIntegral(ratio, FS)
        angle, rate = whole.process(x[::ratio], x.size)
        found = [
            parts.process(x[-start % ratio + start : stop : ratio], stop - start)
            for start, stop in zip([0, *cuts], [*cuts, x.size], strict=True)
        ]
        assert_allclose(np.concatenate([one[0] for one in found]), angle, atol=1e-12)
        assert_allclose(np.concatenate([one[1] for one in found]), rate, atol=0)


def test_hold_keeps_every_nth_sample():
    assert Hold(3).process(np.arange(8.0)).tolist() == [0, 0, 0, 3, 3, 3, 6, 6]


@pytest.mark.oracle
@pytest.mark.parametrize("ratio", [1, 10])
def test_the_integral_of_a_sine_is_its_angle(ratio):
    """Trapezoid: (2 pi f T)^2 / 12 of the amplitude; between estimates the angle may be off by what the rate turns, (2
    pi f T)^2 / 2 of it.
    """
    f, n = 5.0, 4000
    t, w, T = np.arange(n) / FS, 2.0 * np.pi * 5.0, ratio / FS
    angle, rate = RateIntegral(ratio, FS).process(w * np.cos(w * t[::ratio]), n)
    assert_allclose(angle[::ratio], np.sin(w * t[::ratio]), atol=1.1 * (w * T) ** 2 / 12.0)
    assert_allclose(angle, np.sin(w * t), atol=(w * T) ** 2)
    assert_allclose(rate[::ratio], w * np.cos(w * t[::ratio]), rtol=1e-12)
    assert f < FS / 2


@pytest.mark.oracle
@pytest.mark.parametrize(("lead", "latency", "hold"), [(0.0, 0.0, 0), (3e-4, 5e-4, 0), (1e-3, 1e-3, 4)])
def test_the_way_to_the_mirror_is_its_transfer_function(lead, latency, hold):
    """A sine through lead, latency, hold and mirror; straight lines between samples pass sinc^2 of it, a hold sinc,
    half its length late. What is left of the images is 1e-6.
    """
    f, n, fs = 50.0, 40_000, 20_000.0
    t, w, mirror = np.arange(n) / fs, 2.0 * np.pi * f, butterworth_mirror(1000.0)
    path = CommandPath(mirror, fs, lead=lead, latency=latency, hold=hold)
    y = path.process(np.sin(w * t), w * np.cos(w * t))[n // 2 :]
    ratio = 2.0 * np.mean(y * np.exp(-1j * w * t[n // 2 :])) / -1j
    expected = mirror.response(np.array([f]))[0] * np.exp(-1j * w * latency) * (1.0 + 1j * w * lead)
    if hold:
        expected *= np.sinc(f * hold / fs) * np.exp(-0.5j * w * hold / fs)
    else:
        expected *= np.sinc(f / fs) ** 2
    assert_allclose(ratio, expected, rtol=1e-6)


@pytest.mark.oracle
def test_a_held_command_is_discretised_exactly(rng):
    """Against scipy's simulation of the same steps."""
    mirror, u = butterworth_mirror(200.0), rng.standard_normal(60)
    stage = LinearFilter(list(mirror.numerator), list(mirror.denominator), FS, hold="zero")
    t = np.arange(60) / FS
    _, expected, _ = lsim(lti(mirror.numerator, mirror.denominator), u, t, interp=False)
    assert_allclose(stage.process(u), expected, atol=1e-9)
