"""The keys of `pointing:` as a scenario reads them: words, units, findings at their place, and back again."""

from __future__ import annotations

import math

import numpy as np
import pytest
from numpy.testing import assert_allclose

import testbed
from testbed.pointing.actuator import butterworth_mirror
from testbed.pointing.parameters import Link, Mirror, PointingParameters, Window, window_key
from testbed.scenario.resolved import dump

FULL = {
    "tracker": {"bandwidth": "10 Hz", "noise": "5 nrad/sqrt(Hz)", "fades": [{"at": "0.2 s", "length": "0.1 s"}]},
    "mirror": {"bandwidth": "1 kHz", "latency": "500 us", "lead": "on", "stroke": "1 mrad"},
    "windows": ["1 ms", {"length": "10 ms", "separation": "100 ms"}],
    "link": {"divergence": "20 urad", "outage_below": "-3 dB"},
}


def scenario(pointing, **more):
    return testbed.Scenario.from_dict(
        {
            "name": "aim",
            "duration": "1 s",
            "settle": "0.5 s",
            "turntable": {"mode": "ideal"},
            "motion": [{"sine": {"frequency": "10 Hz", "rate": "1 deg/s"}}],
            "sensors": {"mems_gyro": {"preset": "adis16505_filtered"}},
            "fusion": {"kalman": {}},
            "pointing": pointing,
            **more,
        }
    )


def findings(pointing, **more):
    with pytest.raises(testbed.ScenarioError) as caught:
        scenario(pointing, **more)
    return {problem.key: problem.message for problem in caught.value.problems}


def test_words_and_units_become_si():
    read = scenario(FULL).pointing
    assert read.tracker.noise == 5e-9
    assert read.mirror.lead is True
    assert_allclose(read.mirror.lead_times, (math.sqrt(2.0) / (2000.0 * math.pi), 500e-6))
    assert [window.key for window in read.windows] == ["0.001", "0.01"]
    assert_allclose(read.link.outage_below, 10.0**-0.3)


def test_what_is_resolved_reads_as_the_same():
    read = scenario(FULL, expect={"kalman": {"rpe_urad": {"1 ms": "< 9"}, "residual_rms_urad": "< 9"}})
    again = testbed.Scenario.from_dict(read.resolved())
    assert again.pointing == read.pointing
    assert [bound.metric for bound in again.expect] == ["rpe_urad.0.001", "residual_rms_urad"]


def test_with_replaces_a_key_and_none_removes_the_part():
    changed = scenario(FULL).with_(**{"pointing.mirror.latency": "100 us"})
    assert_allclose(changed.pointing.mirror.latency, 100e-6, rtol=1e-12)
    assert scenario(FULL).with_(pointing=None).pointing is None


@pytest.mark.parametrize(
    ("pointing", "key", "words"),
    [
        ({"mirorr": {}}, "pointing.mirorr", "did you mean 'mirror'"),
        ({"tracker": {"bandwidth": "10 rad/s"}}, "pointing.tracker.bandwidth", "wrong dimension"),
        ({"tracker": {"noise": "5 nrad"}}, "pointing.tracker.noise", "wrong dimension"),
        ({"windows": ["1 m"]}, "pointing.windows.0", "wrong dimension"),
        ({"windows": ["1 ms", "1 ms"]}, "pointing.windows.1", "another window of 0.001 s"),
        ({"windows": ["2 s"]}, "pointing.windows.0", "within the 0.5 s after settle"),
        ({"windows": [{"length": "10 ms", "separation": "1 ms"}]}, "pointing.windows.0", "at least the length"),
        ({"link": {"divergence": "20 urad", "outage_below": "3 dB"}}, "pointing.link.outage_below", "less than 1"),
        ({"feed_forward": ["kalmann"]}, "pointing.feed_forward.0", "no filter of this scenario"),
        ({"mirror": {"rate": "3 kHz"}}, "pointing.mirror.rate", "divided by a whole number"),
        ({"mirror": {"assumed_latency": "1 ms"}}, "pointing.mirror", "only lead takes it"),
        ({"mirror": {"numerator": [1]}}, "pointing.mirror", "numerator and denominator"),
        ({"mirror": {"numerator": [1], "denominator": [1, -1]}}, "pointing.mirror", "unstable mirror"),
        ({"mirror": {"response": "no.csv", "bandwidth": "1 kHz"}}, "pointing.mirror", "expected one of response"),
        ({"tracker": {"fades": [{"at": "1 s", "length": "1 s"}]}}, "pointing.tracker.fades.0", "within the run"),
        ({"mirror": {"latency": "20 ms"}}, "pointing.tracker", "unstable"),
    ],
)
def test_what_is_wrong_is_found_at_its_place(pointing, key, words):
    found = findings(pointing)
    assert words in found[key]


def test_an_unstable_loop_is_refused_with_its_margins():
    message = findings({"mirror": {"latency": "20 ms"}})["pointing.tracker"]
    assert "gain margin -" in message
    assert "phase margin -" in message
    assert "lower its bandwidth" in message


def test_bounds_of_pointing_are_known_where_it_is():
    known = findings(FULL, expect={"kalman": {"rpe_urad": {"2 ms": "< 1"}}})["expect.kalman.rpe_urad.0.002"]
    assert "rpe_urad.0.01" in known
    assert "is no metric" in findings(FULL, expect={"mems_gyro": {"ape_urad": "< 1"}})["expect.mems_gyro.ape_urad"]
    assert "is no metric" in findings(None, expect={"kalman": {"ape_urad": "< 1"}})["expect.kalman.ape_urad"]


def test_without_a_filter_there_is_nothing_to_feed_forward():
    assert "name a filter" in findings(FULL, fusion=None)["pointing"]


def test_a_measured_mirror_is_kept_by_its_coefficients(tmp_path):
    """The resolved scenario needs no file."""
    freq = np.geomspace(1.0, 5e3, 40)
    H = butterworth_mirror(800.0).response(freq)
    rows = [f"{f},{abs(h)},{np.rad2deg(np.angle(h))}" for f, h in zip(freq, H, strict=True)]
    (tmp_path / "fsm.csv").write_text("\n".join(rows))
    mirror = Mirror.model_validate({"response": "fsm.csv"}, context={"border": True, "folder": tmp_path})
    assert_allclose(mirror.dynamics.response(freq), H, rtol=1e-6)
    written = dump(mirror)
    assert "response" not in written
    assert Mirror.model_validate(written, context={"border": True, "folder": tmp_path / "other"}) == mirror


@pytest.mark.parametrize(
    ("length", "key"), [(1e-3, "0.001"), (0.1, "0.1"), (1.0, "1"), (30.0, "30"), (2.5e-4, "0.00025")]
)
def test_windows_are_named_by_their_shortest_decimal(length, key):
    assert window_key(length) == key
    assert Window(length=length).key == key


def test_python_takes_si():
    made = PointingParameters(windows=(Window(length=0.1),), link=Link(divergence=2e-5))
    assert made.link.outage_below == 10.0**-0.3
    assert PointingParameters(windows=(0.1,)).windows == made.windows
