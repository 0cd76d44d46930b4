"""Plug-ins: nothing loads unless the user said so; whatever a plug-in does is named with it."""

from __future__ import annotations

import hashlib
import subprocess
import sys
from importlib import metadata

import numpy as np
import pytest

import testbed
from testbed.errors import RunError, ScenarioError, UnknownNameError
from testbed.fusion import FILTERS, estimate
from testbed.inputs import plugins
from testbed.inputs.plugins import load_plugins
from testbed.parts import resolve

SOURCE = """
import numpy as np
from testbed.fusion import EstimateBlock

class Passes:
    "Passes the gyro on."

    def __init__(self, belief, sample_rate_hz, parameters):
        self.gain = parameters.get("gain", 1.0)

    def process(self, readings):
        rate = self.gain * np.asarray(readings["gyro"])
        return EstimateBlock(rate, np.ones(rate.size), {})
"""
BELIEF = {"gyro": {"numerator": [1.0], "denominator": [0.01, 1.0], "output_noise": 1e-4}}
READINGS = {"gyro": np.linspace(0.0, 1.0, 10)}


@pytest.fixture
def module(tmp_path, request):
    """Return the path of a plug-in whose module has a name of its own."""
    path = tmp_path / f"plugin_{hashlib.sha256(request.node.nodeid.encode()).hexdigest()[:12]}.py"
    path.write_text(SOURCE)
    return path


def test_a_plugin_by_path_resolves_and_its_digest_is_that_of_the_file(module):
    loaded = load_plugins([str(module)])
    assert resolve("filter", f"{module.stem}:Passes", FILTERS, loaded).__name__ == "Passes"
    assert loaded.used == (plugins.Plugin(module.stem, None, hashlib.sha256(module.read_bytes()).hexdigest()),)


def test_a_plugin_by_dotted_name_resolves(module, monkeypatch):
    monkeypatch.syspath_prepend(module.parent)
    loaded = load_plugins([module.stem])
    assert resolve("filter", f"{module.stem}:Passes", FILTERS, loaded).__name__ == "Passes"
    assert loaded.used[0].sha256 == hashlib.sha256(module.read_bytes()).hexdigest()


def test_the_environment_names_plugins_too(module, monkeypatch):
    monkeypatch.setenv("TESTBED_PLUGINS", f" {module} ,")
    block = estimate(f"{module.stem}:Passes", READINGS, sample_rate_hz={"gyro": 100.0}, belief=BELIEF)
    assert np.array_equal(block.rate, READINGS["gyro"])


@pytest.mark.parametrize("name", ["os:system", "plugin_never:Mine", "json:JSONDecoder", ":", "a:", ":b", "os:path:x"])
@pytest.mark.parametrize("loaded", [None, load_plugins([])], ids=["nobody asked", "none named"])
def test_a_name_alone_loads_nothing(tmp_path, monkeypatch, name, loaded):
    (tmp_path / "plugin_never.py").write_text("raise SystemExit('was imported')")
    monkeypatch.syspath_prepend(tmp_path)
    with pytest.raises(UnknownNameError):
        resolve("filter", name, FILTERS, loaded)
    assert "plugin_never" not in sys.modules


def test_only_exactly_the_module_that_was_named_resolves(module):
    """A plug-in that imports others does not vouch for them."""
    loaded = load_plugins([str(module)])
    with pytest.raises(UnknownNameError, match=r"name it by --plugin, TESTBED_PLUGINS or plugins="):
        resolve("filter", "numpy:ndarray", FILTERS, loaded)
    for wrong in ("Nothing", "np", "__name__", ""):
        with pytest.raises(UnknownNameError, match="has no class"):
            resolve("filter", f"{module.stem}:{wrong}", FILTERS, loaded)


@pytest.mark.parametrize(
    "body",
    [
        "raise SystemExit",
        "raise SystemExit(0)",
        "1 / 0",
        "import nothing_of_this_name",
        "def f(:",
        "raise BaseException('x' * 9999)",
        "class E(Exception):\n    def __str__(self):\n        1 / 0\nraise E",
        "exit()",
        "\0",
    ],
    ids=["exit", "exit 0", "zero", "import", "syntax", "base", "mute", "quit", "null"],
)
def test_whatever_a_plugin_raises_is_named_with_it(module, body):
    module.write_text(body)
    with pytest.raises(ScenarioError, match=module.stem) as caught:
        load_plugins([str(module)])
    assert len(str(caught.value)) < 500
    assert module.stem not in sys.modules


