"""The face of the package: its public names, its glossary, and the examples in its docstrings."""

from __future__ import annotations

import ast
import doctest
import importlib
import inspect
import pkgutil
import re
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

import testbed
from testbed.fusion import FILTERS
from testbed.models.motions import MOTIONS
from testbed.sensors import SENSORS
from tests.scenes import short_file

# Where public names stand: each module's examples are run.
EXAMPLES = [
    "testbed",
    "testbed.allan.curve",
    "testbed.allan.fit",
    "testbed.allan.octaves",
    "testbed.campaigns.evaluate",
    "testbed.campaigns.sweep",
    "testbed.chain.runner",
    "testbed.chain.sight",
    "testbed.errors",
    "testbed.fusion",
    "testbed.fusion.analysis.verdict",
    "testbed.fusion.belief",
    "testbed.identification.session",
    "testbed.logs.reader",
    "testbed.models.mhd_channel.channel",
    "testbed.models.motions",
    "testbed.models.turntable.turntable",
    "testbed.notebook.run",
    "testbed.playback.export",
    "testbed.playback.replay",
    "testbed.runs.attributes",
    "testbed.runs.metrics",
    "testbed.runs.signals",
    "testbed.scenario.beliefs",
    "testbed.scenario.edits",
    "testbed.scenario.loader",
    "testbed.scenario.model",
    "testbed.sensors",
    "testbed.sensors.noise",
    "testbed.units",
]
FUNCTIONS = sorted(name for name in testbed.__all__ if inspect.isfunction(getattr(testbed, name)))


@pytest.fixture(scope="module")
def everything():
    """Import every package, as a long session does: none may hide a name of the face."""
    for info in pkgutil.walk_packages(testbed.__path__, "testbed."):
        if info.ispkg:
            importlib.import_module(info.name)


def test_dir_shows_the_public_names():
    assert dir(testbed) == sorted(testbed.__all__)
    code = "import testbed; print(*dir(testbed))"
    fresh = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True).stdout.split()
    assert {"run", "estimate", "load_preset", "belief_of", "Scenario", "list_filters"} <= set(fresh)


def test_no_public_name_is_that_of_a_package():
    rooms = {path.name.removesuffix(".py") for path in Path(testbed.__file__).parent.iterdir()}
    assert not rooms & set(testbed.__all__)


def test_an_unknown_name_is_an_attribute_error():
    with pytest.raises(AttributeError, match="has no attribute 'rnu'"):
        _ = testbed.rnu


@pytest.mark.usefixtures("everything")
def test_every_public_function_can_be_called_with_every_package_imported(tmp_path):
    path = short_file(tmp_path, ("duration: 0.5 s", "duration: 0.3 s"))
    run = testbed.run(path, out=tmp_path / "run")
    log = tmp_path / "log.csv"
    log.write_text("t [ms],gyro [deg/s]\n" + "".join(f"{k},{k % 2}\n" for k in range(100)))
    rates = {name: signals.sample_rate_hz for name, signals in run.sensors.items()}
    readings = {name: signals.rate for name, signals in run.sensors.items()}
    called = {
        "run": run,
        "open_run": testbed.open_run(tmp_path / "run"),
        "load_scenario": testbed.load_scenario(path),
        "estimate": testbed.estimate("kalman", readings, sample_rate_hz=rates, belief="eq39"),
        "evaluate": testbed.evaluate(path, [1]),
        "load_preset": testbed.load_preset("sx300"),
        "belief_of": testbed.belief_of("sx300"),
        "list_filters": testbed.list_filters(),
        "list_motions": testbed.list_motions(),
        "list_presets": testbed.list_presets(),
        "list_sensors": testbed.list_sensors(),
        "read_log": testbed.read_log(log),
    }
    t = np.arange(2000) / 500.0
    rate = sum(np.sin(2.0 * np.pi * freq * t) for freq in (3.0, 7.0, 19.0))
    table = np.column_stack([t, rate, 0.9 * rate + 1e-3 * np.random.default_rng(1).standard_normal(t.size)])
    np.savetxt(tmp_path / "bench.csv", table, header="t [s],laser [deg/s],gyro [deg/s]", comments="", delimiter=",")
    called["identify_sensors"] = testbed.identify_sensors(testbed.read_log(tmp_path / "bench.csv"), "laser", "gyro")
    called["export"] = testbed.export(tmp_path / "run", "csv", tmp_path / "exported")
    called["replay"] = testbed.replay(called["export"] / "log.yaml", "kalman", out=tmp_path / "replayed")
    called["line_of_sight"] = testbed.line_of_sight(tmp_path / "run", {"tracker": {"bandwidth": "10 Hz"}})
    (tmp_path / "study.yaml").write_text(f"name: study\nbase: {path.name}\n")
    called["sweep"] = testbed.sweep(tmp_path / "study.yaml", out=tmp_path / "sweep")
    called["open_sweep"] = testbed.open_sweep(called["sweep"])
    assert sorted(called) == FUNCTIONS
    assert isinstance(called["open_run"], testbed.Run)
    assert isinstance(called["load_scenario"], testbed.Scenario)
    assert called["estimate"].rate.shape == run.fusion["kalman"].rate.shape


def test_lists_are_the_names_that_the_other_functions_take():
    assert testbed.list_filters() == sorted(FILTERS)
    assert testbed.list_motions() == sorted(MOTIONS)
    assert testbed.list_sensors() == sorted(SENSORS)
    for name in testbed.list_presets():
        assert testbed.load_preset(name).response(np.array([10.0])).shape == (1,)


@pytest.mark.parametrize("name", EXAMPLES)
def test_examples_in_docstrings_give_what_they_show(name, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    module = importlib.import_module(name)
    result = doctest.testmod(module, optionflags=doctest.ELLIPSIS)
    assert result.attempted > 0
    assert result.failed == 0


def test_every_public_function_has_an_example():
    assert [name for name in FUNCTIONS if ">>>" not in (inspect.getdoc(getattr(testbed, name)) or "")] == []


def test_every_module_with_examples_is_run():
    root = Path(testbed.__file__).parent
    having = {
        ".".join(("testbed", *path.relative_to(root).with_suffix("").parts)).removesuffix(".__init__")
        for path in root.rglob("*.py")
        if any(
            ">>>" in (ast.get_docstring(node) or "")
            for node in ast.walk(ast.parse(path.read_text()))
            if isinstance(node, ast.Module | ast.ClassDef | ast.FunctionDef)
        )
    }
    assert having == set(EXAMPLES)


@pytest.mark.parametrize(
    "term",
    [
        "stage",
        "part",
        "belief",
        "base clock",
        "due",
        "missing",
        "settle",
        "floor",
        "optimum",
        "form",
        "line",
        "block",
        "std",
    ],
)
def test_the_glossary_defines(term):
    assert re.search(rf"^(?:[\w ]+, )*{term}(?:, [\w ]+)*\n    \S", testbed.__doc__, re.MULTILINE)
