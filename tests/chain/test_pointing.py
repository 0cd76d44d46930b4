"""The line of sight of a whole run: against the transfer functions, in any blocks, in run.nc, with expectations."""

from __future__ import annotations

import math

import numpy as np
import pytest
from numpy.testing import assert_allclose

import testbed
from testbed.pointing.blend import butterworth_gains
from testbed.pointing.parameters import PointingParameters

BASE = {
    "name": "aim",
    "seed": 4,
    "duration": "2 s",
    "settle": "1 s",
    "ramp_in": "0.1 s",
    "turntable": {"mode": "ideal"},
    "motion": [{"sine": {"frequency": "20 Hz", "angle": "100 urad"}}],
    "sensors": {
        "mhd_ars": {"preset": "sx300"},
        "mems_gyro": {"preset": "adis16505_filtered"},
    },
    "fusion": {"kalman": {"belief": "exact"}},
    "pointing": {"tracker": {"bandwidth": "5 Hz"}, "mirror": {"bandwidth": "1 kHz", "latency": "500 us"}},
}


def aimed(**changes):
    return testbed.Scenario.from_dict(BASE).with_(**changes)


def silent(**changes):
    """Without noise the filter knows the truth but for its lag."""
    return aimed(**{"sensors.mhd_ars.noise": False, "sensors.mems_gyro.noise": False, **changes})


@pytest.fixture(scope="module")
def noisy():
    return testbed.run(aimed())


@pytest.mark.oracle
@pytest.mark.parametrize(("lead", "latency"), [(False, 500e-6), (True, 500e-6), (False, 120e-6)])
def test_the_residual_of_a_sine_is_that_of_the_transfer_functions(lead, latency):
    r"""|S (1 - M e^{-s tau} (1 + lead s))| of the amplitude of the true angle, the filter's own error known apart."""
    changes = {"pointing.mirror.lead": lead, "pointing.mirror.latency": f"{latency!r} s"}
    run = testbed.run(silent(**changes))
    sight, f = run.pointing["kalman"], np.array([20.0])
    mirror = PointingParameters().mirror.dynamics
    s = 2j * math.pi * f
    lead_time = mirror.group_delay + latency if lead else 0.0
    passed = mirror.response(f) * np.exp(-s * latency) * (1.0 + lead_time * s)
    S = butterworth_gains(5.0).sensitivity(f)
    t = run.truth.time
    basis = np.exp(-2j * np.pi * 20.0 * t)[20_000:]

    def line(x):
        return 2.0 * np.mean(x[20_000:] * basis)

    theta = line(run.truth.rate) / s
    estimate = line(run.fusion["kalman"].rate) / s
    expected = S * (theta - passed * estimate)
    # Of (2 pi f / fs)^2: trapezoid and straight lines between samples 1/12 each, a part of a sample late 1/8.
    close = (2.0 * math.pi * 20.0 / 20_000.0) ** 2 * (2.0 / 12.0 + 1.0 / 8.0) * abs(theta[0])
    assert_allclose(line(sight.residual), expected, atol=close)
    assert_allclose(line(sight.tracker_only), S * theta, atol=close)
    assert_allclose(line(sight.knowledge), S * (theta - estimate), atol=close)


@pytest.mark.property
def test_any_blocks_give_the_same(noisy):
    other = testbed.run(aimed(), block=0.0337)
    for name in ("residual", "knowledge", "mirror"):
        assert_allclose(other.pointing["kalman"][name], noisy.pointing["kalman"][name], atol=1e-17)
    ours, theirs = (run.metrics.pointing["kalman"] for run in (noisy, other))
    assert_allclose(theirs.residual_rms_urad, ours.residual_rms_urad, rtol=1e-9)
    assert_allclose(list(theirs.budget.shares.values()), list(ours.budget.shares.values()), atol=1e-9)


def test_metrics_are_those_of_the_signals(noisy):
    sight, found = noisy.pointing["kalman"], noisy.metrics.pointing["kalman"]
    for name in ("residual", "knowledge", "tracker_only"):
        rms = 1e6 * np.sqrt(np.mean(sight[name][20_000:] ** 2))
        assert_allclose(found[f"{name}_rms_urad"], rms, rtol=1e-9)
    assert_allclose(sum(found.budget.shares.values()), 1.0, rtol=1e-12)
    assert_allclose(sum(band["residual_urad"] ** 2 for band in found.bands), found.residual_rms_urad**2, rtol=1e-9)
    assert sight.units["residual"] == "rad"


