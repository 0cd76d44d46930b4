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
    """Return every name with its summary, one finished sentence, by kind."""
    return {
        "motions": {name: _summary(resolve("motion", name, MOTIONS)) for name in MOTIONS},
        "sensors": {name: _summary(resolve("sensor", name, SENSORS)) for name in SENSORS},
        "filters": {name: _summary(resolve("filter", name, FILTERS)) for name in FILTERS},
        "turntable_presets": _heads("testbed.models", "presets"),
        "sensor_presets": _heads("testbed.sensors", "presets"),
        "beliefs": _heads("testbed.fusion", "beliefs"),
        "band_sets": _heads("testbed.fusion", "bands"),
        "drift_models": {name: _summary(fit) for name, (_, fit, _) in METHODS.items()},
        "papers": {name: _summary(importlib.import_module(module)) for name, module in PAPERS.items()},
    }


def _summary(part: Any) -> str:
    """Return the first paragraph of a docstring without its markup."""
    return (inspect.getdoc(part) or "").split("\n\n")[0].replace("\n", " ").replace("`", "")


def _heads(package: str, folder: str) -> dict[str, str]:
    """Return the first comment line of each YAML file that a package ships in a folder."""
    files = sorted((resources.files(package) / folder).iterdir(), key=lambda file: file.name)
    texts = {
        file.name.removesuffix(".yaml"): file.read_text(encoding="utf-8")
        for file in files
        if file.name.endswith(".yaml")
    }
    return {name: text.splitlines()[0].lstrip("# ") for name, text in texts.items()}
