"""What there is to choose from: motions, sensors, presets, filters, beliefs, bands, drift models, papers; and the JSON schema of a scenario."""

from __future__ import annotations

import importlib
import inspect
from importlib import resources
from typing import Any

from testbed.compensation.model_only import METHODS
from testbed.fusion import FILTERS
from testbed.models.motions import MOTIONS
from testbed.models.turntable import TurntableParameters
from testbed.parts import preset_names, resolve
from testbed.reproduce import PAPERS
from testbed.scenario import Frame
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


def schema() -> dict[str, Any]:
    """Return the JSON schema (draft 2020-12) of a scenario file, for editors."""
    definitions: dict[str, Any] = {}

    def part(model: type[Any]) -> dict[str, Any]:
        raw: dict[str, Any] = model.model_json_schema(ref_template="#/$defs/{model}")
        # A preset may supply the keys of nested parts too, such as the channel of an MHD ARS.
        definitions.update({name: _optional(nested) for name, nested in raw.pop("$defs", {}).items()})
        return raw

    frame = part(Frame)
    turntable = part(TurntableParameters)
    turntable["properties"]["preset"] = {"enum": preset_names("testbed.models")}
    properties = {
        **frame["properties"],
        "turntable": _optional(turntable),
        "motion": {
            "type": "array",
            "minItems": 1,
            "items": {"oneOf": [_one_key(name, part(resolve("motion", name, MOTIONS))) for name in MOTIONS]},
        },
        "sensors": {
            "type": "object",
            "additionalProperties": {
                "anyOf": [_sensor(name, part(resolve("sensor", name, SENSORS))) for name in SENSORS]
            },
        },
        "fusion": {
            "type": "object",
            "additionalProperties": {"type": "object"},
            "properties": {name: _filter(name, part) for name in FILTERS},
        },
        "expect": {
            "type": "object",
            "additionalProperties": {
                "type": "object",
                "additionalProperties": {"type": "string", "pattern": r"^\s*(<=|>=|<|>)\s*[-+0-9.eE]+\s*$"},
            },
        },
    }
    return {
        "$schema": "https://json-schema.org/draft/2020-12/schema",
        "title": "Scenario of the testbed",
        "type": "object",
        "additionalProperties": False,
        "required": ["name", "duration", "motion"],
        "properties": properties,
        "$defs": definitions,
    }


def _optional(model: dict[str, Any]) -> dict[str, Any]:
    """Presets may supply every key, so none is required in the file."""
    return {key: value for key, value in model.items() if key != "required"}


def _one_key(name: str, model: dict[str, Any]) -> dict[str, Any]:
    return {"type": "object", "required": [name], "additionalProperties": False, "properties": {name: model}}


def _sensor(name: str, model: dict[str, Any]) -> dict[str, Any]:
    optional = _optional(model)
    presets = {"preset": {"enum": preset_names("testbed.sensors")}, "type": {"const": name}}
    return {**optional, "properties": {**optional["properties"], **presets}}


def _filter(name: str, part: Any) -> dict[str, Any]:
    model = _optional(part(resolve("filter", name, FILTERS).Parameters))
    extra = {"type": {"type": "string"}, "belief": {"type": ["string", "object"]}}
    return {**model, "properties": {**model["properties"], **extra}}