@pytest.mark.parametrize(
    "name", ["numpy.py", "json.py", "a b.py", "1.py", "../x", "a..b", "nowhere_at_all", "/dev/zero.py"]
)
def test_a_name_that_is_taken_or_none_is_refused(tmp_path, name):
    (tmp_path / "json.py").write_text("")
    (tmp_path / "numpy.py").write_text("")
    with pytest.raises(ScenarioError):
        load_plugins([str(tmp_path / name) if name.endswith(".py") else name])


def test_a_file_that_changed_since_it_was_loaded_is_refused(module):
    load_plugins([str(module)])
    module.write_text(SOURCE + "\n")
    with pytest.raises(ScenarioError, match="start Python again"):
        load_plugins([str(module)])


def test_an_interrupt_stays_one(module):
    module.write_text("raise KeyboardInterrupt")
    with pytest.raises(KeyboardInterrupt):
        load_plugins([str(module)])


def test_the_command_line_ends_with_2_for_a_plugin_that_exits(module, tmp_path):
    """`check` of a scenario whose plug-in raises SystemExit once ended with status 0."""
    module.write_text("raise SystemExit(0)")
    command = [sys.executable, "-m", "testbed", "list", "--plugin", str(module)]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    assert done.returncode == 2
    assert f"{module.stem}" in done.stderr
    assert "Traceback" not in done.stderr


class Installed:
    """Stands for an installed package that offers parts."""

    def __init__(self, monkeypatch, *points):
        self.points = points
        plugins._offers.cache_clear()
        monkeypatch.setattr(metadata, "entry_points", lambda group: [p for p in points if p.group == group])


@pytest.fixture
def installed(monkeypatch):
    yield lambda *points: Installed(monkeypatch, *points)
    plugins._offers.cache_clear()


def point(name, value, group="testbed.filters"):
    return metadata.EntryPoint(name, value, group)


def test_an_installed_package_offers_a_filter_by_its_name(module, monkeypatch, installed):
    monkeypatch.syspath_prepend(module.parent)
    installed(point("passes", f"{module.stem}:Passes"))
    loaded = load_plugins()
    assert plugins.offered("filter") == {"passes": module.stem}
    assert module.stem not in sys.modules
    assert resolve("filter", "passes", FILTERS, loaded).__name__ == "Passes"
    assert [plugin.name for plugin in loaded.used] == [module.stem]
    block = estimate("passes", READINGS, sample_rate_hz={"gyro": 100.0}, belief=BELIEF, gain=2.0)
    assert np.array_equal(block.rate, 2.0 * READINGS["gyro"])


def test_a_name_that_is_shipped_or_offered_twice_is_an_error(installed):
    installed(point("kalman", "a:B"), point("mine", "a:B"), point("mine", "c:D"))
    for name, why in (("kalman", "it is shipped"), ("mine", "a and c")):
        with pytest.raises(UnknownNameError, match=f"taken twice.*{why}"):
            resolve("filter", name, FILTERS, load_plugins())


def test_an_installed_package_that_fails_is_named(module, monkeypatch, installed):
    module.write_text("raise SystemExit(0)")
    monkeypatch.syspath_prepend(module.parent)
    installed(point("passes", f"{module.stem}:Passes"), point("gone", "no_such_module:X"))
    for name in ("passes", "gone"):
        with pytest.raises(UnknownNameError, match="plug-in"):
            resolve("filter", name, FILTERS, load_plugins())


def test_estimate_takes_a_class_with_or_without_parameters():
    class Bare:
        def __init__(self, belief, sample_rate_hz, parameters):
            self.given = parameters

        def process(self, readings):
            rate = np.asarray(readings["gyro"]) * self.given["gain"]
            return testbed.fusion.EstimateBlock(rate, np.ones(rate.size), {})

    block = estimate(Bare, READINGS, sample_rate_hz={"gyro": 100.0}, belief=BELIEF, gain=3.0)
    assert np.array_equal(block.rate, 3.0 * READINGS["gyro"])
    kalman = resolve("filter", "kalman", FILTERS)
    arguments = {"sample_rate_hz": {"gyro": 100.0}, "belief": BELIEF}
    assert np.array_equal(estimate(kalman, READINGS, **arguments).rate, estimate("kalman", READINGS, **arguments).rate)


def test_estimate_gives_a_filter_readings_that_it_cannot_change():
    class Writes:
        def __init__(self, belief, sample_rate_hz, parameters):
            pass

        def process(self, readings):
            readings["gyro"][:] = 0.0

    mine = READINGS["gyro"].copy()
    with pytest.raises(RunError, match=r"filter .*Writes, block 1 .*raised: ValueError: .*read-only"):
        estimate(Writes, {"gyro": mine}, sample_rate_hz={"gyro": 100.0}, belief=BELIEF)
    assert np.array_equal(mine, READINGS["gyro"])
