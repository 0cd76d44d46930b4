"""The filters from the literature against their papers' equations in plain NumPy, and against the Kalman filter."""

from __future__ import annotations

import numpy as np
import pytest

from testbed.fusion import estimate
from testbed.fusion.filters.imm import Imm
from testbed.fusion.filters.kalman import Kalman
from testbed.fusion.filters.vb_akf import VbAkf
from testbed.fusion.model import build_model
from tests.contract.records import BELIEF, RATES, built, readings_of, sines
from tests.records import FS, cut, mixed, record, rms

N_TIME = 3000


@pytest.fixture(scope="module")
def readings():
    """Return a tenth of a second of two lines, with readings that are lost."""
    whole = readings_of(sines((10.0, 1.0), (0.5, 0.3), duration=0.15), 3)
    given = {name: values[: N_TIME if name == "mhd_ars" else N_TIME // 10].copy() for name, values in whole.items()}
    given["mhd_ars"][1200:1230] = np.nan
    given["mems_gyro"][60:63] = np.nan
    return given


def instants(readings, sensors):
    """Yield for each step the sensors that have a reading, and their readings."""
    for k in range(N_TIME):
        found = {}
        for i, name in enumerate(sensors):
            stride = round(RATES["mhd_ars"] / RATES[name])
            if k % stride == 0 and np.isfinite(readings[name][k // stride]):
                found[i] = readings[name][k // stride]
        yield np.array(list(found), dtype=int), np.array(list(found.values()))


def updated(m, P, H, R, z):
    """Return the joint update of all readings of an instant, and twice the log of their innovations' density."""
    S = H @ P @ H.T + np.diag(R)
    inverse = np.linalg.inv(S)
    K, e = P @ H.T @ inverse, z - H @ m
    A = np.eye(len(m)) - K @ H
    post = A @ P @ A.T + K @ np.diag(R) @ K.T
    return m + K @ e, 0.5 * (post + post.T), -np.linalg.slogdet(S)[1] - e @ inverse @ e


def sarkka_nummenmaa(readings, forget, iterations):
    model = build_model(BELIEF, RATES, order=1, q=VbAkf.Parameters().q)
    m, P = np.zeros(len(model.F)), model.P0
    alpha, beta = np.ones(model.R.size), model.R.copy()
    rates, stds, used = [], [], []
    started = False
    for due, z in instants(readings, model.sensors):
        if started:
            m, P = model.F @ m, model.F @ P @ model.F.T + model.Q
        started |= bool(due.size)
        if due.size:
            H, before = model.H[due], forget * beta[due]
            alpha[due] = 0.5 + forget * alpha[due]
            m_prior, P_prior, now = m, P, before
            for _ in range(iterations):
                R = now / alpha[due]
                m, P, _ = updated(m_prior, P_prior, H, R, z)
                now = before + 0.5 * (z - H @ m) ** 2 + 0.5 * np.diag(H @ P @ H.T)
            beta[due] = now
            used.append(R[-1])
        rates.append(m[0])
        stds.append(P[0, 0] ** 0.5)
    return np.array(rates), np.array(stds), np.array(used)


def blom_bar_shalom(readings, ratios, stay):
    q = Imm.Parameters().q
    models = [build_model(BELIEF, RATES, order=1, q=ratio * q) for ratio in ratios]
    n_model, one = len(models), models[0]
    p = np.full((n_model, n_model), (1.0 - stay) / (n_model - 1))
    np.fill_diagonal(p, stay)
    x, P = [np.zeros(len(one.F))] * n_model, [one.P0] * n_model
    mu, rates, stds, weights, started = np.full(n_model, 1.0 / n_model), [], [], [], False
    for due, z in instants(readings, one.sensors):
        c = mu
        if started:
            c = p.T @ mu
            shares = p * mu[:, None] / c
            x0 = [sum(shares[i, j] * x[i] for i in range(n_model)) for j in range(n_model)]
            P0 = [
                sum(shares[i, j] * (P[i] + np.outer(x[i] - x0[j], x[i] - x0[j])) for i in range(n_model))
                for j in range(n_model)
            ]
            x = [one.F @ x0[j] for j in range(n_model)]
            P = [one.F @ P0[j] @ one.F.T + models[j].Q for j in range(n_model)]
        started |= bool(due.size)
        if due.size:
            found = [updated(x[j], P[j], one.H[due], one.R[due], z) for j in range(n_model)]
            x, P = [one_[0] for one_ in found], [one_[1] for one_ in found]
            logs = np.array([one_[2] for one_ in found])
            c = c * np.exp(0.5 * (logs - logs.max()))
        mu = c / c.sum()
        mean = mu @ np.array([one_[0] for one_ in x])
        rates.append(mean)
        stds.append(np.sqrt(sum(mu[j] * (P[j][0, 0] + (x[j][0] - mean) ** 2) for j in range(n_model))))
        weights.append(mu)
    return np.array(rates), np.array(stds), np.array(weights)


def test_vb_akf_is_the_papers_recursion(readings):
    """A joint update by an inverse against scalar ones in Joseph form: P starts 1e6 above what the readings leave."""
    rate, std, used = sarkka_nummenmaa(readings, 1.0 - np.exp(-4.0), 5)
    found = built("vb_akf").process(readings)
    np.testing.assert_allclose(found.rate, rate, rtol=0, atol=1e-7 * np.abs(rate).max())
    np.testing.assert_allclose(found.std, std, rtol=1e-6)
    shown = found.diagnostics["R_mhd_ars"]
    np.testing.assert_allclose(shown[np.isfinite(shown)][-500:], used[-500:], rtol=1e-5)


def test_imm_is_the_papers_recursion(readings):
    rate, std, weights = blom_bar_shalom(readings, (0.01, 1.0, 100.0), np.exp(-1.0 / 20_000.0))
    found = built("imm").process(readings)
    np.testing.assert_allclose(found.rate, rate, rtol=0, atol=1e-7 * np.abs(rate).max())
    np.testing.assert_allclose(found.std, std, rtol=1e-6)
    for j in range(3):
        np.testing.assert_allclose(found.diagnostics[f"probability_{j}"], weights[:, j], rtol=0, atol=1e-6)


def alone(readings):
    return Kalman(BELIEF, RATES, Kalman.Parameters(coloured=False)).process(readings)


@pytest.mark.parametrize(
    ("name", "parameters"),
    [("imm", {"ratios": (1.0,)}), ("imm", {"ratios": (1.0, 1.0, 1.0)})],
    ids=["one model", "equal models"],
)
def test_imm_without_a_choice_is_the_kalman_filter(readings, name, parameters):
    found = built(name, **parameters).process(readings)
    np.testing.assert_allclose(found.rate, alone(readings).rate, rtol=0, atol=1e-9)
    np.testing.assert_allclose(found.std, alone(readings).std, rtol=1e-7)


def test_vb_akf_that_is_certain_of_its_variances_is_the_kalman_filter(readings):
    stage = built("vb_akf", forget=1.0)
    stage._alpha[:] = 1e9
    stage._beta[:] *= 1e9
    found = stage.process(readings)
    np.testing.assert_allclose(found.rate, alone(readings).rate, rtol=0, atol=1e-9)
    np.testing.assert_allclose(found.std, alone(readings).std, rtol=1e-6)


def test_vb_akf_has_come_to_its_fixed_point_within_its_iterations(readings):
    """Five leave nothing that fifty would change; the two that implementations take leave little."""
    fixed = built("vb_akf", iterations=50).process(readings).rate
    off = {n: np.std(built("vb_akf", iterations=n).process(readings).rate - fixed) / np.std(fixed) for n in (2, 5)}
    print(off)
    assert off[5] < 1e-5
    assert off[2] < 1e-4


def test_vb_akf_finds_a_variance_that_its_belief_does_not_have():
    """The readings of the MHD ARS ten times as noisy as believed: R is that, within the scatter of 2000 squares."""
    rng = np.random.default_rng(5)
    std = BELIEF["mhd_ars"].output_noise * np.sqrt(RATES["mhd_ars"])
    z = {"mhd_ars": 10.0 * std * rng.standard_normal(8000), "mems_gyro": 1e-12 * rng.standard_normal(800)}
    stage = VbAkf(BELIEF, RATES, VbAkf.Parameters(forget=0.999, q="1e-6 (deg/s)^2/s", start="rest"))
    R = stage.process(z).diagnostics["R_mhd_ars"]
    # The effective number of squares is 2 / (1 - rho) = 2000, so 6 sigma of their mean are 6 sqrt(2 / 2000).
    assert R[-1] == pytest.approx((10.0 * std) ** 2, rel=6.0 * np.sqrt(2.0 / 2000.0))


def test_imm_tells_a_calm_signal_from_an_agile_one():
    calm = built("imm").process(readings_of(sines((0.5, 0.05), duration=0.5), 1))
    agile = built("imm").process(readings_of(sines((200.0, 3.0), duration=0.5), 1))
    likely = [
        np.array([block.diagnostics[f"probability_{j}"][2000:].mean() for j in range(3)]) for block in (calm, agile)
    ]
    assert np.argmax(likely[0]) == 0
    assert np.argmax(likely[1]) == 2
    for block in (calm, agile):
        total = sum(block.diagnostics[f"probability_{j}"] for j in range(3))
        np.testing.assert_allclose(total, 1.0, rtol=0, atol=1e-12)


def test_imm_lets_its_slowest_model_spoil_an_unknown_start():
    """A model too slow for 10 Hz takes its lag for a constant rate, which an unknown start leaves open and no reading
    takes back: mixed in, it is an error many times the claim. One model by itself is honest on the same readings.
    """
    rate, z = cut(*record(mixed, 9.0, 1), 5.8)
    part = slice(round(1.0 * FS), round(3.0 * FS))
    over = {}
    for ratios in ((0.01, 1.0, 100.0), (1.0,)):
        found = estimate("imm", z, sample_rate_hz=RATES, belief="identified", ratios=ratios, verdict=False)
        over[ratios] = rms((found.rate - rate)[part]) / rms(found.std[part])
    assert over[1.0,] < 1.5
    assert over[0.01, 1.0, 100.0] > 4.0
    assert "ten times the claim" in Imm.caution
