"""Constant gains: the settled Kalman filter, and what it costs away from its signal."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from testbed.fusion.analysis.optimum import optimum
from testbed.fusion.belief import SensorBelief, load_belief
from testbed.fusion.filters.kalman import Kalman, KalmanParameters
from testbed.fusion.filters.steady_state import SteadyState, SteadyStateParameters

DEG = np.pi / 180.0
RATES = {"mems_gyro": 2000.0, "mhd_ars": 20000.0}
# The gyro as good as the MHD sensor: no slow mode, so that both filters settle in a second.
QUICK = {
    "mhd_ars": load_belief("eq39")["mhd_ars"],
    "mems_gyro": SensorBelief(numerator=(600.0,), denominator=(1.0, 600.0), input_noise=2e-8, output_noise=2e-8),
}


@pytest.mark.oracle
def test_it_is_the_kalman_filter_once_that_has_settled() -> None:
    rng = np.random.default_rng(3)
    readings = {"mems_gyro": 1e-4 * rng.standard_normal(3000), "mhd_ars": 1e-4 * rng.standard_normal(30000)}
    best = optimum(QUICK, RATES, [(10.0, DEG)])
    fixed = SteadyState(QUICK, RATES, SteadyStateParameters()).process(readings)
    kalman = Kalman(QUICK, RATES, KalmanParameters(order=best.order, q=best.q)).process(readings)
    # 1 s is e^-15 of the start in the slowest mode, two seconds e^-30.
    np.testing.assert_allclose(
        fixed.rate[-5000:], kalman.rate[-5000:], rtol=0.0, atol=1e-7 * np.max(np.abs(kalman.rate))
    )
    np.testing.assert_allclose(fixed.std[-5000:], kalman.std[-5000:], rtol=1e-5)
    for key in ("innovation_variance_mhd_ars", "innovation_variance_mems_gyro"):
        np.testing.assert_allclose(fixed.diagnostics[key][-5000:], kalman.diagnostics[key][-5000:], rtol=1e-5)


def test_the_cycle_of_gains_follows_the_clock_and_not_the_first_reading() -> None:
    """The gyro is due at every tenth step from t = 0, whether or not readings came before: claims repeat with that
    phase.
    """
    readings = {"mems_gyro": np.zeros(30), "mhd_ars": np.zeros(300)}
    late = {"mems_gyro": np.full(30, np.nan), "mhd_ars": np.full(300, np.nan)}
    late["mhd_ars"][13:], late["mems_gyro"][2:] = 0.0, 0.0
    whole, begun = (SteadyState(QUICK, RATES, SteadyStateParameters()).process(one) for one in (readings, late))
    assert np.unique(whole.std[20:30]).size == 10
    for key in ("innovation_variance_mhd_ars", "innovation_variance_mems_gyro"):
        assert np.array_equal(begun.diagnostics[key][20:], whole.diagnostics[key][20:], equal_nan=True)
    assert np.array_equal(begun.std[20:], whole.std[20:])


def test_it_is_best_at_the_signal_it_was_made_for(reference: Any) -> None:
    belief = load_belief("eq39")
    error = {}
    rate = reference.sines((100.0, 1.0), duration=2.0)
    for frequency in (1.0, 100.0):
        p = SteadyStateParameters(frequency=frequency)
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
