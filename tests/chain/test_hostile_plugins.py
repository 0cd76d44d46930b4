"""What a plug-in can do wrong in a run or before it: found, named, and nobody else sees it."""

from __future__ import annotations

import hashlib
import subprocess
import sys

import numpy as np
import pytest

import testbed
from testbed.errors import RunError, ScenarioError
from testbed.fusion import estimate
from testbed.judging.allan_records import read_run
from testbed.report import write_report

HEAD = """\
import numpy as np
from testbed.fusion import EstimateBlock
from testbed.models.motion import Motion
from testbed.sensors.base import Sensor

class Filter:
    def __init__(self, belief, rates, parameters):
        self.block = 0
        {init}

    def process(self, readings):
        self.block += 1
        n = readings["mhd_ars"].size
        rate, std, diagnostics = np.zeros(n), np.ones(n), {{"gain": np.ones(n)}}
        {process}
        return EstimateBlock(rate, std, diagnostics)

class Shake(Motion):
    def start(self, duration, rng):
        {start}
        def rate(t):
            {rate}
            return 0.01 * np.sin(t)
        return rate

    def top_frequency(self):
        {top}
        return 1.0

class Gyro(Sensor):
    def response(self, freq_hz):
        {response}
        return np.ones(np.shape(freq_hz))
    def full_scale(self):
        {scale}
        return 10.0
    def input_noise_psd(self, freq_hz):
        {psd}
        return np.full(np.shape(freq_hz), 1e-9)
    def start(self, input_rate_hz, seed, name):
        {begin}
        return Stage(round(input_rate_hz / self.sample_rate))

class Stage:
    def __init__(self, ratio):
        self.ratio, self.done, self.block = ratio, 0, 0

    def process(self, rate):
        self.block += 1
        first, self.done = -self.done % self.ratio, self.done + rate.size
        readings = rate[first::self.ratio].copy()
        {sense}
        return readings
"""
HOLES = ("init", "process", "start", "rate", "top", "response", "scale", "psd", "begin", "sense")
SCENARIO = """\
name: hostile
duration: 0.3 s
turntable: {mode: ideal}
motion:
  - MODULE:Shake: {}
sensors:
  mhd_ars: {preset: sx300}
  own: {type: "MODULE:Gyro", sample_rate: 1 kHz}
fusion:
  mine: {type: "MODULE:Filter", belief: BELIEF}
  complementary: {belief: BELIEF}
"""
BELIEF = (
    "{mhd_ars: {numerator: [1, 0], denominator: [1, 10], output_noise: 100 nrad/s/sqrt(Hz)}, "
    "own: {numerator: [1], denominator: [0.001, 1], output_noise: 100 urad/s/sqrt(Hz)}}"
)


@pytest.fixture
def scene(tmp_path, request):
    """Return a function that writes a plug-in with some of its holes filled, and loads the scenario that uses it."""
    name = f"hostile_{hashlib.sha256(request.node.nodeid.encode()).hexdigest()[:12]}"

    def load(**filled):
        source = HEAD.format(**{hole: filled.get(hole, "pass") for hole in HOLES})
        (tmp_path / f"{name}.py").write_text(source)
        path = tmp_path / "scenario.yaml"
        path.write_text(SCENARIO.replace("MODULE", name).replace("BELIEF", BELIEF))
        return testbed.load_scenario(path, plugins=[str(tmp_path / f"{name}.py")])

    return load


def test_a_good_plugin_runs_and_stands_in_the_run(scene, tmp_path):
    scenario = scene()
    run = testbed.run(scenario, out=tmp_path / "run")
    assert np.array_equal(run.fusion["mine"].rate, np.zeros(6000))
    assert run.sensors["own"].rate.size == 300
    (plugin,) = run.metrics["plugins"]
    assert plugin["sha256"] == scenario.plugins[0].sha256


RAISES = ("1 / 0", "raise SystemExit(0)", "raise BaseException", "[][0]", "raise ValueError('x' * 9999)")


@pytest.mark.parametrize("fault", RAISES)
@pytest.mark.parametrize("hole", ["init", "start", "rate", "top", "response", "scale", "psd", "begin", "sense"])
def test_what_a_plugin_raises_before_the_run_is_a_finding(scene, hole, fault):
    with pytest.raises(ScenarioError) as caught:
        scene(**{hole: fault})
    assert len(str(caught.value)) < 1000
    assert "x" * 81 not in str(caught.value)


@pytest.mark.parametrize("fault", RAISES)
def test_what_a_filter_raises_when_estimate_builds_it_is_named(fault):
    """SystemExit too, which once ended the program that asked for the estimate."""
    namespace = {}
    exec(f"class Mine:\n    def __init__(self, belief, rates, parameters):\n        {fault}\n", namespace)  # noqa: S102 - the plug-in
    with pytest.raises(ValueError, match=r"^filter Mine: \w+: ") as caught:
        estimate(namespace["Mine"], {"mhd_ars": np.zeros(20)}, sample_rate_hz={"mhd_ars": 2000.0}, verdict=False)
    assert len(str(caught.value)) < 200


