"""What there is to choose from: motions, sensors, presets, filters, beliefs, bands, drift models, papers."""

from __future__ import annotations

import importlib
import inspect
from importlib import resources
from typing import Any

from testbed.compensation.model_only import METHODS
from testbed.fusion import FILTERS
from testbed.models.motions import MOTIONS
from testbed.parts import resolve
from testbed.reproduce import PAPERS
from testbed.sensors import SENSORS


def catalogue() -> dict[str, dict[str, str]]:
    """Return every name with one line, by kind."""
    table = {
        kind: {
            name: _first_line(resolve(kind, name, registry))
            for name, registry in ((name, registry) for name in registry)
        }
        for kind, registry in (("motion", MOTIONS), ("sensor", SENSORS), ("filter", FILTERS))
    }
    table["turntable preset"] = _heads("testbed.models", "presets")
    table["sensor preset"] = _heads("testbed.sensors", "presets")
    table["belief"] = _heads("testbed.fusion", "beliefs")
    table["band set"] = _heads("testbed.fusion", "bands")
    table["drift model"] = {name: _first_line(fit).split(";")[0] for name, (_, fit, _) in METHODS.items()}
    table["paper"] = {name: _first_line(importlib.import_module(module)) for name, module in PAPERS.items()}
    return table


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
