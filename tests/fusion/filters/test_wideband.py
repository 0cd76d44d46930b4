"""The bank against its equations written once more, and what must not break it."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
import pytest
from pydantic import ValidationError

from testbed.fusion.belief import load_belief
from testbed.fusion.filters.wideband import Wideband, WidebandParameters
from testbed.fusion.model import build_model

if TYPE_CHECKING:
    from testbed.fusion.base import EstimateBlock
    from testbed.signals import FloatArray

DEG = np.pi / 180.0
RATES = {"mems_gyro": 2000.0, "mhd_ars": 20000.0}
BELIEF = load_belief("eq39")


def run(readings: dict[str, FloatArray], **parameters: Any) -> EstimateBlock:
    return Wideband(BELIEF, RATES, WidebandParameters(**parameters)).process(readings)


def rmse(estimate: FloatArray, truth: FloatArray, last: float) -> float:
    """RMSE [deg/s] over the last seconds."""
    n = round(last * 20_000)
    return float(np.sqrt(np.mean((estimate[-n:] - truth[-n:]) ** 2)) / DEG)


def literal_bank(readings: dict[str, FloatArray], p: WidebandParameters) -> tuple[FloatArray, ...]:
    """Rate and std of the bank, innovation of the MHD ARS and its variance, with plain matrices, one filter after the
    other; nothing is refused.
    """
    q = p.q * 10.0 ** np.linspace(0.0, p.decades, p.filters)
    n_time = readings["mhd_ars"].size
    x_all, P_all, loglik, e_all, C_all = np.empty((5, q.size, n_time))
    for m, one in enumerate(q):
        model = build_model(BELIEF, RATES, order=p.order, q=float(one), start="rest")
        x, P = np.zeros(len(model.F)), model.P0.copy()
        for k in range(n_time):
            if k:
                x, P = model.F @ x, model.F @ P @ model.F.T + model.Q
            due = [0, 1] if k % 10 == 0 else [1]
            z = np.array([readings["mems_gyro"][k // 10], readings["mhd_ars"][k]])[due]
            h, R = model.H[due], np.diag(model.R[due])
            C, e = h @ P @ h.T + R, z - h @ x
            K = P @ h.T @ np.linalg.inv(C)
            A = np.eye(len(x)) - K @ h
            x, P = x + K @ e, A @ P @ A.T + K @ R @ K.T
            x_all[m, k], P_all[m, k] = x[0], P[0, 0]
            loglik[m, k] = -0.5 * (e @ np.linalg.solve(C, e) + np.linalg.slogdet(C)[1])
            e_all[m, k], C_all[m, k] = e[-1], C[-1, -1]
    rate, std, innovation, variance = np.empty((4, n_time))
    w = np.full(q.size, 1.0 / q.size)
    age = np.arange(n_time)
    for k in range(n_time):
        # Foreseen with the weights of before this reading.
        innovation[k] = w @ e_all[:, k]
        variance[k] = w @ (C_all[:, k] + (e_all[:, k] - innovation[k]) ** 2)
        s = loglik[:, : k + 1] @ np.exp(-(age[k] - age[: k + 1]) / (20_000.0 * p.memory))
        w = np.exp(s - s.max())
        w /= w.sum()
        rate[k] = w @ x_all[:, k]
        std[k] = np.sqrt(w @ (P_all[:, k] + (x_all[:, k] - rate[k]) ** 2))
    return rate, std, innovation, variance


@pytest.mark.oracle
@pytest.mark.parametrize("order", [1, 3])
def test_bank_equals_its_equations(reference: Any, order: int) -> None:
    readings = reference.readings(reference.sines((40.0, 1.0), duration=0.01), 3)
    q = {1: 1e-2 * DEG**2, 3: 1e4 * DEG**2}[order]
    p = WidebandParameters(
        order=order,
        q=q,
        decades=9.0,
        filters=4,
        surprise=1e6,
        gate=False,
        coloured=False,
        memory=2e-3,
        restart=np.inf,
        start="rest",
    )
    ours = run(readings, **p.model_dump())
    rate, std, innovation, variance = literal_bank(readings, p)
    # eps times the 1e8 by which the first readings shrink P, as for the single filter.
    np.testing.assert_allclose(ours.rate, rate, rtol=0.0, atol=1e-8 * DEG)
    np.testing.assert_allclose(ours.std, std, rtol=1e-6)
    np.testing.assert_allclose(ours.diagnostics["innovation_mhd_ars"], innovation, rtol=0.0, atol=1e-8 * DEG)
    np.testing.assert_allclose(ours.diagnostics["innovation_variance_mhd_ars"], variance, rtol=1e-6)


def test_the_weights_follow_the_signal(reference: Any) -> None:
    """A faster signal is left to the filters of larger q; the same set of parameters throughout."""
    levels = []
    for freq in (0.5, 10.0, 100.0):
        block = run(reference.readings(reference.sines((freq, 1.0), duration=1.0), 4))
        levels.append(block.diagnostics["log10_q"][-2000:].mean())
    # Between 10 and 100 Hz the best q moves by five decades (f^5 at least).
    assert levels[1] - levels[0] > 2.0
    assert levels[2] - levels[1] > 4.0


def test_a_jump_of_frequency_is_followed(reference: Any) -> None:
    slow, fast = reference.sines((0.5, 1.0), duration=3.0), reference.sines((100.0, 1.0), duration=3.0)
    rate = np.concatenate([slow, fast])
    error = run(reference.readings(rate, 5), start="rest").rate - rate
    # From 0.1 s (two memories) after the jump on, what 100 Hz costs a fixed filter and the start-up of the slow mode,
    # with margin.
    assert np.sqrt(np.mean(error[62_000:] ** 2)) / DEG < 0.006
    # Ten readings refused at the jump, during which 100 Hz moves by 0.31 deg/s.
    assert np.max(np.abs(error[60_000:])) / DEG < 0.4


def test_an_amplitude_change_of_100_times_is_followed(reference: Any) -> None:
    small, large = reference.sines((10.0, 0.1), duration=2.0), reference.sines((10.0, 10.0), duration=2.0)
    for rate in (np.concatenate([small, large]), np.concatenate([large, small])):
        block = run(reference.readings(rate, 6), start="rest")
        error = np.abs(block.rate - rate) / DEG
        assert np.isfinite(block.rate).all()
        assert rmse(block.rate, rate, 1.8) < 0.01
        # 10 readings refused at the jump, during which 10 deg/s at 10 Hz moves by 0.3 deg/s.
        assert error.max() < 0.6


FAULTS = ["nan", "dropped", "stuck mhd", "stuck gyro", "saturated", "spike", "spikes everywhere", "late", "huge"]


def spoilt(readings: dict[str, FloatArray], fault: str) -> dict[str, FloatArray]:
    """Return the readings with a fault that ends half a second before the record does."""
    mhd, gyro = readings["mhd_ars"].copy(), readings["mems_gyro"].copy()
    a, b = 20_000, 24_000
    if fault == "nan":
        mhd[a:b], gyro[a // 10 : b // 10] = np.nan, np.nan
    elif fault == "dropped":
        mhd[a:b:3], gyro[a // 10 : b // 10 : 2] = np.nan, np.nan
    elif fault == "stuck mhd":
        mhd[a:b] = mhd[a]
    elif fault == "stuck gyro":
        gyro[a // 10 : b // 10] = gyro[a // 10]
    elif fault == "saturated":
        mhd[a:b] = np.clip(mhd[a:b], -0.5 * DEG, 0.5 * DEG)
    elif fault == "spike":
        mhd[a], gyro[a // 10] = 30.0 * DEG, -300.0 * DEG
    elif fault == "spikes everywhere":
        mhd[a:b:40] += 5.0 * DEG
    elif fault == "late":
        mhd[a + 3], mhd[a] = mhd[a], np.nan
    elif fault == "huge":
        mhd[a:b] = 1e300
    return {"mhd_ars": mhd, "mems_gyro": gyro}


@pytest.mark.parametrize("fault", FAULTS)
def test_a_fault_passes_and_leaves_nothing_behind(reference: Any, fault: str) -> None:
    rate = reference.sines((4.0, 1.0), duration=1.7)
    readings = reference.readings(rate, 7)
    clean, block = run(readings, start="rest"), run(spoilt(readings, fault), start="rest")
    assert np.isfinite(block.rate).all()
    assert np.isfinite(block.std).all()
    # The slow mode of the pair of sensors keeps a trace for half a minute: it may add 0.02 deg/s, a fiftieth of the
    # signal.
    assert rmse(block.rate - clean.rate, np.zeros_like(rate), 0.4) < 0.02
    if fault in {"spike", "spikes everywhere", "late", "dropped", "stuck gyro", "huge"}:
        # One sensor is always there.
        assert np.max(np.abs(block.rate - clean.rate)[20_000:]) < 0.2 * DEG


def test_without_the_gate_a_spike_gets_through(reference: Any) -> None:
    """The other way round: the test above sees what the gate does."""
    rate = reference.sines((4.0, 1.0), duration=1.2)
    readings = reference.readings(rate, 7)
    through = run(spoilt(readings | {}, "spike"), surprise=1e6, gate=False)
    assert np.max(np.abs(through.rate - rate)[20_000:]) > 1.0 * DEG


def test_what_was_refused_is_counted(reference: Any) -> None:
    readings = reference.readings(reference.sines((4.0, 1.0), duration=1.3), 7)
    clean, spiked = run(readings, gate=False), run(spoilt(readings, "spike"), gate=False)
    assert clean.diagnostics["refused_mems_gyro"][-1] == 0.0
    assert clean.diagnostics["refused_mhd_ars"][-1] == 0.0
    assert spiked.diagnostics["refused_mhd_ars"][-1] == spiked.diagnostics["refused_mems_gyro"][-1] == 1.0


@pytest.mark.parametrize(
    "change",
    [
        {"q": 1e8 * DEG**2},
        {"decades": 8.0},
        {"filters": 5},
        {"memory": 0.005},
        {"restart": 0.1},
        {"surprise": 3.0},
        {"surprise": 3.0, "patience": 0},
        {"order": 2, "q": 1e3 * DEG**2},
        {"use_input_noise": False},
    ],
    ids=str,
)
def test_every_parameter_changes_the_estimate(reference: Any, change: dict[str, Any]) -> None:
    readings = spoilt(reference.readings(reference.sines((4.0, 1.0), duration=1.1), 7), "spike")
    assert not np.array_equal(run(readings, **change).rate, run(readings).rate)


def test_a_bank_without_a_slow_end_is_refused():
    with pytest.raises(ValidationError, match="expected more than 0, since the highest q of the bank is a multiple"):
        WidebandParameters(q=0.0)
