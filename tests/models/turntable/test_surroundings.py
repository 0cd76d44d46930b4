"""What an exposed sensor feels besides the rate about its axis, against rigid-body kinematics."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
import pytest

from testbed.models.motion import MotionProfile
from testbed.models.motions.sine import Sine
from testbed.models.turntable.earth import EarthRate
from testbed.models.turntable.parameters import Mounting, TurntableParameters
from testbed.models.turntable.turntable import Turntable
from testbed.signals import random_stream

if TYPE_CHECKING:
    from testbed.models.turntable.truth import TruthBlock

FS = 20_000.0
FREQ, AMPLITUDE = 5.0, 2.0
MOUNTING = Mounting(position=(0.05, -0.03, 0.06), misalignment=(0.02, -0.05))


def truth(mode: str, *, exposed: tuple[str, ...] = ("gyro",), n_time: int = 20_000) -> TruthBlock:
    sine = Sine(frequency=FREQ, rate=AMPLITUDE).start(10.0, random_stream(0, "motion"))
    command = MotionProfile([sine], 0.2, FS).process(n_time)
    parameters = TurntableParameters(mode=mode)  # type: ignore[arg-type]
    return Turntable(parameters, {"gyro": MOUNTING}, FS, exposed=exposed).process(command)


def to_housing(vector: Any) -> Any:
    """Turn (x, y, z) rows of the table into the housing's axes: transpose of Rx(a) Ry(b)."""
    a, b = MOUNTING.misalignment
    Rx = np.array([[1, 0, 0], [0, np.cos(a), -np.sin(a)], [0, np.sin(a), np.cos(a)]])
    Ry = np.array([[np.cos(b), 0, np.sin(b)], [0, 1, 0], [-np.sin(b), 0, np.cos(b)]])
    return vector @ (Rx @ Ry)


@pytest.mark.oracle
@pytest.mark.parametrize("mode", ["fixed", "ideal"])
def test_a_turning_table_gives_centripetal_tangential_and_gravity(mode: str) -> None:
    got = truth(mode)
    late = slice(10_000, 19_990)
    rate, acceleration = got.rate, np.gradient(got.rate, 1.0 / FS)
    x, y, _ = MOUNTING.position
    zero = np.zeros_like(rate)
    rates = to_housing(np.stack([zero, zero, rate], axis=1))
    force = to_housing(
        np.stack([-acceleration * y - rate**2 * x, acceleration * x - rate**2 * y, zero + 9.80665], axis=1)
    )
    # The quaternion and the matrix of a tilt agree to a few eps.
    np.testing.assert_allclose(got.cross_rate["gyro"][late], rates[late, :2], rtol=0, atol=1e-13)
    np.testing.assert_allclose(got.sensor_rate["gyro"][late], rates[late, 2], rtol=0, atol=1e-13)
    # The acceleration belongs to the step after the sample: half a step of its slope, A (2 pi f)^2 / (2 fs) = 0.049
    # rad/s^2, times a lever of 58 mm; the peaks are 3.7 m/s^2 tangential and 0.23 m/s^2 centripetal.
    half_step = AMPLITUDE * (2 * np.pi * FREQ) ** 2 / (2 * FS) * 0.0584
    np.testing.assert_allclose(got.specific_force["gyro"][late], force[late], rtol=0, atol=1.05 * half_step)


@pytest.mark.oracle
def test_the_whole_plant_holds_a_still_sensor_against_gravity() -> None:
    got = truth("servo")
    mean = got.specific_force["gyro"].mean(axis=0)
    x, y, _ = MOUNTING.position
    # Over whole periods the tangential part is nothing; the centripetal mean is A^2 / 2 times the lever (less the ramp
    # of 0.2 s: up to a fifth) and the platform rocks by a few urad.
    lever = to_housing(np.array([-x, -y, 0.0]) * AMPLITUDE**2 / 2 * 0.9 + np.array([0, 0, 9.80665]))
    np.testing.assert_allclose(mean, lever, rtol=0, atol=0.1 * AMPLITUDE**2 / 2 * 0.06 + 0.02)
    # What its axis feels is the third component of what its housing feels.
    rates = np.column_stack([got.cross_rate["gyro"], got.sensor_rate["gyro"]])
    np.testing.assert_allclose(np.linalg.norm(rates, axis=1), np.abs(got.rate), rtol=0, atol=1e-2 * AMPLITUDE)


def test_asking_changes_no_bit_of_the_truth() -> None:
    asked, plain = truth("servo", n_time=2000), truth("servo", exposed=(), n_time=2000)
    for name in ("rate", "angle", "encoder_rate", "torque"):
        assert np.array_equal(getattr(asked, name), getattr(plain, name))
    assert np.array_equal(asked.sensor_rate["gyro"], plain.sensor_rate["gyro"])
    assert plain.cross_rate == plain.specific_force == {}


@pytest.mark.parametrize("mode", ["servo", "ideal", "fixed"])
def test_cross_rates_include_the_earth(mode):
    """A level table at rest at angle 0: x and y of the site see the horizontal part of the Earth's rate, z the vertical
    one.
    """
    earth = EarthRate(latitude=np.deg2rad(48.0))
    parameters = TurntableParameters(mode=mode, earth_rate=earth, cogging=())
    table = Turntable(parameters, {"gyro": Mounting()}, exposed=["gyro"])
    truth = table.process(MotionProfile([np.zeros_like], 0.0, 20_000.0).process(50))
    felt = np.column_stack([truth.cross_rate["gyro"], truth.sensor_rate["gyro"]])
    # The plant in equilibrium is level to the accuracy of its Newton iteration.
    assert np.allclose(felt, earth.vector, rtol=0.0, atol=1e-9 * 7.3e-5)
