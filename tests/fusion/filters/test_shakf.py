from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
import pytest
from pydantic import ValidationError

from testbed.fusion import estimate
from testbed.fusion.belief import default_belief
from testbed.fusion.filters.kalman import Kalman, KalmanParameters
from testbed.fusion.filters.shakf import Shakf, ShakfParameters
from testbed.fusion.model import build_model

if TYPE_CHECKING:
    from testbed.signals import FloatArray

DEG = np.pi / 180.0
RATES = {"mems_gyro": 2000.0, "mhd_ars": 20000.0}
R0 = {"mems_gyro": 1e-4 * DEG**2, "mhd_ars": 6.5e-7 * DEG**2}


def rows(readings: dict[str, FloatArray]) -> FloatArray:
    Z = np.full((2, readings["mhd_ars"].size), np.nan)
    Z[0, ::10], Z[1] = readings["mems_gyro"], readings["mhd_ars"]
    Z[1, np.isnan(Z[1])] = np.inf
    Z[0, ::10][np.isnan(Z[0, ::10])] = np.inf
    return Z


@pytest.fixture(scope="module")
def readings(reference: Any) -> dict[str, FloatArray]:
    signal: dict[str, FloatArray] = reference.readings(reference.sines((4.0, 1.0), (25.0, 0.5), duration=0.2), 4)
    signal["mhd_ars"][1500:1503] = np.nan
    signal["mems_gyro"][200] = np.nan
    return signal


@pytest.mark.oracle
@pytest.mark.parametrize(
    ("adapt", "chosen"),
    [
        (("R",), []),
        (("R", "r"), []),
        (("R", "Q"), [0, 1, 2, 3, 4]),
        (("R", "Q_rate"), [0]),
        (("Q_rate",), [0]),
        (("r",), []),
    ],
)
def test_every_step_equals_the_equations(
    reference: Any, readings: dict[str, FloatArray], adapt: Any, chosen: list[int]
) -> None:
    parameters = ShakfParameters(adapt=adapt, start="rest")
    ours = Shakf(default_belief(), RATES, parameters).process(readings)
    model = build_model(default_belief(), RATES, order=1, q=parameters.q, use_input_noise=False, start="rest")
    floor = parameters.R_floor
    sensors = [reference.sensor(R=R, fit_noise="R" in adapt, fit_offset="r" in adapt, floor=floor) for R in R0.values()]
    wanted = reference.run(model, rows(readings), sensors, adapt_Q=chosen)
    # The first readings shrink P by 1e8 (eps * 1e8 in the matrix form); the feedback through R and Q multiplies that by
    # some tens.
    np.testing.assert_allclose(ours.rate, wanted["rate"], rtol=0, atol=1e-6 * DEG)
    np.testing.assert_allclose(ours.std, wanted["std"], rtol=1e-5)
    np.testing.assert_allclose(ours.diagnostics["Q_rate"], wanted["Q_rate"], rtol=1e-4)
    for i, name in enumerate(RATES):
        np.testing.assert_allclose(ours.diagnostics[f"R_{name}"], wanted[f"R{i}"], rtol=1e-4)
        np.testing.assert_allclose(ours.diagnostics[f"innovation_{name}"], wanted[f"e{i}"], rtol=0, atol=1e-6 * DEG)


def test_without_adaptation_it_is_the_kalman_filter(readings: dict[str, FloatArray]) -> None:
    q = KalmanParameters().q
    neutral = Shakf(default_belief(), RATES, ShakfParameters(adapt=(), R0={}, q=q, use_input_noise=True)).process(
        readings
    )
    plain = Kalman(default_belief(), RATES, KalmanParameters(coloured=False)).process(readings)
    assert np.array_equal(neutral.rate, plain.rate)
    assert np.array_equal(neutral.std, plain.std)


def test_R_stays_above_its_floor_and_hits_are_counted(readings: dict[str, FloatArray]) -> None:
    still = {key: np.zeros_like(value) for key, value in readings.items()}  # no innovation at all: (17) goes negative
    floor = 1e-9 * DEG**2
    block = Shakf(default_belief(), RATES, ShakfParameters(R_floor=floor, gate=False)).process(still)
    for name in RATES:
        R = block.diagnostics[f"R_{name}"]
        # The very first reading is used with R0.
        assert np.all(R[np.isfinite(R)][1:] == floor)
    hits = block.diagnostics["guard_hits"]
    assert np.all(np.diff(hits) >= 0)
    # d_0 = 1 forgets R0, so that every reading of both sensors hits.
    assert hits[-1] == sum(value.size for value in still.values())


def test_Q_stays_positive(readings: dict[str, FloatArray]) -> None:
    block = Shakf(default_belief(), RATES, ShakfParameters(adapt=("R", "Q"))).process(readings)
    assert np.all(block.diagnostics["Q_rate"] >= 0.0)
    assert np.all(np.isfinite(block.rate))


def test_R_finds_the_noise_of_the_sensor(reference: Any) -> None:
    """At standstill with a q that is true (none), (17) converges to the variance of the readings, quantisation
    included.
    """
    n = 200_000
    noise = reference.readings(np.zeros(n), 9)
    block = estimate("shakf", noise, sample_rate_hz=RATES, q=1e-12, beta=0.99999)
    step = 2.3e-4 * DEG
    true = 1e-14 * 20000.0 + step**2 / 12.0
    # About 1e5 readings remembered after 2e5: relative scatter sqrt(2 / 1e5) = 0.45 %, four sigma.
    assert block.diagnostics["R_mhd_ars"][-1] == pytest.approx(true, rel=0.018, abs=0.0)


def test_it_runs_away_below_the_critical_q_and_not_above(reference: Any) -> None:
    """q_crit = (T/2) A^2 w^2 for order 1: the lag of the filter is counted as noise, which slows the filter further."""
    freq_hz = 4.0
    signal = reference.sines((freq_hz, 1.0), duration=8.0)
    readings = reference.readings(signal, 6)
    critical = 0.5 / 20000.0 * DEG**2 * (2 * np.pi * freq_hz) ** 2
    error = {}
    for factor in (0.6, 1.6):
        rate = estimate("shakf", readings, sample_rate_hz=RATES, q=factor * critical).rate
        error[factor] = np.sqrt(np.mean((rate - signal)[signal.size // 2 :] ** 2))
    assert error[0.6] > 10.0 * error[1.6]


@pytest.mark.parametrize(
    ("fields", "message"),
    [
        ({"beta": 1.0}, "less than 1"),
        ({"adapt": ["S"]}, "Input should be"),
        ({"order": 2}, "no default for order 2"),
        ({"R_floor": "0 (deg/s)^2"}, "more than 0"),
        ({"R0": {"mhd_ars": 1e-4}}, "the unit is missing"),
    ],
)
def test_parameters_are_checked(fields: dict[str, Any], message: str) -> None:
    with pytest.raises(ValidationError, match=message):
        ShakfParameters.model_validate(fields, context={"border": True})


def test_R0_of_an_unknown_sensor_is_refused() -> None:
    with pytest.raises(ValueError, match="R0: expected sensors of"):
        Shakf(default_belief(), RATES, ShakfParameters(R0={"gyro": 1e-8}))
