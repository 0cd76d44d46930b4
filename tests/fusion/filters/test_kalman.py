from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from filterpy.kalman import KalmanFilter  # type: ignore[import-untyped]
from pydantic import ValidationError
from scipy.linalg import block_diag, solve_discrete_are
from scipy.stats import chi2

from testbed.fusion.belief import default_belief
from testbed.fusion.filters.kalman import Kalman, KalmanParameters
from testbed.fusion.kernels.covariance import kalman_kernel
from testbed.fusion.model import FusionModel, build_model, covariance_root
from testbed.fusion.transitions import even
from testbed.signals import FloatArray, random_stream

DEG = np.pi / 180.0
RATES = {"mems_gyro": 2000.0, "mhd_ars": 20000.0}
Q_RATE = 0.3 * DEG**2


def _run(model: FusionModel, Z: FloatArray, x: FloatArray, P: FloatArray) -> FloatArray:
    out = np.empty((2 + 2 * len(model.H), Z.shape[1]))
    kalman_kernel(x.size, len(model.H))(
        x,
        P,
        model.F,
        model.Q,
        model.H,
        model.R,
        Z,
        even(model.F, model.Q),
        np.zeros(len(model.H), dtype=int),
        False,
        out,
    )
    return out


@pytest.mark.oracle
def test_kalman_equals_filterpy(reference: Any) -> None:
    readings = reference.readings(reference.sines((4.0, 1.0), duration=0.1), 5)
    ours = Kalman(default_belief(), RATES, KalmanParameters(coloured=False)).process(readings)
    model = build_model(default_belief(), RATES, order=1, q=Q_RATE)
    peer = KalmanFilter(dim_x=5, dim_z=2)
    peer.x, peer.P, peer.F, peer.Q = np.zeros((5, 1)), model.P0.copy(), model.F, model.Q
    for k in range(ours.rate.size):
        if k:
            peer.predict()
        due = [0, 1] if k % 10 == 0 else [1]
        z = np.array([[readings["mems_gyro"][k // 10]], [readings["mhd_ars"][k]]])[due]
        peer.dim_z = len(due)
        peer.update(z, R=np.diag(model.R)[np.ix_(due, due)], H=model.H[due])
        # eps times the 1e8 by which the first readings shrink P.
        assert ours.rate[k] == pytest.approx(peer.x[0, 0], rel=0, abs=1e-8 * DEG)
        assert ours.std[k] == pytest.approx(np.sqrt(peer.P[0, 0]), rel=1e-7, abs=0.0)


@pytest.mark.oracle
@pytest.mark.parametrize("order", [1, 2])
def test_single_rate_reaches_the_riccati_solution(order: int) -> None:
    rates = {"mems_gyro": 2000.0, "mhd_ars": 2000.0}
    q = {1: Q_RATE, 2: 1e4 * DEG**2}[order]
    model = build_model(default_belief(), rates, order=order, q=q)
    x, P = np.zeros(len(model.F)), model.P0.copy()
    # The slowest mode of the error is the crossover of the sensors, some 0.04 rad/s: 400 s leave e^(-2 * 16) of P0.
    out = _run(model, np.zeros((2, 800_000)), x, P)
    prior = solve_discrete_are(model.F.T, model.H.T, model.Q, np.diag(model.R))
    C = model.H @ prior @ model.H.T + np.diag(model.R)
    post = prior - prior @ model.H.T @ np.linalg.solve(C, model.H @ prior)
    # The solver works on a spectrum of 1e-5 around the unit circle: sqrt(eps) / 1e-5 is its worst case, 1e-6 what it
    # keeps here.
    assert out[1, -1] == pytest.approx(np.sqrt(post[0, 0]), rel=1e-6, abs=0.0)
    np.testing.assert_allclose(out[[3, 5], -1], np.diag(C), rtol=1e-6)


@pytest.mark.oracle
def test_multi_rate_reaches_the_periodic_riccati_solution() -> None:
    """Ten steps lifted into one: eleven readings per period, whose noise is correlated with the process noise of the
    period.
    """
    model = build_model(default_belief(), RATES, order=1, q=Q_RATE)
    F, H, n, steps = model.F, model.H, 5, 10
    power = [np.linalg.matrix_power(F, k) for k in range(steps + 1)]
    to_end = np.hstack([power[steps - 1 - k] for k in range(steps)])  # w_0 ... w_9 -> x_10
    lifted_H = np.vstack([H[:1], *(H[1:] @ power[k] for k in range(steps))])
    to_readings = np.zeros((steps + 1, steps * n))
    for k in range(1, steps):
        for m in range(k):
            to_readings[1 + k, m * n : (m + 1) * n] = H[1] @ power[k - 1 - m]
    W = block_diag(*[model.Q] * steps)
    R = to_readings @ W @ to_readings.T + np.diag([model.R[0], *[model.R[1]] * steps])
    prior = solve_discrete_are(power[steps].T, lifted_H.T, to_end @ W @ to_end.T, R, s=to_end @ W @ to_readings.T)
    C = H @ prior @ H.T + np.diag(model.R)
    post = prior - prior @ H.T @ np.linalg.solve(C, H @ prior)
    wanted = []
    for k in range(steps):
        if k:
            P = F @ post @ F.T + model.Q
            g = P @ H[1]
            post = P - np.outer(g, g) / (H[1] @ g + model.R[1])
        wanted.append(np.sqrt(post[0, 0]))
    stage = Kalman(default_belief(), RATES, KalmanParameters(coloured=False, gate=False))
    for _ in range(40):  # of 10 s
        block = stage.process({"mems_gyro": np.zeros(20_000), "mhd_ars": np.zeros(200_000)})
    np.testing.assert_allclose(block.std[-steps:], wanted, rtol=1e-6)


@pytest.mark.oracle
def test_kalman_equals_batch_least_squares(reference: Any) -> None:
    """The estimate is the conditional mean given all readings of the record at once."""
    model = build_model(default_belief(), RATES, order=1, q=Q_RATE)
    n_time, n = 61, 5
    power = [np.linalg.matrix_power(model.F, k) for k in range(n_time)]
    maps = [
        np.hstack([power[k], *(power[k - 1 - m] if m < k else np.zeros((n, n)) for m in range(n_time - 1))])
        for k in range(n_time)
    ]
    rows = [(0, k) for k in range(0, n_time, 10)] + [(1, k) for k in range(n_time)]
    G = np.vstack([model.H[i] @ maps[k] for i, k in rows])
    prior = block_diag(model.P0, *[model.Q] * (n_time - 1))
    covariance = G @ prior @ G.T + np.diag([model.R[i] for i, _ in rows])
    readings = reference.readings(reference.sines((10.0, 1.0), duration=n_time / 20000.0), 7)
    z = np.concatenate([readings["mems_gyro"], readings["mhd_ars"]])
    cross = (maps[-1] @ prior @ G.T)[0]
    ours = Kalman(default_belief(), RATES, KalmanParameters(coloured=False)).process(readings)
    # eps times the condition of the covariance, P0 / R = 1e9.
    assert ours.rate[-1] == pytest.approx(cross @ np.linalg.solve(covariance, z), rel=0, abs=1e-6 * DEG)
    variance = (maps[-1] @ prior @ maps[-1].T)[0, 0] - cross @ np.linalg.solve(covariance, cross)
    assert ours.std[-1] == pytest.approx(np.sqrt(variance), rel=1e-3, abs=0.0)


@pytest.mark.oracle
def test_errors_and_innovations_are_consistent_when_the_belief_is_true() -> None:
    """NEES is chi-square of 5 per run, the innovations of a sensor are white: chi-square of one per reading."""
    model = build_model(default_belief(), RATES, order=1, q=Q_RATE)
    rng = random_stream(17, "consistency")
    runs, n_time = 200, 1001
    values, vectors = np.linalg.eigh(model.Q)
    root = vectors * np.sqrt(np.clip(values, 0.0, None))
    start = covariance_root(model.P0)
    nees, nis, counts = 0.0, np.zeros(2), np.zeros(2)
    for _ in range(runs):
        x = np.empty((n_time, 5))
        x[0] = start @ rng.standard_normal(5)
        w = rng.standard_normal((n_time, 5)) @ root.T
        for k in range(1, n_time):
            x[k] = model.F @ x[k - 1] + w[k]
        Z = model.H @ x.T + np.sqrt(model.R)[:, None] * rng.standard_normal((2, n_time))
        Z[0, np.arange(n_time) % 10 != 0] = np.nan
        estimate, P = np.zeros(5), model.P0.copy()
        out = _run(model, Z, estimate, P)
        error = estimate - x[-1]
        nees += error @ np.linalg.solve(P, error)
        for i in range(2):
            ratio = out[2 + 2 * i] ** 2 / out[3 + 2 * i]
            nis[i] += np.nansum(ratio)
            counts[i] += np.count_nonzero(np.isfinite(ratio))
    # Two-sided, one false alarm in 10^4 each.
    low, high = 5e-5, 1.0 - 5e-5
    assert chi2.ppf(low, 5 * runs) < nees < chi2.ppf(high, 5 * runs)
    for total, count in zip(nis, counts, strict=True):
        assert chi2.ppf(low, count) < total < chi2.ppf(high, count)


def test_a_chosen_R_overrules_the_belief() -> None:
    quiet = Kalman(default_belief(), RATES, KalmanParameters())
    loud = Kalman(default_belief(), RATES, KalmanParameters(R={"mhd_ars": "1 (deg/s)^2"}))
    block = {"mems_gyro": np.zeros(10), "mhd_ars": np.zeros(100)}
    a, b = quiet.process(block), loud.process(block)
    difference = b.diagnostics["innovation_variance_mhd_ars"] - a.diagnostics["innovation_variance_mhd_ars"]
    assert difference[0] == pytest.approx(DEG**2, rel=1e-5, abs=0.0)
    with pytest.raises(ValueError, match="R: expected sensors of"):
        Kalman(default_belief(), RATES, KalmanParameters(R={"mhd": 1.0}))


def test_a_sensor_without_noise_needs_an_R() -> None:
    belief = default_belief()
    belief["mhd_ars"] = belief["mhd_ars"].model_copy(update={"output_noise": 0.0})
    with pytest.raises(ValueError, match="more than 0 for 'mhd_ars'"):
        Kalman(belief, RATES, KalmanParameters())
    Kalman(belief, RATES, KalmanParameters(R={"mhd_ars": 1e-10}))


@pytest.mark.parametrize(
    ("fields", "message"),
    [
        ({"q": "0.3 (deg/s)^2/s^3"}, r"expected a quantity in rad\^2/s\^3"),
        ({"q": "0.3 (deg/s)^2/s", "order": 2}, r"expected a quantity in rad\^2/s\^5"),
        ({"q": 0.3}, "the unit is missing"),
        ({"q": "-0.3 (deg/s)^2/s"}, "at least 0"),
        ({"order": 4}, "less than or equal to 3"),
        ({"R": {"mhd_ars": "0 (deg/s)^2"}}, "more than 0"),
        ({"p": 1}, "Extra inputs"),
    ],
)
def test_parameters_are_checked_at_the_border(fields: dict[str, Any], message: str) -> None:
    with pytest.raises(ValidationError, match=message):
        KalmanParameters.model_validate(fields, context={"border": True})


@pytest.mark.parametrize(("order", "q"), [(1, 0.3), (2, 1e6), (3, 1e10)])
def test_q_follows_the_order(order: int, q: float) -> None:
    written = f"{q} (deg/s)^2/s^{2 * order - 1}"
    given = KalmanParameters.model_validate({"order": order, "q": written}, context={"border": True})
    assert given.q == pytest.approx(KalmanParameters(order=order).q, rel=1e-12, abs=0.0)
    dumped = given.model_dump(context={"border": True})
    assert KalmanParameters.model_validate(dumped, context={"border": True}) == given
