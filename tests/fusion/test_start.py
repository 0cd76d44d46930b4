"""What a filter knows before its first reading, against closed forms of a one-pole sensor."""

from __future__ import annotations

import numpy as np
import pytest

from testbed.fusion.belief import SensorBelief, load_belief
from testbed.fusion.model import build_model
from testbed.fusion.start import REST_STD, unknown_spread

DEG = np.pi / 180.0
W = 30.0  # rad/s
GYRO = SensorBelief(numerator=(W,), denominator=(1.0, W), input_noise=4e-5, output_noise=1e-6)
RATES = {"gyro": 1000.0}


@pytest.mark.oracle
def test_rest_leaves_the_sensors_own_noise_only() -> None:
    """X' = -w x + w n with white n of density N^2 has the variance N^2 w / 2."""
    P0 = build_model({"gyro": GYRO}, RATES, order=1, q=1.0, start="rest").P0
    np.testing.assert_allclose(P0, REST_STD**2 + np.diag([0.0, 4e-5**2 * W / 2.0]), rtol=1e-12)


@pytest.mark.oracle
def test_an_unknown_start_is_a_constant_beside_a_sine() -> None:
    """The sensor follows the constant, so it is as uncertain and fully correlated; of the sine it has 1/|1 + jw/W|."""
    model = build_model({"gyro": GYRO}, RATES, order=2, q=1.0)
    dc, ac = 20.0 * DEG, 2.0 * DEG
    share = 1.0 / np.hypot(1.0, np.pi / W)
    np.testing.assert_allclose(model.P0[0, 0], dc**2 + ac**2, rtol=1e-12)
    np.testing.assert_allclose(model.P0[0, 2], dc**2, rtol=1e-12)
    np.testing.assert_allclose(model.P0[2, 2], dc**2 + (share * ac) ** 2 + 4e-5**2 * W / 2.0, rtol=1e-12)
    np.testing.assert_allclose(model.still, [1.0, 0.0, 1.0], rtol=1e-12)


@pytest.mark.oracle
def test_slow_noise_has_settled_in_the_sensor_before_the_record() -> None:
    """A turn-on bias stands in the sensor's state in full; the sum over Markov states of variance s^2 and rate r stands
    there as s^2 w / (w + r), as a one-pole filter of a Markov process does.
    """
    slow = GYRO.model_copy(update={"turn_on_bias": 1e-3, "bias_instability": 1e-4, "lowest_frequency": 1e-3})
    model = build_model({"gyro": slow}, RATES, order=1, q=1.0, coloured=True, start="rest")
    rate, variance = -np.log(np.diag(model.F)[2:]) * 1000.0, np.diag(model.P0)[2:]
    assert rate[-1] == 0.0
    assert variance[-1] == pytest.approx(1e-6, rel=1e-12)
    wanted = 4e-5**2 * W / 2.0 + np.sum(variance * W / (W + rate))
    assert model.P0[1, 1] == pytest.approx(REST_STD**2 + wanted, rel=1e-6)
    np.testing.assert_allclose(model.P0[1, 2:], variance * W / (W + rate), rtol=1e-6)


def test_a_narrow_range_narrows_the_start_and_a_blind_sensor_has_no_say() -> None:
    blind = load_belief("eq39")["mhd_ars"].model_copy(update={"range": 1.0 * DEG})
    assert not blind.sees_constant
    assert unknown_spread([blind]).constant == pytest.approx(20.0 * DEG)
    narrow = GYRO.model_copy(update={"range": 3.0 * DEG})
    assert unknown_spread([blind, narrow]).constant == pytest.approx(np.sqrt(3.0) * DEG)
    assert unknown_spread([blind, narrow]).alternating == pytest.approx(0.1 * np.sqrt(3.0) * DEG)


@pytest.mark.parametrize("name", ["eq39", "identified", "swept", "paper2"])
@pytest.mark.parametrize("start", ["unknown", "rest"])
@pytest.mark.parametrize("coloured", [True, False])
def test_every_shipped_belief_starts_from_a_covariance(name: str, start: str, coloured: bool) -> None:
    model = build_model(
        load_belief(name), {"mems_gyro": 2000.0, "mhd_ars": 20_000.0}, order=3, q=1.0, coloured=coloured, start=start
    )
    values = np.linalg.eigvalsh(model.P0)
    # eps times the largest, of the constant rate.
    assert values[0] > -1e-15 * values[-1]
