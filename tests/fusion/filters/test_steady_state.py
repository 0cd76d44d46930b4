"""Gains that settle: the Kalman filter at less cost, through gaps, and what it costs away from its signal."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
import pytest

from testbed.fusion.analysis.optimum import optimum
from testbed.fusion.belief import SensorBelief, load_belief
from testbed.fusion.filters.kalman import Kalman, KalmanParameters
from testbed.fusion.filters.steady_state import SteadyState, SteadyStateParameters

if TYPE_CHECKING:
    from testbed.fusion import EstimateBlock
    from testbed.signals import FloatArray

DEG = np.pi / 180.0
RATES = {"mems_gyro": 2000.0, "mhd_ars": 20000.0}
# The gyro as good as the MHD sensor: no slow mode, so that both filters settle in a second.
QUICK = {
    "mhd_ars": load_belief("eq39")["mhd_ars"],
    "mems_gyro": SensorBelief(numerator=(600.0,), denominator=(1.0, 600.0), input_noise=2e-8, output_noise=2e-8),
}


# Three looks at the gains, a second apart: the first has nothing to compare with.
SETTLED = 70_000


def quick_readings(n: int) -> dict[str, FloatArray]:
    rng = np.random.default_rng(3)
    return {"mems_gyro": 1e-4 * rng.standard_normal(n // 10), "mhd_ars": 1e-4 * rng.standard_normal(n)}


def both(readings: dict[str, FloatArray]) -> tuple[EstimateBlock, EstimateBlock]:
    """Return the settling filter and the Kalman filter of its model."""
    best = optimum(QUICK, RATES, [(10.0, DEG)])
    kalman = Kalman(QUICK, RATES, KalmanParameters(order=best.order, q=best.q, coloured=False))
    return SteadyState(QUICK, RATES, SteadyStateParameters(coloured=False)).process(readings), kalman.process(readings)


@pytest.mark.oracle
def test_it_is_the_kalman_filter_from_the_start_on() -> None:
    fixed, kalman = both(quick_readings(SETTLED + 2_000))
    n = 40_000
    assert np.array_equal(fixed.rate[:n], kalman.rate[:n])
    assert np.array_equal(fixed.std[:n], kalman.std[:n])
    # Then with gains that change by less than 1e-3 a second, here by e^-30.
    assert not np.array_equal(fixed.rate, kalman.rate)
    assert np.unique(fixed.std[SETTLED:]).size == 10
    np.testing.assert_allclose(fixed.rate, kalman.rate, rtol=0.0, atol=1e-7 * np.max(np.abs(kalman.rate)))
    np.testing.assert_allclose(fixed.std, kalman.std, rtol=1e-5)
    for key in ("innovation_variance_mhd_ars", "innovation_variance_mems_gyro"):
        np.testing.assert_allclose(fixed.diagnostics[key], kalman.diagnostics[key], rtol=1e-5)


@pytest.mark.oracle
@pytest.mark.parametrize(
    ("sensor", "lost"),
    [("mhd_ars", slice(70_005, 72_003)), ("mems_gyro", slice(7_001, 7_030)), ("mhd_ars", slice(70_009, 75_000, 2))],
)
def test_a_gap_ends_the_settled_state_and_it_is_the_kalman_filter_again(sensor: str, lost: slice) -> None:
    readings = quick_readings(SETTLED + 70_000)
    readings[sensor][lost] = np.nan
    fixed, kalman = both(readings)
    np.testing.assert_allclose(fixed.rate, kalman.rate, rtol=0.0, atol=1e-6 * np.max(np.abs(kalman.rate)))
    np.testing.assert_allclose(fixed.std, kalman.std, rtol=1e-5)
    assert np.unique(fixed.std[-2_000:]).size == 10


def test_the_cycle_of_gains_follows_the_clock_and_not_the_first_reading() -> None:
    """The gyro is due at every tenth step from t = 0, whether or not readings came before: claims repeat with that
    phase.
    """
    n = SETTLED + 20_000
    readings = {"mems_gyro": np.zeros(n // 10), "mhd_ars": np.zeros(n)}
    late = {key: values.copy() for key, values in readings.items()}
    late["mhd_ars"][:13], late["mems_gyro"][:2] = np.nan, np.nan
    whole, begun = (
        SteadyState(QUICK, RATES, SteadyStateParameters(coloured=False, gate=False)).process(one)
        for one in (readings, late)
    )
    assert np.unique(whole.std[-100:]).size == 10
    np.testing.assert_allclose(begun.std[-100:], whole.std[-100:], rtol=1e-6)


def test_it_is_best_at_the_signal_it_was_made_for(reference: Any) -> None:
    belief = load_belief("eq39")
    error = {}
    rate = reference.sines((100.0, 1.0), duration=2.0)
    for frequency in (1.0, 100.0):
        p = SteadyStateParameters(frequency=frequency, start="rest")
        found = SteadyState(belief, RATES, p).process(reference.readings(rate, 8)).rate - rate
        error[frequency] = np.sqrt(np.mean(found[20_000:] ** 2)) / DEG
    assert error[100.0] < 0.01
    assert error[1.0] > 10.0 * error[100.0]


def test_amplitude_opens_the_filter(reference: Any) -> None:
    readings = reference.readings(reference.sines((10.0, 1.0), duration=0.2), 8)
    belief = load_belief("eq39")
    small, large = (
        SteadyState(belief, RATES, SteadyStateParameters(amplitude=a * DEG)).process(readings) for a in (0.01, 10.0)
    )
    assert large.std[-1] > small.std[-1]