def test_noise_moves_the_knowledge_only(noisy):
    """Mirror and latency act on the truth: they are the same with and without noise."""
    quiet = testbed.run(silent()).metrics.pointing["kalman"]
    loud = noisy.metrics.pointing["kalman"]
    for part in ("mirror", "latency"):
        assert_allclose(loud.budget.rms_urad[part], quiet.budget.rms_urad[part], rtol=1e-6)
    assert loud.knowledge_rms_urad > quiet.knowledge_rms_urad
    inside = loud.budget.knowledge
    assert set(inside) == {"mhd_ars", "mems_gyro", "belief_error", "lag"}
    assert set(inside["mems_gyro"]) >= {"angle_random_walk", "rounding"}
    # What the noise leaves, taken from the run without it, and what the budget says that it leaves.
    longer = {"duration": "7 s"}
    drawn, still = (testbed.run(make(**longer)) for make in (aimed, silent))
    whole = drawn.pointing["kalman"].knowledge - still.pointing["kalman"].knowledge
    loud = drawn.metrics.pointing["kalman"]
    noise = math.hypot(*(loud.budget.knowledge_rms_urad[name] for name in ("mhd_ars", "mems_gyro")))
    assert_allclose(noise, 1e6 * np.std(whole[20_000:]), rtol=0.15)


@pytest.mark.parametrize("offset", [100e-6, -100e-6])
def test_a_latency_that_the_lead_does_not_know_is_found(offset):
    """100 us planted are found within 20 us of a filter that is not late itself (the motion: 20 Hz)."""
    lead = {"fusion": {"wideband": {"belief": "exact"}}, "pointing.mirror.lead": True}
    changes = lead | {"pointing.mirror.assumed_latency": f"{500e-6 - offset!r} s"}
    assert_allclose(testbed.run(aimed(**changes)).metrics.pointing["wideband"].delay_us, 1e6 * offset, atol=20.0)


def test_a_saturated_mirror_is_reported_and_its_share_counted():
    found = testbed.run(aimed(**{"pointing.mirror.stroke": "50 urad"})).metrics.pointing["kalman"]
    # |sin| of 100 urad is beyond 50 urad for two thirds of the time.
    assert_allclose(found.saturated["stroke"], 2.0 / 3.0, atol=0.02)
    assert found.saturated["rate"] == 0.0
    assert found.budget.dominant == "saturation"
    assert_allclose(sum(found.budget.shares.values()), 1.0, rtol=1e-9)
    free = testbed.run(aimed(**{"pointing.mirror.stroke": "1 mrad"})).metrics.pointing["kalman"]
    assert free.saturated == {"stroke": 0.0, "rate": 0.0}
    assert free.budget.shares["saturation"] == pytest.approx(0.0, abs=1e-9)


def test_through_a_fade_the_gyro_holds_the_line_of_sight():
    """While the tracker has no light it would leave the motion as it is; the rate keeps it small."""
    changes = {"pointing.tracker.fades": [{"at": "1.2 s", "length": "0.3 s"}]}
    run = testbed.run(aimed(**changes))
    inside = slice(24_100, 30_000)
    sight = run.pointing["kalman"]
    assert np.std(sight.tracker_only[inside]) > 50e-6
    assert np.std(sight.residual[inside]) < 12e-6


def test_tracker_noise_makes_the_best_blend_and_is_in_the_budget():
    changes = {"pointing.tracker.noise": "1 urad/sqrt(Hz)"}
    found = testbed.run(aimed(**changes)).metrics.pointing["kalman"]
    fixed = butterworth_gains(5.0)
    assert found.gains["rate_per_s2"] < fixed.rate
    assert found.budget.rms_urad["tracker_noise"] > 0.0
    assert found.knowledge_rms_urad < 1e6 * 1e-6 * math.sqrt(fixed.noise_bandwidth_hz)


def test_a_slower_filter_is_held_on_the_base_clock():
    """A gyro alone at 2 kHz: half a millisecond from reading to reading, the angle goes on in between."""
    changes = {"sensors": {"mems_gyro": {"preset": "adis16505_filtered"}}}
    run = testbed.run(aimed(**changes))
    assert run.pointing["kalman"].residual.size == run.truth.rate.size
    assert run.metrics.pointing["kalman"].residual_rms_urad > 0.0


def test_expectations_and_folder_have_the_pointing(tmp_path):
    expect = {"kalman": {"residual_rms_urad": "< 100", "rpe_urad": {"10 ms": "< 1e-3"}}}
    changes = {"pointing.windows": ["10 ms"], "pointing.link": {"divergence": "20 urad"}, "expect": expect}
    scenario = aimed(duration="1 s", settle="0.5 s", **changes)
    run = testbed.run(scenario, out=tmp_path / "out")
    rows = {row.metric: row.met for row in run.metrics.expectations}
    assert rows == {"residual_rms_urad": True, "rpe_urad.0.01": False}
    stored = testbed.open_run(tmp_path / "out")
    assert stored.metrics.to_dict()["pointing"] == run.metrics.to_dict()["pointing"]
    assert_allclose(stored.pointing["kalman"].residual, testbed.run(scenario).pointing["kalman"].residual, atol=1e-18)
    assert stored.metrics.pointing["kalman"].link["mean_loss_db"] > 0.0


def test_without_pointing_nothing_is_added():
    run = testbed.run(aimed(pointing=None, duration="0.2 s", settle="0.1 s"))
    assert "pointing" not in run.metrics
    assert run.pointing == {}
