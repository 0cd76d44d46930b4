from __future__ import annotations

import os
import subprocess
import sys
from fractions import Fraction
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest
from numba import njit

from testbed.fusion import estimate
from testbed.fusion.belief import default_belief
from testbed.fusion.filters import kalman, shakf, steady_state, wideband
from testbed.fusion.kernels.covariance import HEADER_ROWS, innovation, kalman_kernel, predict, update
from testbed.fusion.model import build_model
from testbed.fusion.transitions import even

if TYPE_CHECKING:
    from testbed.signals import FloatArray


KERNELS = {
    kalman: "kalman_kernel",
    shakf: "adaptive_kernel",
    steady_state: "settling_kernel",
    wideband: "bank_kernel",
}


def _rows(readings: dict[str, FloatArray]) -> FloatArray:
    Z = np.full((2, readings["mhd_ars"].size), np.nan)
    Z[0, ::10], Z[1] = readings["mems_gyro"], readings["mhd_ars"]
    return Z


@pytest.mark.oracle
@pytest.mark.parametrize("order", [1, 2, 3])
def test_kernel_equals_the_joint_matrix_form(reference: Any, order: int) -> None:
    """Scalar readings one after the other are the joint update for diagonal R; NaN and missing readings are skipped by
    both.
    """
    q = {1: 9e-5, 2: 300.0, 3: 3e6}[order]
    model = build_model(default_belief(), reference.rates, order=order, q=q, start="rest")
    Z = _rows(reference.readings(reference.sines((4.0, 1.0), duration=0.1), 3))
    Z[1, 500:520] = np.inf
    Z[0, 700] = np.inf
    Z[:, 0] = np.nan
    wanted = reference.run(model, Z, [reference.sensor(R=value) for value in model.R])
    x, P, out = np.zeros(len(model.F)), model.P0.copy(), np.empty((6, Z.shape[1]))
    kalman_kernel(x.size, 2)(
        x, P, model.F, model.Q, model.H, model.R, Z, even(model.F, model.Q), np.zeros(2, dtype=int), False, out
    )
    # P starts 1e8 times above what the first reading leaves, so the matrix form keeps eps * 1e8 of it.
    scale = np.radians(1.0)
    np.testing.assert_allclose(out[0], wanted["rate"], rtol=0, atol=1e-8 * scale)
    np.testing.assert_allclose(out[1], wanted["std"], rtol=1e-7)
    for i in range(2):
        np.testing.assert_allclose(out[HEADER_ROWS + 2 * i], wanted[f"e{i}"], rtol=0, atol=1e-8 * scale)
        np.testing.assert_allclose(out[HEADER_ROWS + 2 * i + 1], wanted[f"C{i}"], rtol=1e-7)
    assert np.array_equal(P, P.T)


@pytest.mark.oracle
def test_predict_and_update_equal_rational_arithmetic() -> None:
    """Small integers: every product and sum is exact in floating point but the division by C."""
    F, P, Q = np.array([[1.0, 2.0], [0.0, 1.0]]), np.array([[5.0, 1.0], [1.0, 3.0]]), np.array([[1.0, 0.0], [0.0, 2.0]])
    x, H = np.array([1.0, -2.0]), np.array([[1.0, 3.0]])
    predict(x, P, F, Q, np.zeros((2, 2), int), np.empty((2, 2)), np.empty(2), 2, 2)
    assert np.array_equal(x, [-3.0, -2.0])
    assert np.array_equal(P, [[22.0, 7.0], [7.0, 5.0]])
    R, z = 4, 10
    update(x, P, H, np.array([[0, 2, 2, 2]]), 0, float(z), float(R), np.empty(2), np.empty(2), 2, 2)
    g = [22 + 21, 7 + 15]
    C = g[0] + 3 * g[1] + R
    K = [Fraction(one, C) for one in g]
    e = z - (-3 + 3 * -2)
    prior = [[22, 7], [7, 5]]
    A = [[(i == j) - K[i] * h for j, h in enumerate((1, 3))] for i in range(2)]
    for i in range(2):
        assert x[i] == pytest.approx(float([-3, -2][i] + K[i] * e), rel=1e-14, abs=0.0)
        for j in range(2):
            exact = sum(A[i][k] * prior[k][m] * A[j][m] for k in range(2) for m in range(2)) + K[i] * R * K[j]
            assert P[i, j] == pytest.approx(float(exact), rel=1e-13, abs=0.0)


