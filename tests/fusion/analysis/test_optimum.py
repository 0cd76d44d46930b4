"""The settled filter in closed form against the lifted Riccati equation, the running filter and a Monte Carlo."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from scipy.linalg import block_diag, solve_discrete_are

from testbed.fusion.analysis.optimum import DECADES, optima, optimum, settled_filters
from testbed.fusion.belief import SensorBelief, default_belief, load_belief
from testbed.fusion.filters.kalman import Kalman, KalmanParameters
from testbed.fusion.model import build_model

DEG = np.pi / 180.0
RATES = {"mems_gyro": 2000.0, "mhd_ars": 20000.0}


@pytest.mark.oracle
def test_cycle_starts_at_the_lifted_riccati_solution() -> None:
    """Ten steps lifted into one, eleven readings whose noise is correlated with the process noise of the cycle."""
    q = 0.3 * DEG**2
    model, steps, n = build_model(default_belief(), RATES, order=1, q=q), 10, 5
    F, H = model.F, model.H
    power = [np.linalg.matrix_power(F, k) for k in range(steps + 1)]
    to_end = np.hstack([power[steps - 1 - k] for k in range(steps)])
    lifted_H = np.vstack([H[:1], *(H[1:] @ power[k] for k in range(steps))])
    to_readings = np.zeros((steps + 1, steps * n))
    for k in range(1, steps):
        for m in range(k):
            to_readings[1 + k, m * n : (m + 1) * n] = H[1] @ power[k - 1 - m]
    W = block_diag(*[model.Q] * steps)
    R = to_readings @ W @ to_readings.T + np.diag([model.R[0], *[model.R[1]] * steps])
    wanted = solve_discrete_are(power[steps].T, lifted_H.T, to_end @ W @ to_end.T, R, s=to_end @ W @ to_readings.T)
    found = settled_filters(default_belief(), RATES, order=1, q=np.array([q])).prior[0, 0]
    # As for the running filter (test_kalman): the solver keeps 1e-6 with a spectrum of 1e-5 around the unit circle.
    np.testing.assert_allclose(found, wanted, rtol=0.0, atol=1e-6 * np.max(np.diag(wanted)))


@pytest.mark.oracle
@pytest.mark.parametrize("order", [1, 3])
def test_running_filter_converges_to_the_cycle(order: int) -> None:
    """The fast part of the covariance settles in a second where the gyro is as good as the MHD sensor: the crossover is
    at 75 rad/s, not at 0.04.
    """
    belief = dict(load_belief("eq39"))
    belief["mems_gyro"] = SensorBelief(
        numerator=(600.0,), denominator=(1.0, 600.0), input_noise=2e-8, output_noise=2e-8
    )
    q = {1: 0.3 * DEG**2, 3: 1e10 * DEG**2}[order]
    block = Kalman(belief, RATES, KalmanParameters(order=order, q=q, coloured=False, gate=False)).process(
        {"mems_gyro": np.zeros(2000), "mhd_ars": np.zeros(20000)}
    )
    settled = settled_filters(belief, RATES, order=order, q=np.array([q]))
    post = settled.prior - settled.K @ (settled.model.H @ settled.prior)
    np.testing.assert_allclose(block.std[-10:], np.sqrt(post[:, 0, 0, 0]), rtol=1e-6)
    assert settled.std[0] == pytest.approx(np.sqrt(np.mean(block.std[-10:] ** 2)), rel=1e-6, abs=0.0)


@pytest.mark.oracle
def test_closed_form_is_what_the_fixed_filter_does(reference: Any) -> None:
    """Monte Carlo: 400 runs of a settled filter on a 200 Hz sine; noise and lag apart, each sensor's noise apart."""
    belief = dict(load_belief("eq39"))
    belief["mems_gyro"] = SensorBelief(
        numerator=(600.0,), denominator=(1.0, 600.0), input_noise=2e-8, output_noise=2e-8
    )
    q = 1e12 * DEG**2
    fixed = settled_filters(belief, RATES, order=3, q=np.array([q]))
    model, runs, n_time = fixed.model, 400, 8000
    rng = np.random.default_rng(17)
    t = np.arange(n_time) / 20_000.0
    phase = 2j * np.pi * 200.0 * t
    responses = np.array([belief[name].realisation().response(np.array([200.0])) for name in model.sensors])
    keep = np.eye(len(model.F)) - fixed.K[:, 0] @ model.H
    # Sine alone, exact readings.
    x, error = np.zeros(len(model.F)), np.empty(n_time)
    for k in range(n_time):
        z = DEG * (responses[:, 0] * np.exp(phase[k])).imag
        x = keep[k % 10] @ (model.F @ x) + fixed.K[k % 10, 0] @ z
        error[k] = x[0] - DEG * np.exp(phase[k]).imag
    lag = fixed.line_error(np.array([200.0]), responses)[0, 0] * DEG / np.sqrt(2.0)
    # 4000 samples are 40 periods; the transient of the 0.1 s before is gone to 1e-6.
    assert np.sqrt(np.mean(error[4000:] ** 2)) == pytest.approx(lag, rel=1e-3, abs=0.0)
    # Noise alone, one sensor at a time: true states under Q_i, readings under R_i, zero signal.
    for i, states in enumerate((slice(3, 4), slice(4, 6))):
        root = np.linalg.cholesky(model.Q[states, states] + 1e-40 * np.eye(states.stop - states.start))
        noisy = model.Q[states, states].any()
        truth, x = np.zeros((len(model.F), runs)), np.zeros((len(model.F), runs))
        square = []
        for k in range(5000):
            truth = model.F @ truth
            if noisy:
                truth[states] += root @ rng.standard_normal((root.shape[0], runs))
            z = model.H @ truth
            z[i] += np.sqrt(model.R[i]) * rng.standard_normal(runs)
            x = keep[k % 10] @ (model.F @ x) + fixed.K[k % 10, 0] @ z
            if k >= 4600:
                square.append(x[0] ** 2)
        found = np.mean(square)
        # 400 runs, each worth several independent samples: 5 sigma of 400 alone are 5 sqrt(2/400) = 35 %; correlated
        # 400 samples help.
        assert found == pytest.approx(fixed.noise_variance()[i, 0], rel=0.15, abs=0.0)


