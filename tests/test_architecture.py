"""The house: imports point one way, registries are complete, docstrings say what an engineer needs."""

from __future__ import annotations

import ast
import functools
import graphlib
import importlib
import inspect
import pkgutil
import re
import statistics
from pathlib import Path

import pytest

import testbed
from testbed.parts import Part

ROOT = Path(testbed.__file__).parent
# Files, and one folder.
FOUNDATION = {"errors", "parts", "units", "signals", "document", "inputs", "_version"}
# Each room and what it may import of the house, besides the foundation and itself: the data flow, from the ground floor
# up.
ROOMS = {
    "pages": set(),
    "metrics": set(),
    "allan": set(),
    "compensation": set(),
    "logs": set(),
    "models": {"logs"},
    "fusion": set(),
    "sensors": {"models", "allan"},
    "pointing": {"metrics", "fusion"},
    "runs": {"models", "fusion", "pointing"},
    "scenario": {"models", "sensors", "fusion", "pointing"},
    "report": {"pages", "metrics", "allan", "runs"},
    "recording": {"pages", "metrics", "runs"},
    "identification": {"fusion", "logs", "metrics", "pages"},
    "notebook": {"pages", "runs", "report"},
    "judging": {"logs", "metrics", "allan", "pages", "runs", "scenario", "sensors", "models", "fusion", "pointing"},
    "chain": {
        *("scenario", "models", "sensors", "fusion", "pointing", "runs"),
        *("judging", "report", "recording", "notebook"),
    },
    "playback": {
        *("logs", "metrics", "fusion", "runs", "scenario"),
        *("report", "recording", "notebook", "chain"),
    },
    "campaigns": {"chain", "judging", "scenario", "models", "sensors", "fusion", "metrics", "runs", "pages"},
    "design": {"campaigns", "scenario", "sensors", "fusion", "models", "pointing", "pages", "runs"},
    "drift": {"compensation", "logs", "allan", "judging", "pages", "runs", "models"},
}
# These join everything: the papers know all but the chain and the command line, nobody knows the command line.
TOP = {"reproduce": {"chain", "cli"}, "cli": set()}
# Files directly in the package: the foundation, the faces of package and command.
LOOSE = FOUNDATION | {"__init__", "__main__"}
MODULES = sorted(path for path in ROOT.rglob("*.py"))


@functools.cache
def tree_of(path):
    return ast.parse(path.read_text())


def imports_of(path):
    """Yield the names below `testbed` that a module imports, at any depth of its code."""
    for node in ast.walk(tree_of(path)):
        if isinstance(node, ast.ImportFrom) and node.module and node.module.split(".")[0] == "testbed":
            parts = node.module.split(".")
            yield from [parts[1]] if len(parts) > 1 else [alias.name for alias in node.names]
        elif isinstance(node, ast.Import):
            yield from [alias.name.split(".")[1] for alias in node.names if alias.name.startswith("testbed.")]


def modules_of(path):
    """Yield the dotted modules of the package that a module imports when it is loaded (not those for types, nor inside
    functions).
    """
    waiting, known = list(tree_of(path).body), known_modules()
    while waiting:
        node = waiting.pop()
        if isinstance(node, ast.If) and "TYPE_CHECKING" in ast.unparse(node.test):
            continue
        if isinstance(node, ast.ImportFrom) and (node.module or "").split(".")[0] == "testbed":
            names = [f"{node.module}.{alias.name}" for alias in node.names]
            yield from [name if name in known else node.module for name in names]
        elif isinstance(node, ast.Import):
            yield from [alias.name for alias in node.names if alias.name.split(".")[0] == "testbed"]
        elif not isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef):
            waiting.extend(ast.iter_child_nodes(node))


@functools.cache
def known_modules():
    return {dotted(path) for path in MODULES}


def dotted(path):
    return ".".join(("testbed", *path.relative_to(ROOT).with_suffix("").parts)).removesuffix(".__init__")


