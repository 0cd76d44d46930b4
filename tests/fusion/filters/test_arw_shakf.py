from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any

import jsonschema
import numpy as np
import pytest
from pydantic import ValidationError
from ruamel.yaml import YAML

from testbed import ScenarioError, load_scenario
from testbed.fusion import estimate
from testbed.fusion.bands import Bands, calibrate_bands, increment_variance
from testbed.fusion.belief import default_belief
from testbed.fusion.filters.arw_shakf import (
    ArwShakf,
    ArwShakfLiteral,
    ArwShakfLiteralParameters,
    ArwShakfParameters,
)
from testbed.fusion.filters.kalman import Kalman, KalmanParameters
from testbed.fusion.kernels.covariance import SENSOR, inflation
from testbed.fusion.model import build_model
from testbed.runs.folder import write_scenario
from testbed.scenario.schema import schema

if TYPE_CHECKING:
    from pathlib import Path

    from testbed.signals import FloatArray

DEG = np.pi / 180.0
RATES = {"mems_gyro": 2000.0, "mhd_ars": 20000.0}


def _rows(readings: dict[str, FloatArray]) -> FloatArray:
    Z = np.full((2, readings["mhd_ars"].size), np.nan)
    Z[0, ::10], Z[1] = readings["mems_gyro"], readings["mhd_ars"]
    Z[1, np.isnan(Z[1])] = np.inf
    Z[0, ::10][np.isnan(Z[0, ::10])] = np.inf
    return Z


@pytest.fixture(scope="module")
def readings(reference: Any) -> dict[str, FloatArray]:
    """4 Hz, then 25 Hz too, so that bands are entered one after the other."""
    rate = reference.sines((4.0, 1.0), duration=0.25)
    rate[2500:] += reference.sines((25.0, 1.0), duration=0.125)
    signal: dict[str, FloatArray] = reference.readings(rate, 4)
    signal["mhd_ars"][1500:1503] = np.nan
    signal["mems_gyro"][200] = np.nan
    return signal


def _literal_sensors(reference: Any, parameters: ArwShakfParameters) -> list[Any]:
    sensors = []
    for name, rate_hz in RATES.items():
        bands = parameters.bands[name]
        sensors.append(
            reference.sensor(
                R=parameters.R0[name],
                fit_noise=True,
                beta=parameters.beta,
                floor=parameters.R_floor,
                difference=parameters.innovation == "difference",
                alpha=parameters.alpha,
                window=parameters.window,
                memory_readings=math.inf if parameters.memory is None else rate_hz * parameters.memory,
                thresholds=bands.thresholds,
                levels=bands.R,
                wait=max(1, math.ceil(bands.wait * rate_hz)),
                clamp=math.inf if parameters.clamp is None else parameters.clamp,
            )
        )
    return sensors


@pytest.mark.oracle
@pytest.mark.parametrize(
    "parameters",
    [
        ArwShakfParameters(),
        ArwShakfLiteralParameters(),
        ArwShakfLiteralParameters(q=0.0056 * DEG**2),
        ArwShakfParameters(clamp=3.0, innovation="value", memory=0.02, window=50),
        ArwShakfParameters(clamp=1.0, alpha=0.0),
        ArwShakfParameters(R_floor=4e-7 * DEG**2),
    ],
    ids=["corrected", "literal", "literal at the q of shakf", "clamped", "frozen", "bands below the floor"],
)
def test_every_step_equals_the_equations(
    reference: Any, readings: dict[str, FloatArray], parameters: ArwShakfParameters
) -> None:
    ours = ArwShakf(default_belief(), RATES, parameters).process(readings)
    model = build_model(default_belief(), RATES, order=1, q=parameters.q, use_input_noise=parameters.use_input_noise)
    wanted = reference.run(model, _rows(readings), _literal_sensors(reference, parameters))
    # As in test_shakf: eps * 1e8 from the start, some tens from the feedback through R.
    np.testing.assert_allclose(ours.rate, wanted["rate"], rtol=0, atol=1e-6 * DEG)
    np.testing.assert_allclose(ours.std, wanted["std"], rtol=1e-5)
    for i, name in enumerate(RATES):
        judged = np.where(wanted[f"band{i}"] < 0, np.nan, wanted[f"band{i}"])
        assert np.array_equal(ours.diagnostics[f"band_{name}"], judged, equal_nan=True)
        for ours_key, key in (("R", "R"), ("N", "N"), ("S", "S"), ("innovation_variance", "C")):
            given = ours.diagnostics[f"{ours_key}_{name}"]
            # N_k needs two readings; before, ours is undefined.
            seen = np.isfinite(given)
            np.testing.assert_allclose(given[seen], wanted[f"{key}{i}"][seen], rtol=1e-4)
    # The record shows what it is to show: two bands, and S at work where it is on.
    assert {1.0, 2.0} <= set(ours.diagnostics["band_mhd_ars"])
    assert (np.nanmax(ours.diagnostics["S_mhd_ars"]) > 1.5) == (parameters.alpha > 0.0)