def test_optimum_is_the_smallest_over_the_grid_and_rises_with_the_signal() -> None:
    belief = load_belief("identified")
    found = [optimum(belief, RATES, [(freq, DEG)]) for freq in (0.5, 10.0, 100.0, 300.0)]
    assert np.all(np.diff([one.rmse for one in found]) > 0.0)
    for one in found:
        assert one.rmse == pytest.approx(np.hypot(one.noise, one.lag), rel=1e-12, abs=0.0)
        assert one.noise == pytest.approx(np.sqrt(sum(share**2 for share in one.shares.values())), rel=1e-12, abs=0.0)
        fixed = settled_filters(belief, RATES, order=one.order, q=np.array([one.q]))
        assert one.noise == pytest.approx(np.sqrt(fixed.noise_variance().sum()), rel=1e-6, abs=0.0)
        # The grid does not end where the best one lies.
        low, high = DECADES[one.order]
        assert low < np.log10(one.q) < high
    # rms of a sine of 1 deg/s times the filter's relative error.
    freq = np.array([300.0])
    truth = np.array([belief[name].realisation().response(freq) for name in RATES])
    assert found[-1].lag == pytest.approx(DEG / np.sqrt(2.0) * fixed.line_error(freq, truth)[0, 0], rel=1e-6, abs=0.0)
    louder = optimum(belief, RATES, [(10.0, 10.0 * DEG)])
    both = optimum(belief, RATES, [(10.0, DEG), (100.0, DEG)])
    assert louder.rmse > found[1].rmse
    assert both.rmse > found[2].rmse


def test_optima_of_several_signals_are_those_of_each() -> None:
    belief = load_belief("identified")
    signals = [[(10.0, DEG), (100.0, DEG)], [(10.0, DEG)], [(100.0, 0.1 * DEG)]]
    for found, lines in zip(optima(belief, RATES, signals), signals, strict=True):
        alone = optimum(belief, RATES, lines)
        assert (found.order, found.q) == (alone.order, alone.q)
        # Sums in another order.
        assert found.rmse == pytest.approx(alone.rmse, rel=1e-9, abs=0.0)
        assert found.lag == pytest.approx(alone.lag, rel=1e-9, abs=0.0)