def room_of(path):
    return path.relative_to(ROOT).parts[0].removesuffix(".py")


# One test over all of something rather than a test of each: two thousand of them took more time than what they look at.
def offenders(of, look):
    """Return what `look` finds of each thing, by the thing's name, where it finds anything."""
    found = {str(one.relative_to(ROOT) if isinstance(one, Path) else one): look(one) for one in of}
    return {name: fault for name, fault in found.items() if fault}


@pytest.mark.contract
def test_rooms_import_one_way():
    """Signals <- models <- sensors; fusion and compensation know neither, so the truth cannot leak into them."""

    def beyond(path):
        room = room_of(path)
        return set(imports_of(path)) - FOUNDATION - ROOMS[room] - {room}

    assert offenders([path for path in MODULES if room_of(path) in ROOMS], beyond) == {}


@pytest.mark.contract
def test_the_top_rooms_do_not_know_what_is_above_them():
    tops = [path for path in MODULES if room_of(path) in TOP]
    assert offenders(tops, lambda path: set(imports_of(path)) & TOP[room_of(path)]) == {}


@pytest.mark.contract
def test_every_module_has_a_room_and_every_room_a_rule():
    folders = {path.name for path in ROOT.iterdir() if path.is_dir() and any(path.glob("*.py"))}
    assert folders - FOUNDATION == set(ROOMS) | set(TOP)
    assert {path.stem for path in ROOT.glob("*.py")} == LOOSE - folders
    assert len(LOOSE - folders) <= 8


@pytest.mark.contract
def test_modules_are_small():
    """About 150 lines, and three times that at the most; a long one becomes a room, or gives a part away."""
    lines = {str(path.relative_to(ROOT)): len(path.read_text().splitlines()) for path in MODULES}
    assert statistics.median(lines.values()) <= 160
    # The cache of compiled kernels watches only the file of each kernel: what they call stands beside them.
    assert {name for name, count in lines.items() if count > 450} == {
        "fusion/kernels/bank.py",
        "fusion/kernels/covariance.py",
    }


@pytest.mark.contract
def test_rooms_form_no_circle():
    """The table of rules itself has an order, and no module needs, when it is loaded, one that needs it."""
    assert list(graphlib.TopologicalSorter(ROOMS).static_order())
    graph = {dotted(path): set(modules_of(path)) - {dotted(path)} for path in MODULES}
    # A face hands on what its package holds, so a package that is imported for a part of it is no circle.
    inner = {name: {other for other in found if not name.startswith(f"{other}.")} for name, found in graph.items()}
    assert list(graphlib.TopologicalSorter(inner).static_order())


@pytest.mark.contract
def test_the_foundation_knows_no_room():
    foundation = [path for path in MODULES if room_of(path) in FOUNDATION]
    assert offenders(foundation, lambda path: set(imports_of(path)) - FOUNDATION) == {}


# Every paper's module has a `report`. The functions of the command line are named as its commands.
SHARED_NAMES = {"report"}


@pytest.mark.contract
def test_a_public_name_has_one_meaning():
    """A class or function of a module is called as no other one, so that a name leads to its place."""
    places = {}
    for path in MODULES:
        if path.parent.name == "commands":
            continue
        for node in tree_of(path).body:
            if isinstance(node, ast.ClassDef | ast.FunctionDef) and not node.name.startswith("_"):
                places.setdefault(node.name, []).append(dotted(path))
    # The overloads of a function are one name in one place.
    twice = {name: set(found) for name, found in places.items() if len(set(found)) > 1}
    assert {name: found for name, found in twice.items() if name not in SHARED_NAMES} == {}


