"""What there is to choose from: motions, sensors, presets, filters, beliefs, bands, drift models, papers."""

from __future__ import annotations

import importlib
import inspect
from importlib import resources
from typing import TYPE_CHECKING, Any

from testbed.compensation.model_only import METHODS
from testbed.fusion import FILTERS
from testbed.inputs.plugins import load_plugins, offered
from testbed.models.motion import Motion
from testbed.models.motions import MOTIONS
from testbed.parts import resolve
from testbed.reproduce import PAPERS
from testbed.sensors import SENSORS
from testbed.sensors.base import Sensor

if TYPE_CHECKING:
    from collections.abc import Iterable


_KINDS = {"motion": MOTIONS, "sensor": SENSORS, "filter": FILTERS}


def catalogue(plugins: Iterable[str] = ()) -> dict[str, dict[str, str]]:
    """Return every name with one line, by kind.

    Parameters
    ----------
    plugins : iterable of str, optional
        Modules whose classes are listed too; they are loaded. What installed packages offer is listed, not loaded.
    """
    loaded = load_plugins(plugins)
    table = {
        kind: {
            **{name: _first_line(resolve(kind, name, registry)) for name in registry},
            **{name: f"offered by {package}" for name, package in offered(kind).items()},
        }
        for kind, registry in _KINDS.items()
    }
    for name, part in loaded.classes():
        if kind := _kind(part):
            table[kind][name] = _first_line(part)
    table["turntable preset"] = _heads("testbed.models", "presets")
    table["sensor preset"] = _heads("testbed.sensors", "presets")
    table["belief"] = _heads("testbed.fusion", "beliefs")
    table["band set"] = _heads("testbed.fusion", "bands")
    table["drift model"] = {name: _first_line(fit).split(";")[0] for name, (_, fit, _) in METHODS.items()}
    table["paper"] = {name: _first_line(importlib.import_module(module)) for name, module in PAPERS.items()}
    return table


def _kind(part: type[Any]) -> str | None:
    """Return what a class of a plug-in is for a scenario; None if it is nothing."""
    if issubclass(part, Motion):
        return "motion"
    if issubclass(part, Sensor):
        return "sensor"
    return "filter" if hasattr(part, "process") else None


def _first_line(part: Any) -> str:
    return (inspect.getdoc(part) or "").split("\n\n")[0].replace("\n", " ")


def _heads(package: str, folder: str) -> dict[str, str]:
    """Return the first comment line of each YAML file that a package ships in a folder."""
    files = sorted((resources.files(package) / folder).iterdir(), key=lambda file: file.name)
    texts = {
        file.name.removesuffix(".yaml"): file.read_text(encoding="utf-8")
        for file in files
        if file.name.endswith(".yaml")
    }
    return {name: text.splitlines()[0].lstrip("# ") for name, text in texts.items()}
