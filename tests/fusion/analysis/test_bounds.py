"""The bounds of a signal: against the covariance of the noise alone, stepped, and against an independent code."""

from __future__ import annotations

import numpy as np
import pytest

from testbed.fusion.analysis import bounds
from testbed.fusion.analysis.bounds import never_settles, run_bounds, settled_bounds
from testbed.fusion.analysis.optimum import optimum
from testbed.fusion.belief import SensorBelief
from testbed.fusion.model import build_model
from testbed.scenario.beliefs import belief_of
from testbed.units import DEG

RATES = {"mhd_ars": 20000.0, "mems_gyro": 2000.0}
EXACT = {"mhd_ars": belief_of("sx300", exact=True), "mems_gyro": belief_of("adis16505_filtered", exact=True)}
# Sensors of few states at low rates, so that their covariance can be stepped.
SMALL_RATES = {"mhd_ars": 200.0, "mems_gyro": 100.0}
SMALL = {
    "mhd_ars": SensorBelief(numerator=(1.0, 0.0), denominator=(1.0, 2.0), output_noise=1e-5, noise_knee=0.5),
    "mems_gyro": SensorBelief(
        numerator=(30.0,),
        denominator=(1.0, 30.0),
        input_noise=1e-4,
        output_noise=1e-6,
        bias_instability=2e-4,
        lowest_frequency=1e-2,
    ),
}
MIXED = [(0.5, np.pi * 5.555e-3), (10.0, 2.0 * np.pi * 10.0 * 50e-6)]


def noise_alone(order, q, start, n_step):
    """Step Riccati's covariance, and beside its gains the covariance of what the noise and the start leave."""
    model = build_model(SMALL, SMALL_RATES, order=order, q=q, coloured=True, start=start)
    quiet = build_model(SMALL, SMALL_RATES, order=order, q=0.0, coloured=True, start=start)
    P, S, eye, found = model.P0.copy(), model.P0.copy(), np.eye(len(model.F)), []
    for k in range(n_step):
        if k:
            P = model.F @ P @ model.F.T + model.Q
            S = quiet.F @ S @ quiet.F.T + quiet.Q
        used = model.due[k % model.cycle]
        h, R = model.H[used], np.diag(model.R[used])
        K = np.linalg.solve(h @ P @ h.T + R, h @ P).T
        keep = eye - K @ h
        P = keep @ P @ keep.T + K @ R @ K.T
        S = keep @ S @ keep.T + K @ R @ K.T
        found.append(S[0, 0])
    return np.array(found)


@pytest.mark.oracle
@pytest.mark.parametrize("start", ["rest", "unknown"])
def test_noise_of_a_run_is_the_covariance_of_the_noise_alone(start):
    """Of the best filter that was found; 5e-3 for the difference by ln q and the four samples of the window."""
    (bound,) = run_bounds(SMALL, SMALL_RATES, [[(1.0, DEG)]], start=start, window=(20.0, 40.0))
    stepped = noise_alone(bound.order, bound.q, start, 8000)[4000:].mean()
    assert bound.noise**2 == pytest.approx(stepped, rel=5e-3, abs=0.0)


@pytest.mark.oracle
def test_the_settled_bound_is_the_end_of_a_long_run():
    """The slowest state forgets in 16 s: after 200 s a run has settled."""
    (settled,) = settled_bounds(SMALL, SMALL_RATES, [[(1.0, DEG)]])
    assert settled.noise**2 == pytest.approx(
        noise_alone(settled.order, settled.q, "rest", 40_000)[-1], rel=2e-3, abs=0.0
    )
    (late,) = run_bounds(SMALL, SMALL_RATES, [[(1.0, DEG)]], start="unknown", window=(900.0, 1000.0))
    assert late.rmse == pytest.approx(settled.rmse, rel=1e-3, abs=0.0)