def test_without_adaptation_it_is_the_kalman_filter(readings: dict[str, FloatArray]) -> None:
    q = KalmanParameters().q
    neutral = ArwShakf(default_belief(), RATES, ArwShakfParameters(adapt=(), R0={}, bands={}, alpha=0.0, q=q)).process(
        readings
    )
    plain = Kalman(default_belief(), RATES, KalmanParameters(coloured=False)).process(readings)
    assert np.array_equal(neutral.rate, plain.rate)
    assert np.array_equal(neutral.std, plain.std)


def test_a_band_sets_the_R_of_its_own_sensor(readings: dict[str, FloatArray]) -> None:
    """The trap of the paper: index 1 is the MHD ARS in N_k, but the gyro in R."""
    parameters = ArwShakfParameters(clamp=1.0)
    block = ArwShakf(default_belief(), RATES, parameters).process(readings)
    for name, bands in parameters.bands.items():
        band, R = block.diagnostics[f"band_{name}"], block.diagnostics[f"R_{name}"]
        judged = np.isfinite(band)
        assert judged.any()
        levels = np.maximum(bands.R, 0.0)[band[judged].astype(int)]
        np.testing.assert_allclose(R[judged], levels, rtol=1e-12)


def test_bands_wait(readings: dict[str, FloatArray]) -> None:
    for filter_class, parameters, first in (
        (ArwShakf, ArwShakfParameters(), {"mems_gyro": 1300, "mhd_ars": 200}),
        (ArwShakfLiteral, ArwShakfLiteralParameters(), {"mems_gyro": 10, "mhd_ars": 1}),
    ):
        block = filter_class(default_belief(), RATES, parameters).process(readings)
        for name, sample in first.items():
            assert np.flatnonzero(np.isfinite(block.diagnostics[f"band_{name}"]))[0] == sample


@pytest.mark.oracle
def test_N_of_a_sine_is_its_mean_squared_increment(reference: Any) -> None:
    """(32): A^2 sin^2(pi f dT) for a sine A at f behind the sensor, over whole periods."""
    freq_hz, n = 10.0, 40_000
    rate = reference.sines((freq_hz, 1.0), duration=n / 20000.0 + 1.0)
    readings = reference.readings(rate, 0, noise=False)
    steady = {"mems_gyro": readings["mems_gyro"][2000:], "mhd_ars": readings["mhd_ars"][20000:]}
    block = estimate("arw_shakf_literal", steady, sample_rate_hz=RATES)
    for name, gain in (("mems_gyro", 0.429914), ("mhd_ars", 0.982128)):
        wanted = (gain * DEG * np.sin(np.pi * freq_hz / RATES[name])) ** 2
        N = block.diagnostics[f"N_{name}"]
        # First-order hold of the signal (pi f T)^2/3 = 1e-6, the gain to six digits, ends of the record at most one
        # increment in 4000.
        assert N[np.isfinite(N)][-1] == pytest.approx(wanted, rel=1e-3, abs=0.0)
        assert increment_variance(steady[name]) == pytest.approx(N[np.isfinite(N)][-1], rel=1e-9, abs=0.0)


def test_fading_memory_sees_a_late_change_and_the_literal_form_does_not(reference: Any) -> None:
    rate = reference.sines((0.5, 1.0), duration=12.0)
    rate[200_000:] = reference.sines((10.0, 1.0), duration=2.0)
    readings = reference.readings(rate, 8)
    bands = {
        name: estimate(name, readings, sample_rate_hz=RATES).diagnostics["band_mhd_ars"][-1]
        for name in ("arw_shakf", "arw_shakf_literal")
    }
    assert bands == {"arw_shakf": 2.0, "arw_shakf_literal": 1.0}


def test_S_forgets_a_huge_innovation_within_two_windows() -> None:
    """A running sum alone would keep eps * 1e8 of it for ever."""
    n, square = 50, 1e-10
    sensors, windows = np.zeros(1, dtype=SENSOR), np.zeros((1, n))
    sensors["alpha"] = 0.5
    S = [inflation(sensors[0], windows, 0, 1e8 if k == 60 else square, square / 8.0) for k in range(60 + 2 * n)]
    # alpha C_hat / C = 0.5 * 8, before the first lap is full too; eps times the lap's additions.
    np.testing.assert_allclose(S[:60], 4.0, rtol=1e-13)
    assert min(S[60 : 60 + n]) > 1e16
    np.testing.assert_allclose(S[100 + n :], 4.0, rtol=1e-13)


@pytest.mark.slow
def test_calibration_on_a_sweep_gives_thresholds_like_the_defaults(reference: Any) -> None:
    """A stepped sweep over 0.1-25 Hz at 1 deg/s, one-second records after a second to settle."""
    freq_hz = np.array([0.1, 0.3, 1.0, 2.0, 3.0, 5.0, 8.0, 12.0, 25.0])
    levels: dict[str, list[float]] = {name: [] for name in RATES}
    for i, freq in enumerate(freq_hz):
        # Whole periods of the slow ones, as an increment depends on the phase.
        settle, measure = 2.0, max(2.0, 1.0 / freq)
        readings = reference.readings(reference.sines((freq, 1.0), duration=settle + measure), 100 + i)
        for name, rate_hz in RATES.items():
            levels[name].append(increment_variance(readings[name][int(settle * rate_hz) :]))
    for name, bands in ArwShakfParameters().bands.items():
        # The linear sensors of this test stand in for the physics on which the defaults were calibrated
        # (tests/examples/test_defaults.py).
        ratio = np.array(calibrate_bands(freq_hz, np.array(levels[name]))) / bands.thresholds
        assert np.all((ratio > 0.5) & (ratio < 2.0)), (name, ratio)


