from __future__ import annotations

import itertools

import control
import numpy as np
import pytest
from scipy.linalg import expm, solve_continuous_lyapunov

from testbed.fusion.belief import SensorBelief, default_belief
from testbed.fusion.model import build_model, continuous_model, van_loan
from testbed.signals import FloatArray, transfer

RATES = {"mems_gyro": 2000.0, "mhd_ars": 20000.0}


def _eq39(order: int) -> tuple[FloatArray, FloatArray, FloatArray]:
    return continuous_model(list(default_belief().values()), order=order, q=1.0, use_input_noise=True)


@pytest.mark.oracle
@pytest.mark.parametrize("T", [5e-5, 1e-2, 1.0])
def test_van_loan_equals_quadrature(T: float) -> None:
    A, Qc, _ = _eq39(2)
    F, Q = van_loan(A, Qc, T)
    # Gauss-Legendre on pieces that shrink towards 0, where the 8500 rad/s mode lives: 30 nodes are exact for e^(-85
    # s/T) there.
    edges = np.concatenate([[0.0], T * 0.5 ** np.arange(22)[::-1]])
    nodes, weights = np.polynomial.legendre.leggauss(30)
    wanted = np.zeros_like(Q)
    for low, high in itertools.pairwise(edges):
        for u, w in zip(nodes, weights, strict=True):
            E = expm(A * (low + (high - low) * (u + 1.0) / 2.0))
            wanted += w * (high - low) / 2.0 * E @ Qc @ E.T
    np.testing.assert_allclose(F, expm(A * T), rtol=1e-10, atol=1e-14)
    scale = np.sqrt(np.outer(np.diag(wanted), np.diag(wanted)))
    assert np.abs((Q - wanted) / scale).max() < 1e-10


@pytest.mark.oracle
@pytest.mark.parametrize("T", [5e-5, 1e-2, 10.0])
def test_van_loan_satisfies_the_lyapunov_identity(T: float) -> None:
    """For a stable A the stationary X = F X F' + Q at any step."""
    A = np.array([[-0.1, 0.0, 0.0], [3.0, -28.0, 5.0], [2000.0, -5.0, -8500.0]])
    Qc = np.diag([1.0, 0.0, 0.5])
    X = solve_continuous_lyapunov(A, -Qc)
    F, Q = van_loan(A, Qc, T)
    np.testing.assert_allclose(F @ X @ F.T + Q, X, rtol=1e-9)
    assert np.array_equal(Q, Q.T)


@pytest.mark.oracle
@pytest.mark.parametrize("order", [1, 2, 3])
def test_signal_chain_has_the_closed_form_noise(order: int) -> None:
    """Q_ij = q T^(a+b+1) / (a! b! (a+b+1)), a = m-1-i, b = m-1-j, derivatives per 10 ms."""
    from math import factorial

    q, T = 0.7, 1.0 / 20000.0
    model = build_model(default_belief(), RATES, order=order, q=q)
    for i in range(order):
        for j in range(order):
            a, b = order - 1 - i, order - 1 - j
            wanted = q * T ** (a + b + 1) / (factorial(a) * factorial(b) * (a + b + 1)) * 1e-2 ** (i + j)
            assert model.Q[i, j] == pytest.approx(wanted, rel=1e-9, abs=0.0)


@pytest.mark.oracle
@pytest.mark.parametrize(("row", "name"), list(enumerate(RATES)))
def test_discrete_model_has_the_bode_of_a_hold(row: int, name: str) -> None:
    """x_1 of order 1 stands still within a step, so x_1 to reading is the zero-order hold of the sensor."""
    model = build_model(default_belief(), RATES, order=1, q=1.0)
    T, freq = 1.0 / 20000.0, np.array([0.01, 0.5, 4.0, 10.0, 100.0, 1000.0])
    sensor = default_belief()[name]
    hold = control.sample_system(sensor.transfer_function(), T, method="zoh")
    wanted = control.frequency_response(hold, 2 * np.pi * freq).complex.squeeze()
    z = np.exp(2j * np.pi * freq * T)
    A, B = model.F[1:, 1:], model.F[1:, 0]
    ours = np.array([model.H[row, 1:] @ np.linalg.solve(one * np.eye(4) - A, B) for one in z])
    # control forms the polynomial of the discrete poles: 1 - e^(-0.1 T) = 5e-6 loses that much of eps at 0.01 Hz.
    np.testing.assert_allclose(ours, wanted, rtol=1e-6)
    slow = freq <= 10.0
    w = 2 * np.pi * freq[slow]
    delayed = transfer(list(sensor.numerator), list(sensor.denominator), freq[slow]) * np.exp(-0.5j * w * T)
    # Beyond half a step of delay a hold differs by (wT)^2/24 and by aliases, f/fs of the gain that is left at fs: below
    # f/fs = 5e-4.
    np.testing.assert_allclose(ours[slow], delayed, rtol=5e-4)


def test_input_noise_enters_beside_the_rate() -> None:
    A, Qc, H = _eq39(1)
    gyro = default_belief()["mems_gyro"].realisation()
    assert np.array_equal(A[1:3, 0], gyro.B)
    np.testing.assert_allclose(Qc[1:3, 1:3], (np.radians(0.15) / 60.0) ** 2 * np.outer(gyro.B, gyro.B), rtol=1e-12)
    assert np.count_nonzero(Qc[3:]) == 0
    assert np.array_equal(H, [[0, 1, 1, 0, 0], [0, 0, 0, 1, 1]])
    assert (
        np.count_nonzero(continuous_model(list(default_belief().values()), order=1, q=1.0, use_input_noise=False)[1])
        == 1
    )


def test_two_gyros_are_possible() -> None:
    belief = default_belief()
    both = {"a": belief["mems_gyro"], "b": belief["mems_gyro"], "m": belief["mhd_ars"]}
    model = build_model(both, {"a": 1000.0, "b": 2000.0, "m": 20000.0}, order=3, q=1.0)
    assert model.F.shape == (9, 9)
    assert model.strides == (20, 10, 1)
    assert model.R[1] == pytest.approx(2.0 * model.R[0], rel=1e-12, abs=0.0)


@pytest.mark.parametrize(
    ("rates", "message"),
    [
        ({"mhd_ars": 20000.0, "mems_gyro": 3000.0}, "integer multiple of 'mems_gyro'"),
        ({"mhd_ars": 0.0}, "more than 0 Hz for 'mhd_ars'"),
        ({"mhd_ars": float("nan")}, "more than 0 Hz"),
        ({"mhd": 20000.0}, "belief: expected one for each of"),
        ({}, "belief: expected one"),
    ],
)
def test_build_model_refuses_bad_rates(rates: dict[str, float], message: str) -> None:
    with pytest.raises(ValueError, match=message):
        build_model(default_belief(), rates, order=1, q=1.0)


def test_input_noise_with_feed_through_is_refused() -> None:
    direct = SensorBelief(numerator=(1.0, 0.0), denominator=(1.0, 1.0), input_noise=1e-5)
    with pytest.raises(ValueError, match="add a pole"):
        build_model({"a": direct}, {"a": 100.0}, order=1, q=1.0)