GIVES = {
    "none": "return None",
    "tuple": "return rate, std, diagnostics",
    "short rate": "rate = rate[:-1]",
    "long std": "std = np.ones(n + 1)",
    "flat": "rate = rate[:, None]",
    "scalar": "rate = 0.0",
    "whole numbers": "rate = rate.astype(int)",
    "objects": "rate = rate.astype(object)",
    "complex": "rate = rate + 0j",
    "text": "diagnostics['gain'] = np.array(['x'] * n)",
    "nan": "rate[n // 2] = np.nan",
    "infinite": "rate[-1] = np.inf",
    "zero std": "std[0] = 0.0",
    "negative std": "std[-1] = -1.0",
    "nan std": "std[1] = np.nan",
    "infinite std": "std[1] = np.inf",
    "no diagnostics": "diagnostics = None",
    "list": "diagnostics = [1]",
    "bad name": "diagnostics['../x'] = np.ones(n)",
    "taken name": "diagnostics['rate'] = np.ones(n)",
    "number as name": "diagnostics[3] = np.ones(n)",
    "long name": "diagnostics['x' * 1000] = np.ones(n)",
    "left out": "diagnostics = {} if self.block == 2 else diagnostics",
    "added": "diagnostics = {**diagnostics, 'more': rate} if self.block == 2 else diagnostics",
    "writes": "readings['mhd_ars'][0] = 1.0",
    "writes another": "readings['own'] *= 2.0",
    **{fault: fault for fault in RAISES},
}


@pytest.mark.parametrize("fault", GIVES.values(), ids=GIVES)
def test_what_a_filter_does_wrong_in_a_run_is_named_with_filter_and_block(scene, fault):
    with pytest.raises(RunError, match=r"^filter mine, block [12] \(from t = 0(\.1)? s\): ") as caught:
        testbed.run(scene(process=fault), block=0.1)
    assert len(str(caught.value)) < 400


@pytest.mark.parametrize(
    "fault", ["readings = readings[1:]", "return None", "readings = readings.astype(int)", "rate[0] = 1.0", "1 / 0"]
)
def test_what_a_sensor_does_wrong_in_a_run_is_named_with_sensor_and_block(scene, fault):
    with pytest.raises(RunError, match=r"^sensor own, block 2 "):
        testbed.run(scene(sense=f"if rate.size > 100 and self.block == 2: {fault}"), block=0.1)


@pytest.mark.parametrize(
    "fault", ["return t[1:]", "return None", "return t * np.nan", "1 / 0", "t[:] = 0; return t > 1"]
)
def test_what_a_motion_does_wrong_is_found_by_the_check(scene, fault):
    with pytest.raises(ScenarioError, match="motion"):
        scene(rate=fault)


def test_a_plugin_that_keeps_and_changes_its_arrays_changes_nothing(scene):
    clean = testbed.run(scene())
    late = "self.old = getattr(self, 'old', []); [a.fill(9.0) for a in self.old]; self.old = [rate, std]"
    sly = late + "\n        readings = {k: v.copy() for k, v in readings.items()}; readings['own'].fill(9.0)"
    scenario = clean_of(scene, sly)
    run = testbed.run(scenario, block=0.1)
    assert np.array_equal(run.fusion["mine"].rate, clean.fusion["mine"].rate)
    assert np.array_equal(run.fusion["complementary"].rate, clean.fusion["complementary"].rate)


def clean_of(scene, body):
    # The module of the first scene is loaded: the second needs a process of its own, or to be forgotten.
    from testbed.inputs import plugins

    for name in [name for name in plugins._LOADED if name.startswith("hostile_")]:
        del plugins._LOADED[name], sys.modules[name]
    return scene(process=body)


def test_a_finished_run_is_read_without_its_plugins(scene, tmp_path):
    """Allan, report and reading in a process that would notice an import of the plug-in."""
    scenario = scene()
    out = tmp_path / "run"
    testbed.run(scenario, out=out)
    (plugin,) = scenario.plugins
    code = f"""
import sys
from pathlib import Path
sys.path.insert(0, {str(tmp_path)!r})
import testbed
from testbed.judging.allan_records import read_run
from testbed.report import write_report
out = Path({str(out)!r})
testbed.open_run(out).fusion["mine"].rate
assert [record.rate.size for record in read_run(out)] == [6000]
write_report(out)
assert {plugin.name!r} not in sys.modules
"""
    subprocess.run([sys.executable, "-c", code], check=True)
    assert [record.name for record in read_run(out)] == ["hostile_mhd_ars"]
    with pytest.raises(ScenarioError, match="of a plug-in's type"):
        read_run(out, "own")
    assert write_report(out).is_file()
