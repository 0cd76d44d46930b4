"""What there is to choose from: motions, sensors, presets, filters, beliefs, bands, drift models, papers."""

from __future__ import annotations

import ast
import importlib.util
import inspect
import re
from importlib import resources
from typing import TYPE_CHECKING, Any, cast

from rich.table import Table

from testbed.cli.console import terminal
from testbed.compensation import FITS, LITERATURE
from testbed.fusion import FILTERS
from testbed.inputs.plugins import Plugins, load_plugins, offered
from testbed.models.motions import MOTIONS
from testbed.reproduce import PAPERS
from testbed.sensors import SENSORS

if TYPE_CHECKING:
    from collections.abc import Iterable, Mapping
    from importlib.abc import InspectLoader


# Parts of a scenario's `pointing`.
POINTING = {
    "tracker": "testbed.pointing.parameters:Tracker",
    "mirror": "testbed.pointing.parameters:Mirror",
    "windows": "testbed.pointing.parameters:Window",
    "link": "testbed.pointing.parameters:Link",
}
_KINDS = {"motion": MOTIONS, "sensor": SENSORS, "filter": FILTERS}


def catalogue(plugins: Iterable[str] = ()) -> dict[str, dict[str, str]]:
    """Return every name with its summary, one finished sentence, by kind.

    What is shipped is read, not imported: none of the libraries that it needs is loaded.

    Parameters
    ----------
    plugins : iterable of str, optional
        Modules whose classes are listed too; they are loaded. What installed packages offer is listed, not loaded.
    """
    loaded = load_plugins(plugins)
    return {
        **{f"{kind}s": _offered(kind, registry, loaded) for kind, registry in _KINDS.items()},
        "turntable_presets": _heads("testbed.models", "presets"),
        "sensor_presets": _heads("testbed.sensors", "presets"),
        "beliefs": _heads("testbed.fusion", "beliefs"),
        "band_sets": _heads("testbed.fusion", "bands"),
        "pointing": _shipped(POINTING),
        "drift_models": _shipped(FITS),
        "drift_methods": _shipped(LITERATURE),
        "papers": _shipped(PAPERS),
    }


def print_catalogue(table: Mapping[str, Mapping[str, str]]) -> None:
    """Print what there is to choose from, the summaries wrapped beside the names."""
    console = terminal()
    width = max(len(name) for names in table.values() for name in names)
    for kind, names in table.items():
        console.print(kind.replace("_", " "), style="bold")
        grid = Table.grid(padding=(0, 2, 0, 0))
        grid.add_column(width=width + 2, no_wrap=True)
        grid.add_column()
        for name, summary in names.items():
            grid.add_row(f"  {name}", summary)
        console.print(grid)


def _offered(kind: str, registry: Mapping[str, str], loaded: Plugins) -> dict[str, str]:
    return {
        **_shipped(registry),
        **{name: f"Offered by {package}." for name, package in offered(kind).items()},
        **{name: _summary(inspect.getdoc(part)) for name, part in loaded.classes() if _kind(part) == kind},
    }


def _kind(part: type[Any]) -> str | None:
    """Return what a class of a plug-in is for a scenario; None if it is nothing."""
    from testbed.models.motion import Motion
    from testbed.sensors.base import Sensor

    if issubclass(part, Motion):
        return "motion"
    if issubclass(part, Sensor):
        return "sensor"
    return "filter" if hasattr(part, "process") else None


def _shipped(registry: Mapping[str, str]) -> dict[str, str]:
    """Return the summaries of parts that are registered as ``package.module:name``, or as modules."""
    return {name: _summary(_docstring(*place.partition(":")[::2])) for name, place in registry.items()}


def _docstring(module: str, name: str) -> str | None:
    """Return the docstring of a module, or of what it defines as `name`, out of its source."""
    spec = importlib.util.find_spec(module)
    assert spec is not None
    # Of the loader, since not every module is a file of its own: an archive of them is on the path, too.
    source = ast.parse(cast("InspectLoader", spec.loader).get_source(module) or "")
    defined = {part.name: part for part in source.body if isinstance(part, ast.ClassDef | ast.FunctionDef)}
    return ast.get_docstring(defined[name] if name else source)


def _summary(docstring: str | None) -> str:
    """Return the first paragraph of a docstring without its markup."""
    paragraph = (docstring or "").split("\n\n")[0].replace("\n", " ")
    return re.sub(r"(:\w+:)?`", "", paragraph)


def _heads(package: str, folder: str) -> dict[str, str]:
    """Return the first comment line of each YAML file that a package ships in a folder."""
    files = sorted((resources.files(package) / folder).iterdir(), key=lambda file: file.name)
    texts = {
        file.name.removesuffix(".yaml"): file.read_text(encoding="utf-8")
        for file in files
        if file.name.endswith(".yaml")
    }
    return {name: text.splitlines()[0].lstrip("# ") for name, text in texts.items()}
