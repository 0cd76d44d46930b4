"""A simulated instrument has stood under the rate of its first sample for ever."""

from __future__ import annotations

import numpy as np
import pytest

from testbed.sensors import load_preset

FS = 20_000.0
EARTH = 7.292115e-5  # rad/s


@pytest.mark.parametrize("name", ["sx300", "mhd03", "adis16505_filtered", "adis16505", "crs03", "fog_paper3"])
def test_a_constant_rate_is_no_step(name: str) -> None:
    """Without noise the reading stays where the response at 0 Hz puts it, from the first sample on."""
    sensor = load_preset(name).model_copy(update={"noise": False})
    readings = sensor.sample(np.full(4_000, EARTH), FS)
    wanted = (sensor.response(np.array([1e-9]))[0] * EARTH).real
    np.testing.assert_allclose(readings, wanted, atol=1e-9 * EARTH)


@pytest.mark.parametrize("blocks", [[4_000], [1, 9, 3_990]])
def test_a_decimation_filter_and_an_old_clock_start_at_the_first_sample(blocks: list[int]) -> None:
    gyro = load_preset("adis16505_filtered").model_copy(update={"noise": False, "fir": "average", "jitter": 2e-5})
    stage = gyro.start(FS, 1, "gyro")
    readings = np.concatenate([stage.process(np.full(n, EARTH)) for n in blocks])
    np.testing.assert_allclose(readings, (gyro.response(np.array([1e-9]))[0] * EARTH).real, rtol=1e-9)