@pytest.mark.oracle
@pytest.mark.parametrize("R", [1e-6, 1e-10, 1e-13])
def test_update_keeps_a_variance_far_below_the_prior(R: float) -> None:
    """P R/(P + R) with P = 1: (1 - K)P keeps eps/R of it, the Joseph form, second order in the error of K, (eps/R)^2 +
    eps.
    """
    x, P, H = np.zeros(1), np.eye(1), np.ones((1, 1))
    update(x, P, H, np.array([[0, 1, 1, 1]]), 0, 0.0, R, np.empty(1), np.empty(1), 1, 1)
    eps = np.finfo(float).eps
    assert P[0, 0] == pytest.approx(R / (1.0 + R), rel=10 * (eps / R) ** 2 + 10 * eps, abs=0.0)


@pytest.mark.oracle
@pytest.mark.parametrize("name", ["kalman", "steady_state", "shakf", "wideband"])
def test_slow_states_known_to_the_kernel_make_the_same_filter(
    name: str, reference: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The kernels that take every state for one of the core go through all products; sums differ by their order."""
    readings = reference.readings(reference.sines((4.0, 1.0), duration=0.3), 3)
    readings["mhd_ars"][500:520] = np.nan
    chosen = {"sample_rate_hz": reference.rates, "start": "rest", "coloured": True}
    ours = estimate(name, readings, **chosen)
    for module, kernel in KERNELS.items():
        plain = getattr(module, kernel)
        monkeypatch.setattr(module, kernel, lambda *sizes, plain=plain: plain(*sizes[:-1]))
    whole = estimate(name, readings, **chosen)
    assert not np.array_equal(ours.rate, whole.rate)
    np.testing.assert_allclose(ours.rate, whole.rate, rtol=0, atol=1e-8 * np.radians(1.0))
    np.testing.assert_allclose(ours.std, whole.std, rtol=1e-6)


def test_nothing_is_predicted_before_the_first_reading() -> None:
    model = build_model(default_belief(), {"mems_gyro": 2000.0, "mhd_ars": 20000.0}, order=1, q=1.0)
    Z = np.full((2, 50), np.nan)
    Z[1, ::2] = np.inf
    x, P, out = np.zeros(5), model.P0.copy(), np.empty((6, 50))
    assert not kalman_kernel(5, 2)(
        x, P, model.F, model.Q, model.H, model.R, Z, even(model.F, model.Q), np.zeros(2, dtype=int), False, out
    )
    assert np.array_equal(P, model.P0)
    assert np.array_equal(out[1], np.full(50, np.sqrt(model.P0[0, 0])))


@pytest.mark.slow
def test_what_a_kernel_calls_is_compiled_once_for_all_sizes(monkeypatch: pytest.MonkeyPatch) -> None:
    """A size that reaches it as a literal makes a version of its own: seconds more for every model that is new."""

    def afresh(*sizes: Any) -> Any:
        return njit(error_model="numpy")(kalman_kernel(*sizes).py_func)

    monkeypatch.setattr(kalman, "kalman_kernel", afresh)
    estimate("kalman", {"mems_gyro": np.zeros(2)}, sample_rate_hz={"mems_gyro": 2000.0})
    for called in (predict, update, innovation):
        assert called.signatures
        assert not [signature for signature in called.signatures if "Literal" in str(signature)]


_SECOND_START = """
import numpy as np
from testbed.fusion import estimate
from testbed.fusion.kernels.covariance import JOSEPH, adaptive_kernel, kalman_kernel
z = {"mems_gyro": np.zeros(2), "mhd_ars": np.zeros(20)}
for name in ("kalman", "arw_shakf"):
    estimate(name, z, sample_rate_hz={"mems_gyro": 2000.0, "mhd_ars": 20000.0})
kernels = kalman_kernel(16, 2, JOSEPH, 11), adaptive_kernel(5, 2, JOSEPH, 0)
print(sum(sum(k.stats.cache_misses.values()) for k in kernels))
"""


@pytest.mark.slow
def test_a_second_process_does_not_compile(tmp_path: Any) -> None:
    env = os.environ | {"NUMBA_CACHE_DIR": str(tmp_path)}
    runs = [
        subprocess.run([sys.executable, "-c", _SECOND_START], env=env, check=True, capture_output=True, text=True)
        for _ in range(2)
    ]
    assert [int(run.stdout) for run in runs] == [2, 0]
