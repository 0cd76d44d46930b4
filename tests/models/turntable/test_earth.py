"""The Earth's rotation in the truth, against the projection of its vector."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import pytest

from testbed.models.motion import MotionProfile
from testbed.models.turntable.earth import SPEED, EarthRate
from testbed.models.turntable.parameters import Mounting, TurntableParameters
from testbed.models.turntable.turntable import Turntable

if TYPE_CHECKING:
    from testbed.models.turntable.truth import TruthBlock

FS = 20000.0
LATITUDE, AZIMUTH = np.deg2rad(48.0), np.deg2rad(30.0)
SITE = EarthRate(latitude=LATITUDE, azimuth=AZIMUTH)
# Axes of the three: up, the table's +x, the table's +y.
SENSORS = {
    "up": Mounting(),
    "along_x": Mounting(misalignment=(0.0, np.pi / 2)),
    "along_y": Mounting(misalignment=(-np.pi / 2, 0.0)),
    "tilted": Mounting(misalignment=(0.3, -0.2)),
}


def turning(mode: str, site: EarthRate | None, rate: float = 8.0, n_time: int = 8000) -> TruthBlock:
    """Return the truth of a table that turns by 3.2 rad."""
    parameters = TurntableParameters(mode=mode, cogging=(), earth_rate=site)
    block = MotionProfile([lambda t: np.full_like(t, rate)], 0.0, FS).process(n_time)
    return Turntable(parameters, SENSORS).process(block)


@pytest.mark.oracle
@pytest.mark.parametrize(
    ("latitude", "azimuth", "expected"),
    [
        (90.0, 17.0, (0.0, 0.0, 1.0)),
        (-90.0, 0.0, (0.0, 0.0, -1.0)),
        (0.0, 0.0, (1.0, 0.0, 0.0)),  # x to the north, along the axis
        (0.0, 90.0, (0.0, 1.0, 0.0)),  # x to the east, so y to the north
        (30.0, 180.0, (-np.sqrt(0.75), 0.0, 0.5)),
    ],
)
def test_vector_at_places_known_by_heart(latitude: float, azimuth: float, expected: tuple[float, ...]) -> None:
    vector = EarthRate(latitude=np.deg2rad(latitude), azimuth=np.deg2rad(azimuth)).vector
    np.testing.assert_allclose(vector, SPEED * np.array(expected), rtol=0.0, atol=1e-15 * SPEED)
    assert np.rad2deg(SPEED) * 3600 == pytest.approx(15.041, abs=5e-4)  # deg/h: a turn in a sidereal day


@pytest.mark.oracle
@pytest.mark.parametrize("mode", ["servo", "digital", "ideal", "fixed"])
def test_every_mode_adds_the_projection_on_the_turning_axis(mode: str) -> None:
    off, on = turning(mode, None), turning(mode, SITE)
    level, up = SPEED * np.cos(LATITUDE), SPEED * np.sin(LATITUDE)
    # The table's x points to the bearing AZIMUTH - angle: it turns towards the west.
    bearing = AZIMUTH - on.angle
    expected = {
        "up": np.full_like(bearing, up),
        "along_x": level * np.cos(bearing),
        "along_y": level * np.cos(bearing - np.pi / 2),
    }
    expected["tilted"] = (
        np.sin(-0.2) * expected["along_x"]
        - np.sin(0.3) * np.cos(-0.2) * expected["along_y"]
        + np.cos(0.3) * np.cos(-0.2) * up
    )
    # The table is level to 1e-6 rad; two rates of 8 rad/s are subtracted.
    for name, value in expected.items():
        added = on.sensor_rate[name] - off.sensor_rate[name]
        np.testing.assert_allclose(added, value, rtol=0.0, atol=1e-6 * SPEED + 1e-14)
    np.testing.assert_allclose(on.rate - off.rate, up, rtol=0.0, atol=1e-6 * SPEED + 1e-14)
    for name in ("encoder_rate", "angle", "torque"):
        np.testing.assert_array_equal(getattr(on, name), getattr(off, name))


def test_it_is_off_unless_asked_for() -> None:
    assert TurntableParameters().earth_rate is None
    truth = turning("fixed", None, rate=0.0, n_time=100)
    assert not any(rate.any() for rate in truth.sensor_rate.values())


@pytest.mark.parametrize("mode", ["servo", "fixed"])
def test_blocks_of_any_length_give_the_same_bits(mode: str) -> None:
    parameters = TurntableParameters(mode=mode, earth_rate=SITE)
    whole = Turntable(parameters, SENSORS).process(profile().process(2000))
    table, motion = Turntable(parameters, SENSORS), profile()
    parts = [table.process(motion.process(n)) for n in (1, 7, 992, 1000)]
    for name in SENSORS:
        joined = np.concatenate([part.sensor_rate[name] for part in parts])
        np.testing.assert_array_equal(joined, whole.sensor_rate[name])


def profile() -> MotionProfile:
    return MotionProfile([lambda t: np.sin(2 * np.pi * 5.0 * t)], 0.05, FS)
