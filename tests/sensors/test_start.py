"""A simulated instrument has stood under the rate of its first sample for ever, and its noise is stationary."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.stats import chi2

from testbed.sensors import load_preset
from testbed.signals import LinearFilter, random_stream

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


@pytest.mark.oracle
def test_a_settled_filter_starts_with_the_noise_that_it_keeps() -> None:
    """The variance of the first output over many starts is that of the output after ten time constants, by sums of the
    squared pulse response, and so is the covariance with the output 1 ms later.
    """
    numerator, denominator = [40.0, 900.0], [1.0, 35.0, 900.0]
    pulse = LinearFilter(numerator, denominator, FS)
    tail = pulse.process(np.concatenate([np.zeros(2), [1.0], np.zeros(round(0.8 * FS))]))[1:]
    runs, lag = 2_000, 20
    y = np.empty((runs, lag + 1))
    for run in range(runs):
        stream = random_stream(run, "white")
        settled = LinearFilter(numerator, denominator, FS)
        settled.settle(3.0, 1.0, random_stream(run, "before"))
        y[run] = settled.process(3.0 + stream.standard_normal(lag + 1)) - 3.0
    within = chi2.ppf([5e-4, 1.0 - 5e-4], runs) / runs
    assert within[0] < np.mean(y[:, 0] ** 2) / (tail @ tail) < within[1]
    assert within[0] < np.mean(y[:, lag] ** 2) / (tail @ tail) < within[1]
    correlation = np.mean(y[:, 0] * y[:, lag]) / (tail @ tail)
    wanted = tail[lag:] @ tail[:-lag] / (tail @ tail)
    # The standard error of a correlation r over n pairs is (1 - r^2) / sqrt(n) at most 1 / sqrt(n).
    assert abs(correlation - wanted) < 3.3 / np.sqrt(runs)