@pytest.mark.oracle
def test_bounds_of_the_mixed_lines_are_those_of_an_independent_code():
    """0.00140 settled and 0.00070 from a rest over 4 to 8 s, from a Kalman filter of other states (sixteen, its own fit
    of the 1/f noise) whose covariance was stepped: 3 % for the fits of both.
    """
    (settled,) = settled_bounds(EXACT, RATES, [MIXED])
    (rest,) = run_bounds(EXACT, RATES, [MIXED], start="rest", window=(4.0, 8.0))
    (unknown,) = run_bounds(EXACT, RATES, [MIXED], start="unknown", window=(4.0, 8.0))
    print(
        *(f"{one.rmse / DEG:.5f}" for one in (settled, rest, unknown)),
        "deg/s settled, from rest, from an unknown start",
    )
    assert settled.rmse / DEG == pytest.approx(0.00140, rel=0.03, abs=0.0)
    assert rest.rmse / DEG == pytest.approx(0.00070, rel=0.03, abs=0.0)
    assert rest.rmse < settled.rmse < unknown.rmse


def test_slow_noise_raises_the_bound_and_its_absence_gives_the_white_optimum():
    none = {"noise_knee": None, "bias_instability": 0.0, "rate_random_walk": 0.0, "turn_on_bias": 0.0}
    white = {name: one.model_copy(update=none) for name, one in EXACT.items()}
    signal = [(10.0, DEG)]
    (bound,), best = settled_bounds(white, RATES, [signal]), optimum(white, RATES, signal)
    # Quarters of decades can only be better than decades.
    assert 0.9 * best.rmse < bound.rmse <= best.rmse * (1.0 + 1e-3)
    assert settled_bounds(EXACT, RATES, [signal])[0].rmse > 1.5 * bound.rmse


def test_each_signal_is_judged_by_itself():
    signals = [[(0.5, DEG)], [(100.0, DEG)], [(0.5, DEG), (100.0, DEG)]]
    slow, fast, both = settled_bounds(EXACT, RATES, signals)
    assert slow.rmse < fast.rmse < both.rmse
    assert slow.order in {1, 2, 3}


def test_a_random_walk_never_settles_and_is_bounded_in_a_run():
    walking = EXACT | {"mems_gyro": EXACT["mems_gyro"].model_copy(update={"rate_random_walk": 1e-4})}
    assert "random walk of mems_gyro" in never_settles(walking)
    assert not never_settles(EXACT)
    early, late = (
        run_bounds(walking, RATES, [MIXED], start="rest", window=window)[0] for window in ((4.0, 8.0), (40.0, 80.0))
    )
    assert early.rmse < late.rmse


def test_a_turn_on_bias_is_the_bound_of_a_constant_rate_unless_the_rest_is_known():
    biased = EXACT | {"mems_gyro": EXACT["mems_gyro"].model_copy(update={"turn_on_bias": 0.2 * DEG})}
    unknown = run_bounds(biased, RATES, [MIXED], start="unknown", window=(10.0, 20.0))[0]
    rest = run_bounds(biased, RATES, [MIXED], start="rest", window=(10.0, 20.0))[0]
    assert unknown.rmse == pytest.approx(0.2 * DEG, rel=0.05, abs=0.0)
    assert rest.rmse < 0.01 * DEG


def test_a_signal_may_change_its_order_when_the_search_is_refined(monkeypatch):
    """Of two signals with orders 2 and 3, both are better off with the refined order 2: none is left of order 3."""

    class Search:
        def __init__(self, *_):
            pass

        def best(self, order, q):
            coarse = {1: (9.0, 9.0), 2: (2.0, 4.0), 3: (8.0, 3.0)}[order]
            found = coarse if q.size > 10 else (1.0, 1.0)
            return [bounds.SignalBound(rmse, rmse, 0.0, order, 1.0) for rmse in found]

    monkeypatch.setattr(bounds, "_Search", Search)
    found = settled_bounds(SMALL, {"slow": 1.25}, [[(1.0, DEG)], [(2.0, DEG)]])
    assert [one.rmse for one in found] == [1.0, 1.0]
