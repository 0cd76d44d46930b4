"""The example's two loggers differ by 200 ppm; gain, clock and dead time come back."""

from __future__ import annotations

import pytest

import testbed
from tests.examples.test_examples import load


@pytest.mark.slow
def test_the_record_of_the_example_tells_clock_and_dead_time(tmp_path):
    program = load("identify_from_log")
    found = testbed.identify_sensors(testbed.read_log(program.write(tmp_path)), "encoder", "mhd_ars")[0]
    assert found.measured.response.clock.error == pytest.approx(program.CLOCK, rel=0.0, abs=1e-6)
    assert found.model.delay == pytest.approx(program.DELAY_S, rel=0.0, abs=10e-6)