def lifted_error(belief: dict[str, SensorBelief], order: int, q: float, freq: float) -> tuple[float, float]:
    """Return noise variance and lag of a sine of 1 by the filter lifted to ten steps: no cycle of gains, no doubling,
    no closed form.

    The prior covariance at step 0 from SciPy's Riccati solver on the lifted model; from it ten ordinary Kalman steps
    give the gains; truth and filter together, stepped until nothing changes, give noise and lag.
    """
    model = build_model(belief, RATES, order=order, q=q)
    silent = build_model(belief, RATES, order=order, q=0.0)
    steps, n = 10, len(model.F)
    power = [np.linalg.matrix_power(model.F, k) for k in range(steps + 1)]
    to_end = np.hstack([power[steps - 1 - k] for k in range(steps)])
    lifted = np.vstack([model.H[:1], *(model.H[1:] @ power[k] for k in range(steps))])
    to_readings = np.zeros((steps + 1, steps * n))
    for k in range(1, steps):
        for m in range(k):
            to_readings[1 + k, m * n : (m + 1) * n] = model.H[1] @ power[k - 1 - m]
    W = block_diag(*[model.Q] * steps)
    R = to_readings @ W @ to_readings.T + np.diag([model.R[0], *[model.R[1]] * steps])
    P = solve_discrete_are(power[steps].T, lifted.T, to_end @ W @ to_end.T, R, s=to_end @ W @ to_readings.T)
    gains = []
    for k in range(steps):
        h, r = (model.H, np.diag(model.R)) if k == 0 else (model.H[1:], np.diag(model.R[1:]))
        K = P @ h.T @ np.linalg.inv(h @ P @ h.T + r)
        gains.append(np.hstack([np.zeros((n, 2 - len(h))), K]))
        P = model.F @ (P - K @ h @ P) @ model.F.T + model.Q
    E, X, rows, noise, lag = np.zeros((n, n)), np.zeros(n, complex), [gains[k] for k in range(steps)], [], []
    responses = np.array([belief[name].realisation().response(np.array([freq]))[0] for name in model.sensors])
    for k in range(30_000):
        K = rows[k % steps]
        keep = np.eye(n) - K @ model.H
        # Error of the states of the sensors, true rate zero; then the filter alone on exact readings of a sine.
        E = keep @ (model.F @ E @ model.F.T + silent.Q) @ keep.T + (K * model.R) @ K.T
        X = keep @ (model.F @ X) + K @ (responses * np.exp(2j * np.pi * freq * k / model.sample_rate_hz))
        if k >= 29_990:
            noise.append(E[0, 0])
            lag.append(abs(X[0] - np.exp(2j * np.pi * freq * k / model.sample_rate_hz)) ** 2)
    return float(np.mean(noise)), float(np.mean(lag))


@pytest.mark.oracle
@pytest.mark.parametrize("freq", [5.0, 100.0])
def test_optimum_is_what_the_lifted_riccati_filter_leaves(freq: float) -> None:
    """Noise, lag and their sum, at the optimum's order and q; and a decade to either side is worse."""
    belief = dict(load_belief("eq39"))
    belief["mems_gyro"] = SensorBelief(
        numerator=(600.0,), denominator=(1.0, 600.0), input_noise=2e-8, output_noise=2e-8
    )
    best = optimum(belief, RATES, [(freq, DEG)])
    error = []
    for decade in (0.1, 1.0, 10.0):
        noise, lag = lifted_error(belief, best.order, decade * best.q, freq)
        error.append(noise + 0.5 * DEG**2 * lag)
    # SciPy keeps 1e-6 of the covariance; gains are at their optimum, so noise + lag moves with its square.
    assert np.sqrt(error[1]) == pytest.approx(best.rmse, rel=1e-4, abs=0.0)
    assert error[1] <= min(error)


@pytest.mark.oracle
def test_noise_variance_is_that_of_truth_and_filter_together() -> None:
    """Covariance of [true states, filter states] under one sensor's noise, step by step: no error equation, no
    doubling.
    """
    belief = dict(load_belief("eq39"))
    belief["mems_gyro"] = SensorBelief(
        numerator=(600.0,), denominator=(1.0, 600.0), input_noise=2e-8, output_noise=2e-8
    )
    fixed = settled_filters(belief, RATES, order=3, q=np.array([1e12 * DEG**2]))
    model, n = fixed.model, len(fixed.model.F)
    for i, states in enumerate((slice(3, n - 2), slice(n - 2, n))):
        noise = np.zeros((2 * n, 2 * n))
        noise[states, states] = model.Q[states, states]
        joint, last = np.zeros((2 * n, 2 * n)), []
        for k in range(10_000):
            K = fixed.K[k % 10, 0]
            move = block_diag(model.F, model.F)
            learn = np.block([[np.eye(n), np.zeros((n, n))], [K @ model.H, np.eye(n) - K @ model.H]])
            on_reading = np.concatenate([np.zeros(n), K[:, i]])
            joint = learn @ (move @ joint @ move.T + noise) @ learn.T + model.R[i] * np.outer(on_reading, on_reading)
            if k >= 9_990:
                last.append(joint[n, n])
        # The true rate is zero; the slowest mode, 75 rad/s, is down by e^-75 in variance.
        assert np.mean(last) == pytest.approx(fixed.noise_variance()[i, 0], rel=1e-6, abs=0.0)


def test_a_sensor_without_output_noise_is_refused() -> None:
    belief = {"mems_gyro": SensorBelief(numerator=(1.0,), denominator=(1.0, 1.0), input_noise=1e-5)}
    with pytest.raises(ValueError, match="belief: expected an output_noise"):
        settled_filters(belief, {"mems_gyro": 100.0}, order=1, q=np.ones(1))


@pytest.mark.parametrize(("order", "written"), [(1, 0.0070), (2, 0.0022), (3, 0.0014)])
def test_why_the_signal_model_is_of_order_three(order: int, written: float) -> None:
    """The figures of docs/wideband.md, 1 deg/s at 100 Hz, two digits."""
    found = optimum(load_belief("identified"), RATES, [(100.0, DEG)], orders=(order,)).rmse / DEG
    assert round(found, 4) == written
