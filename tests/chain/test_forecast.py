"""What a run is foretold to take, without a compiled filter, and what it takes."""

from __future__ import annotations

import pytest

import testbed
from testbed.chain.forecast import forecast
from testbed.fusion.filters.kalman import Kalman
from testbed.fusion.kernels import bank, covariance
from testbed.scenario.model import Scenario
from tests.scenes import short

FOG = {
    "name": "fog",
    "duration": "1000 s",
    "turntable": {"mode": "fixed"},
    "motion": [{"static": {}}],
    "sensors": {"fog": {"preset": "fog_paper3"}},
}


@pytest.mark.parametrize("duration", ["0.5 s", "2 s", "10 s"])
def test_the_forecast_meets_the_run(tmp_path, duration):
    """Samples exactly, disk within a factor of two, whatever has most of it: page, recording or signals."""
    meets(short(tmp_path, ("duration: 0.5 s", f"duration: {duration}")), tmp_path / "run")


def test_the_forecast_meets_a_run_that_is_nearly_all_page(tmp_path):
    meets(Scenario.from_dict(FOG), tmp_path / "run")


def meets(scenario, place):
    size = forecast(scenario)
    testbed.run(scenario, out=place)
    written = sum(file.stat().st_size for file in place.iterdir())
    print(f"forecast {size.disk_bytes / 1e6:.2f} MB, written {written / 1e6:.2f} MB; {size.seconds:.1f} s")
    assert size.samples == scenario.n_time
    assert 0.5 < size.disk_bytes / written < 2.0
    assert size.seconds > 0.0
    assert size.memory_bytes > 1e8


def test_a_forecast_compiles_no_filter(tmp_path, monkeypatch):
    """Compilation takes seconds per filter, and once more for every new number of states."""

    def compiled(*_args):
        raise AssertionError

    monkeypatch.setattr(Kalman, "_advance", compiled)
    for name in ("kalman_kernel", "adaptive_kernel", "settling_kernel"):
        monkeypatch.setattr(covariance, name, lambda *_args: compiled)
    monkeypatch.setattr(bank, "bank_kernel", lambda *_args: compiled)
    size = forecast(short(tmp_path, ("arw_shakf: {}", "arw_shakf: {}\n  steady_state: {}\n  wideband: {}")))
    with pytest.raises(AssertionError):
        testbed.run(short(tmp_path))
    # The bank costs more than the others together, and both show in the forecast.
    assert size.seconds > forecast(short(tmp_path)).seconds
    assert size.disk_bytes > forecast(short(tmp_path)).disk_bytes
