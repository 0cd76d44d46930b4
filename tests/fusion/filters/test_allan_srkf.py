"""The filter of paper 2: its R, its seven states, one or several sample rates."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
import pytest

from testbed.fusion import estimate
from testbed.fusion.bands import increment_variance
from testbed.fusion.belief import default_belief, load_belief
from testbed.fusion.filters.allan_srkf import AllanSrkf, AllanSrkfParameters
from testbed.fusion.model import build_model
from testbed.signals import random_stream

if TYPE_CHECKING:
    from testbed.signals import FloatArray

DEG = np.pi / 180.0
RATES = {"mems_gyro": 2000.0, "mhd_ars": 20000.0}


@pytest.fixture(scope="module")
def readings(reference: Any) -> dict[str, FloatArray]:
    signal: dict[str, FloatArray] = reference.readings(reference.sines((4.0, 1.0), duration=0.2), 4)
    return signal


@pytest.mark.oracle
def test_R_is_the_allan_variance_so_far(readings: dict[str, FloatArray]) -> None:
    """(28)-(29) with infinite memory: the mean of half the squared increments up to this reading."""
    R = estimate("allan_srkf", readings, sample_rate_hz=RATES, clamp=None, R_floor=1e-30).diagnostics
    for name, stride in (("mems_gyro", 10), ("mhd_ars", 1)):
        used = R[f"R_{name}"][::stride]
        for k in (1, 2, 17, used.size - 1):
            assert used[k] == pytest.approx(increment_variance(readings[name][: k + 1]), rel=1e-12, abs=0.0)


@pytest.mark.oracle
def test_a_memory_forgets(readings: dict[str, FloatArray]) -> None:
    memory, z = 0.01, readings["mhd_ars"]
    block = estimate("allan_srkf", readings, sample_rate_hz=RATES, clamp=None, R_floor=1e-30, memory=memory)
    R = 0.0
    for k in range(1, z.size):
        g = max(1.0 / k, 1.0 / (20000.0 * memory))
        R = (1.0 - g) * R + g * (z[k] - z[k - 1]) ** 2 / 2.0
    assert block.diagnostics["R_mhd_ars"][-1] == pytest.approx(R, rel=1e-9, abs=0.0)


def test_bounds_of_R_hold_and_are_counted(readings: dict[str, FloatArray]) -> None:
    still = {name: np.zeros_like(value) for name, value in readings.items()}
    belief = build_model(default_belief(), RATES, order=1, q=1.0).R
    for parameters, lowest in (({"clamp": None, "R_floor": 3e-12}, [3e-12] * 2), ({"clamp": 7.0}, belief / 7.0)):
        # The gate would strike out readings that never change.
        block = estimate("allan_srkf", still, sample_rate_hz=RATES, gate=False, verdict=False, **parameters)
        for i, name in enumerate(RATES):
            R = block.diagnostics[f"R_{name}"]
            R = R[np.isfinite(R)]
            assert R[0] == belief[i]
            np.testing.assert_allclose(R[1:], lowest[i], rtol=1e-12)
        assert block.diagnostics["guard_hits"][-1] == sum(value.size - 1 for value in still.values())
    loud = {name: 1e3 * value for name, value in readings.items()}
    R = estimate("allan_srkf", loud, sample_rate_hz=RATES, gate=False, verdict=False, clamp=7.0).diagnostics[
        "R_mhd_ars"
    ]
    assert R[-1] == pytest.approx(7.0 * belief[1], rel=1e-12, abs=0.0)


def test_seven_states_at_one_rate_and_at_two() -> None:
    """The same motion through the believed sensors: followed with both at 20 kHz and with the gyro at 2 kHz."""
    from testbed.signals import LinearFilter

    fs, n = 20000.0, 40_000
    rate = np.sin(2.0 * np.pi * 5.0 * np.arange(n) / fs)
    believed = load_belief("paper2")
    full = {
        name: LinearFilter(list(one.numerator), list(one.denominator), fs).process(rate)
        for name, one in believed.items()
    }
    full = {name: value + 1e-5 * random_stream(8, name).standard_normal(n) for name, value in full.items()}
    for gyro_hz in (20000.0, 2000.0, 500.0):
        rates = {"mems_gyro": gyro_hz, "mhd_ars": fs}
        stage = AllanSrkf(believed, rates, AllanSrkfParameters())
        assert stage.model.F.shape == (7, 7)
        block = stage.process(full | {"mems_gyro": full["mems_gyro"][:: round(fs / gyro_hz)]})
        error = (block.rate - rate)[n // 2 :]
        # The lag of a step or two of 50 us is 1e-3 rad/s at 5 Hz.
        assert np.sqrt(np.mean(error**2)) < 3e-3


def test_the_default_carries_a_root() -> None:
    assert AllanSrkfParameters().form == "square_root"
    P = AllanSrkf(load_belief("paper2"), RATES, AllanSrkfParameters()).covariance
    np.testing.assert_allclose(P, build_model(load_belief("paper2"), RATES, order=1, q=1.0).P0, rtol=1e-14)
