"""Covariance forms and single precision: the same filter, and what rounding does to each."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
import pytest

from testbed.fusion import estimate
from testbed.fusion.belief import default_belief, load_belief
from testbed.fusion.filters.kalman import Kalman, KalmanParameters
from testbed.fusion.kernels.covariance import (
    CONVENTIONAL,
    JOSEPH,
    LOST_VARIANCE,
    SQUARE_ROOT,
    gain_root,
    kalman_kernel,
    predict_root,
    triangularise,
    update_root,
)
from testbed.fusion.model import build_model, covariance_root
from testbed.fusion.transitions import even
from testbed.signals import random_stream

if TYPE_CHECKING:
    from testbed.signals import FloatArray

DEG = np.pi / 180.0
RATES = {"mems_gyro": 2000.0, "mhd_ars": 20000.0}
EPS = np.finfo(float).eps
EVERY = [
    ("kalman", {"coloured": False}),
    ("kalman", {"order": 2, "coloured": False}),
    ("kalman", {}),
    ("shakf", {"adapt": ("R", "Q", "r")}),
    ("shakf", {"adapt": ("Q_rate",)}),
    ("arw_shakf", {}),
    ("arw_shakf", {"adapt": ("R", "Q")}),
    ("arw_shakf_literal", {}),
    ("allan_srkf", {}),
]


@pytest.fixture(scope="module")
def readings(reference: Any) -> dict[str, FloatArray]:
    signal: dict[str, FloatArray] = reference.readings(reference.sines((4.0, 1.0), (25.0, 0.5), duration=0.3), 4)
    signal["mhd_ars"][1500:1503] = np.nan
    signal["mems_gyro"][200] = np.nan
    return signal


@pytest.mark.oracle
@pytest.mark.parametrize(("name", "parameters"), [*EVERY, ("wideband", {})])
def test_all_forms_are_the_same_filter(name: str, parameters: dict[str, Any], readings: dict[str, FloatArray]) -> None:
    blocks = {
        form: estimate(name, readings, sample_rate_hz=RATES, start="rest", form=form, **parameters)
        for form in ("joseph", "conventional", "square_root")
    }
    wanted = blocks["joseph"]
    assert len({block.rate.tobytes() for block in blocks.values()}) == 3
    for form, block in blocks.items():
        # P shrinks by 1e8 on the first readings, and the adaptation of Q and R feeds back: as in the tests of each
        # filter.
        np.testing.assert_allclose(block.rate, wanted.rate, rtol=0, atol=1e-6 * DEG, err_msg=form)
        np.testing.assert_allclose(block.std, wanted.std, rtol=1e-5, err_msg=form)
        for key, value in wanted.diagnostics.items():
            atol = 1e-6 * np.nanmax(np.abs(value), initial=0.0)
            if key == "guard_hits":
                # The second reading changes the variance of the gyro's slow state by 1.6e-16 of itself: rounding
                # decides whether it counts.
                atol = max(atol, 1.0)
            np.testing.assert_allclose(block.diagnostics[key], value, rtol=1e-4, atol=atol, err_msg=f"{form} {key}")


@pytest.mark.parametrize("form", ["joseph", "conventional", "square_root"])
@pytest.mark.parametrize(("name", "parameters"), EVERY)
def test_single_precision_differs_but_stays_near(
    name: str, parameters: dict[str, Any], form: str, readings: dict[str, FloatArray]
) -> None:
    double = estimate(name, readings, sample_rate_hz=RATES, start="rest", form=form, **parameters)
    single = estimate(name, readings, sample_rate_hz=RATES, start="rest", form=form, precision="single", **parameters)
    assert np.array_equal(single.rate, single.rate.astype(np.float32))
    assert not np.array_equal(single.rate, double.rate)
    # No bound can be derived through the feedback of the adaptation; 3 % of the amplitude tells rounding from a
    # mistake.
    np.testing.assert_allclose(single.rate, double.rate, rtol=0, atol=0.03 * DEG)


@pytest.mark.oracle
@pytest.mark.parametrize("form", [CONVENTIONAL, JOSEPH])
def test_single_precision_is_single_throughout(form: int) -> None:
    """One state, F = H = 1: the same operations in numpy's float32 give the same bits, so no sum is formed in
    double.
    """
    one, Q, R = np.ones((1, 1), np.float32), np.float32(0.01), np.float32(0.003)
    Z = 0.1 * random_stream(3, "single").standard_normal((1, 200))
    out = np.empty((4, 200))
    x, P = np.float32(0.0), np.float32(0.07)
    kalman_kernel(1, 1, form)(
        x * one[0], P * one, one, Q * one, one, R * one[0], Z, even(one, one), np.zeros(1, dtype=int), False, out
    )
    for k, z in enumerate(Z[0].astype(np.float32)):
        P = P + Q * np.float32(k > 0)
        K, e = P / (R + P), z - x
        x, short = x + K * e, P - K * P
        P = short if form == CONVENTIONAL else short - (-R * K + short) * K
        assert out[0, k] == x
        assert out[1, k] == np.sqrt(P)


@pytest.mark.oracle
def test_triangularise_keeps_the_product_and_makes_a_triangle() -> None:
    rng = random_stream(5, "array")
    for n, width in ((1, 2), (3, 1), (3, 4), (5, 3), (7, 8)):
        m = n + width - 1
        A = rng.standard_normal((n, m)) * 10.0 ** rng.uniform(-6, 0, (n, 1))
        A[0, 1:] = 0.0
        A[np.arange(m) >= np.arange(n)[:, None] + width] = 0.0
        L = A.copy()
        triangularise(L, n, width)
        assert np.array_equal(np.triu(L, 1), np.zeros((n, m)))
        rows = np.linalg.norm(A, axis=1)
        # Householder is backward stable row by row: m eps of each pair of rows.
        assert np.all(np.abs(L @ L.T - A @ A.T) <= 10 * m * EPS * np.outer(rows, rows))
        wanted = np.abs(np.asarray(np.linalg.qr(A.T, mode="r")).T)
        np.testing.assert_allclose(np.abs(L[:, :n]), wanted, rtol=0, atol=100 * m * EPS * rows.max())


@pytest.mark.oracle
@pytest.mark.parametrize("due", [(True, True), (True, False), (False, True)])
def test_root_steps_equal_the_matrix_equations(due: tuple[bool, bool]) -> None:
    rng = random_stream(6, "root")
    n = 4
    F, D, S, H = (rng.standard_normal((k, n)) for k in (n, n, n, 2))
    S = np.tril(S)
    R, z = np.array([0.5, 2.0]), rng.standard_normal(2)
    x0 = rng.standard_normal(n)
    x, root, array = x0.copy(), D.copy(), np.empty((n, 2 * n))
    predict_root(x, root, F, S, array, np.empty(n), n)
    P = F @ D @ D.T @ F.T + S @ S.T
    np.testing.assert_allclose(root @ root.T, P, rtol=0, atol=1e-13 * np.abs(P).max())
    np.testing.assert_allclose(x, F @ x0, rtol=0, atol=1e-14)
    e = np.where(due, z - H @ x, 0.0)
    G, C, K = np.empty((2, n)), np.zeros((2, 2)), np.empty((n, 2))
    before = x.copy()
    gain_root(x, root, H, e, R, np.array(due), G, C, K, n, 2)
    h = np.diag(np.array(due, float)) @ H
    gain = P @ h.T @ np.linalg.inv(h @ P @ h.T + np.diag(R))
    np.testing.assert_allclose(K, gain, rtol=0, atol=1e-12)
    np.testing.assert_allclose(x, before + gain @ e, rtol=0, atol=1e-12)
    update_root(root, G, K, R, np.array(due), n, 2)
    A = np.eye(n) - gain @ h
    wanted = A @ P @ A.T + gain @ np.diag(R) @ gain.T
    np.testing.assert_allclose(root @ root.T, wanted, rtol=0, atol=1e-12 * np.abs(P).max())


def test_covariance_root() -> None:
    model = build_model(default_belief(), RATES, order=3, q=3e6)
    for P in (model.Q, model.P0, np.zeros((2, 2)), np.diag([1.0, 0.0, 1e-20])):
        D = covariance_root(P)
        assert np.array_equal(D, np.tril(D))
        std = np.sqrt(np.diag(P))
        assert np.all(np.abs(D @ D.T - P) <= 50 * EPS * np.outer(std, std))
    # An adapting Q relies on it: a diagonal has a diagonal root.
    np.testing.assert_allclose(covariance_root(np.diag([4.0, 9.0, 1e-20])), np.diag([2.0, 3.0, 1e-10]), rtol=4 * EPS)


def _run_nine_states(form: str, precision: str) -> tuple[FloatArray, list[FloatArray]]:
    """Return the rate, and the covariance after each tenth of a second, in the setting of docs/numerics.md."""
    parameters = KalmanParameters(form=form, precision=precision, order=3)
    stage = Kalman(load_belief("paper2"), dict.fromkeys(RATES, 20000.0), parameters)
    rng, rates, covariances = random_stream(1, "forms"), [], []
    for _ in range(10):
        white = 1e-3 * rng.standard_normal((2, 2000))
        rates.append(stage.process({"mems_gyro": white[0], "mhd_ars": white[1]}).rate)
        covariances.append(stage.covariance)
    return np.concatenate(rates), covariances


def test_the_root_stays_positive_in_single_precision_where_the_others_do_not() -> None:
    """Order 3 (nine states), belief `paper2` in modal realisation, its R, P0 of the model, 1 s at 20 kHz."""
    reference, truth = _run_nine_states("joseph", "double")
    lowest = {}
    for form in ("conventional", "joseph", "square_root"):
        rate, found = _run_nine_states(form, "single")
        lowest[form] = min(np.linalg.eigvalsh(0.5 * (P + P.T))[0] for P in found)
        print(
            f"{form}: lowest eigenvalue {lowest[form]:.2e}, rate off {np.abs(rate - reference).max() / DEG:.1e} deg/s"
        )
    print(f"double: {min(np.linalg.eigvalsh(P)[0] for P in truth):.2e}, condition {np.linalg.cond(truth[-1]):.1e}")
    assert lowest["conventional"] < 0.0
    assert lowest["joseph"] < 0.0
    assert lowest["square_root"] > 0.0


def test_the_root_stays_usable_over_two_million_steps() -> None:
    """100 s at 20 kHz, about the slowest time constant: beyond, rounding forgets as much as it collects (the hour:
    bench_forms.py).

    6e-8 of rounding at each of 2e6 steps is at most 12 % of P, 6 % of the standard deviation.
    """
    rates, silent = dict.fromkeys(RATES, 20000.0), dict.fromkeys(RATES, np.zeros(200_000))
    root, exact = (
        Kalman(
            load_belief("paper2"), rates, KalmanParameters(form=form, precision=precision, coloured=False, gate=False)
        )
        for form, precision in (("square_root", "single"), ("joseph", "double"))
    )
    for _ in range(10):
        ours, wanted = root.process(silent).std[-1], exact.process(silent).std[-1]
        assert np.linalg.eigvalsh(root.covariance)[0] > 0.0
        assert ours == pytest.approx(wanted, rel=0.06, abs=0.0)


def test_square_root_divides_into_blocks_bit_for_bit(readings: dict[str, FloatArray]) -> None:
    parameters = KalmanParameters(form="square_root", precision="single")
    whole = Kalman(default_belief(), RATES, parameters).process(readings)
    stage = Kalman(default_belief(), RATES, parameters)
    parts = [
        stage.process(
            {"mems_gyro": readings["mems_gyro"][-(-a // 10) : -(-b // 10)], "mhd_ars": readings["mhd_ars"][a:b]}
        )
        for a, b in ((0, 13), (13, 2000), (2000, 6000))
    ]
    assert np.array_equal(np.concatenate([part.rate for part in parts]), whole.rate)
    assert np.array_equal(np.concatenate([part.std for part in parts]), whole.std)


@pytest.mark.oracle
@pytest.mark.parametrize("form", [JOSEPH, SQUARE_ROOT])
def test_a_rate_that_is_lost_goes_back_as_if_read_at_zero(form: int) -> None:
    """Without a reading P grows to LOST_VARIANCE and no further: the Kalman update with z = 0 and
    R = V P / (P - V) leaves V for the rate, and its share for what goes with it.
    """
    n, F, Q = 2, np.array([[1.0, 0.5], [0.0, 1.0]]), np.diag([0.1, 0.2])
    P, x, H = np.array([[0.6, 0.1], [0.1, 0.5]]), np.array([0.3, 2.0]), np.array([[1.0, 0.0]])
    expected_x, expected_P = x.copy(), P.copy()
    for _ in range(5):
        expected_x, expected_P = F @ expected_x, F @ expected_P @ F.T + Q
        spread = expected_P[0, 0]
        if spread > LOST_VARIANCE:
            C = spread + LOST_VARIANCE * spread / (spread - LOST_VARIANCE)
            K = expected_P[:, :1] / C
            expected_x, expected_P = expected_x - K[:, 0] * expected_x[0], expected_P - K @ (H @ expected_P)
    out, Z = np.empty((4, 5)), np.full((1, 5), np.nan)
    carried, noise = (covariance_root(one) if form == SQUARE_ROOT else one for one in (P, Q))
    kalman_kernel(n, 1, form)(
        x, carried, F, noise, H, np.array([1.0]), Z, even(F, noise), np.zeros(1, dtype=int), True, out
    )
    left = carried @ carried.T if form == SQUARE_ROOT else carried
    assert expected_P[0, 0] == pytest.approx(LOST_VARIANCE)
    np.testing.assert_allclose(left, expected_P, rtol=1e-12)
    np.testing.assert_allclose(x, expected_x, rtol=1e-12)