def test_calibration_interpolates_a_power_law_exactly() -> None:
    freq_hz = np.geomspace(0.1, 25.0, 7)
    low, high = calibrate_bands(freq_hz, 3e-9 * freq_hz**2, edges_hz=(1.0, 7.0))
    assert low == pytest.approx(3e-9, rel=1e-12, abs=0.0)
    assert high == pytest.approx(3e-9 * 49.0, rel=1e-12, abs=0.0)


@pytest.mark.parametrize(
    ("level", "edges", "message"),
    [
        (1.0, (0.05, 5.0), "within a rising sweep"),
        (1.0, (5.0, 2.0), "two rising"),
        (0.0, (1.0, 5.0), "expected to rise"),
    ],
)
def test_calibration_refuses_what_it_cannot_judge(level: float, edges: tuple[float, float], message: str) -> None:
    freq_hz = np.geomspace(0.1, 25.0, 7)
    with pytest.raises(ValueError, match=message):
        calibrate_bands(freq_hz, 1e-9 * freq_hz**level, edges_hz=edges)


def test_bands_are_checked() -> None:
    with pytest.raises(ValidationError, match="thresholds: expected the low-mid edge below"):
        Bands(thresholds=(2e-9, 1e-9), R=(1e-9, 1e-9, 1e-9))
    bands = ArwShakfParameters().bands
    with pytest.raises(ValueError, match="bands: expected sensors of"):
        ArwShakf(default_belief(), RATES, ArwShakfParameters(bands={"gyro": bands["mems_gyro"]}))
    with pytest.raises(ValidationError, match="the unit is missing"):
        ArwShakfParameters.model_validate(
            {"bands": {"mhd_ars": {"thresholds": [1e-9, 2e-9], "R": [1, 1, 1]}}}, context={"border": True}
        )


def test_shipped_bands_are_the_default_and_named_by_estimate(readings: dict[str, FloatArray]) -> None:
    named = ArwShakfParameters(bands="sx300_adis16505")
    assert named == ArwShakfParameters()
    gyro, mhd = (named.bands[name] for name in RATES)
    assert gyro.thresholds == (1.0e-5 * DEG**2, 3.8e-5 * DEG**2)
    assert gyro.R == (1e-4 * DEG**2, 1e-3 * DEG**2, 1e-2 * DEG**2)
    assert mhd.thresholds == (7.0e-7 * DEG**2, 1.5e-6 * DEG**2)
    assert mhd.R == (6.5e-7 * DEG**2, 2e-7 * DEG**2, 1e-7 * DEG**2)
    # The literal form judges from the second reading on; with the shipped bands it waits as they say.
    own, waiting = (
        estimate("arw_shakf_literal", readings, sample_rate_hz=RATES, **chosen).diagnostics["band_mhd_ars"]
        for chosen in ({}, {"bands": "sx300_adis16505"})
    )
    assert [np.flatnonzero(np.isfinite(band))[0] for band in (own, waiting)] == [1, 200]
    assert np.array_equal(own[300:], waiting[300:], equal_nan=True)


def test_bands_that_are_not_shipped_are_refused() -> None:
    with pytest.raises(ValidationError, match=r"unknown set of bands 'sx300' \(known: .*sx300_adis16505"):
        ArwShakfParameters(bands="sx300")


def test_a_scenario_may_name_bands_and_keeps_their_limits(tmp_path: Path) -> None:
    text = """
name: banded
duration: 1 s
turntable: {mode: fixed}
motion: [{sine: {frequency: 4 Hz, rate: 1 deg/s}}]
sensors: {mhd_ars: {preset: sx300}, mems_gyro: {preset: adis16505_filtered}}
fusion: {arw_shakf_literal: {bands: BANDS}}
"""
    path = tmp_path / "banded.yaml"
    path.write_text(text.replace("BANDS", "sx300_adis16505"))
    jsonschema.validate(YAML(typ="safe", pure=True).load(path.read_text()), schema())
    scenario = load_scenario(path)
    write_scenario(tmp_path, scenario.resolved(), {})
    first, second = (
        one.fusion["arw_shakf_literal"].parameters for one in (scenario, load_scenario(tmp_path / "scenario.yaml"))
    )
    assert first == second == ArwShakfLiteralParameters(bands="sx300_adis16505", start="rest")
    path.write_text(text.replace("BANDS", "sx300"))
    with pytest.raises(ScenarioError, match="unknown set of bands 'sx300'"):
        load_scenario(path)