PUBLIC = {
    "testbed": "run load_scenario open_run Scenario Run Problem ScenarioError RunError UnknownNameError read_log "
    "replay export",
    "testbed.cli": "main",
    "testbed.models.mhd_channel": "MhdChannel Fluid one_mode_response",
    "testbed.models.turntable": "Turntable TurntableParameters Mounting",
    "testbed.sensors": "load_preset",
    "testbed.sensors.noise": "GyroNoise",
    "testbed.sensors.allan": "allan_deviation fit_allan",
    "testbed.fusion": "estimate FILTERS EstimateBlock",
    "testbed.fusion.belief": "load_belief",
    "testbed.scenario": "Scenario",
}


@pytest.mark.contract
@pytest.mark.parametrize("module", PUBLIC)
def test_public_paths_stay(module):
    """What users and checks import; everything else is no promise."""
    assert [name for name in PUBLIC[module].split() if not hasattr(importlib.import_module(module), name)] == []


def test_the_import_check_sees_a_planted_leak(tmp_path):
    leak = tmp_path / "leak.py"
    leak.write_text(
        "def process():\n    from testbed.models.turntable.turntable import Turntable\n    import "
        "testbed.chain.pipeline\n"
    )
    assert set(imports_of(leak)) == {"models", "chain"}


def public_callables():
    """Yield every public function and class of the package with its module, methods included."""
    for info in pkgutil.walk_packages(testbed.__path__, "testbed."):
        if info.name.endswith("__main__"):
            continue
        module = importlib.import_module(info.name)
        for name, item in vars(module).items():
            if name.startswith("_") or getattr(item, "__module__", None) != info.name or info.name == "testbed.cli.app":
                continue
            if inspect.isclass(item) or inspect.isfunction(item):
                yield f"{info.name}.{name}", item


CALLABLES = dict(public_callables())


def documented(doc, argument):
    """Return whether a numpydoc section has an entry for `argument`, alone or in a list of names."""
    return re.search(rf"^\s*(?:[\w*]+, )*\*{{0,2}}{re.escape(argument)}(?:, [\w*]+)* : ", doc, re.MULTILINE) is not None


def undocumented(name):
    """Return the arguments that a docstring with a Parameters section does not name."""
    item = CALLABLES[name]
    doc = inspect.getdoc(item) or ""
    function = item.__init__ if inspect.isclass(item) else item
    if "Parameters\n---" not in doc or not inspect.isfunction(inspect.unwrap(function)):
        return [] if doc else ["no docstring"]
    arguments = [
        p
        for p in inspect.signature(function).parameters
        if p not in {"self", "data", "args", "kwargs"} and not p.startswith("_")
    ]
    return [argument for argument in arguments if not documented(doc, argument)]


def unexplained(name):
    """Return the fields of a parameter set that neither it nor what it inherits from explains."""
    item = CALLABLES[name]
    doc = "\n".join(inspect.getdoc(base) or "" for base in item.__mro__ if hasattr(base, "model_fields"))
    return [field for field in item.model_fields if not documented(doc, field)]


def shapeless(name):
    """Return the lines of a docstring that have an array without its shape."""
    lines = (inspect.getdoc(CALLABLES[name]) or "").splitlines()
    return [line for line in lines if re.search(r"\bndarray\b", line) and " : " in line and "shape" not in line]


@pytest.mark.contract
def test_docstring_names_every_argument():
    """A docstring with a Parameters section must name all arguments; every public thing has a docstring."""
    assert len(CALLABLES) > 500
    assert offenders(CALLABLES, undocumented) == {}


@pytest.mark.contract
def test_docstring_of_a_parameter_set_names_every_field():
    """What `testbed list` and the schema offer is explained where it is defined; inherited fields where they are
    inherited from.
    """
    sets = [name for name, item in CALLABLES.items() if inspect.isclass(item) and issubclass(item, Part)]
    assert len(sets) > 50
    assert offenders(sets, unexplained) == {}


@pytest.mark.contract
def test_docstring_of_an_array_has_its_shape():
    assert offenders(CALLABLES, shapeless) == {}
