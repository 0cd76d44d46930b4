"""The JSON schema of a scenario file, for editors."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from testbed.fusion import FILTERS
from testbed.models.motions import MOTIONS
from testbed.models.turntable import TurntableParameters
from testbed.parts import preset_names, resolve
from testbed.pointing.parameters import PointingParameters
from testbed.scenario.frame import Frame
from testbed.sensors import SENSORS

if TYPE_CHECKING:
    from collections.abc import Callable

_BELIEF = (
    "What the filter believes of the sensors: the name of a shipped belief, a file of one beside the scenario, 'exact' "
    "for the simulator's own response and noise, or a mapping; by default what the data sheets of the sensors' presets "
    "support"
)

_BOUND = {"type": "string", "pattern": r"^\s*(<=|>=|<|>)\s*[-+0-9.eE]+\s*$"}


def schema() -> dict[str, Any]:
    """Return the JSON schema (draft 2020-12) of a scenario file, for editors."""
    definitions: dict[str, Any] = {}

    def part(model: type[Any]) -> dict[str, Any]:
        raw: dict[str, Any] = model.model_json_schema(ref_template="#/$defs/{model}")
        # A preset may supply the keys of nested parts too, such as the channel of an MHD ARS.
        definitions.update({name: _optional(nested) for name, nested in raw.pop("$defs", {}).items()})
        return raw

    properties = _properties(part)
    return {
        "$schema": "https://json-schema.org/draft/2020-12/schema",
        "title": "Scenario of the testbed",
        "type": "object",
        "additionalProperties": False,
        "required": ["name", "duration", "motion"],
        "properties": properties,
        "$defs": definitions,
    }


def _properties(part: Callable[[type[Any]], dict[str, Any]]) -> dict[str, Any]:
    """Return the keys of a scenario, each part by what makes its schema."""
    turntable = part(TurntableParameters)
    turntable["properties"]["preset"] = {"enum": preset_names("testbed.models")}
    return {
        **part(Frame)["properties"],
        "turntable": _optional(turntable),
        "motion": {
            "type": "array",
            "minItems": 1,
            "items": {"oneOf": [_motion(name, part) for name in MOTIONS]},
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
        "pointing": part(PointingParameters),
        "expect": {
            "type": "object",
            "additionalProperties": {
                "type": "object",
                "additionalProperties": {"anyOf": [_BOUND, {"type": "object", "additionalProperties": _BOUND}]},
            },
        },
    }


def _optional(model: dict[str, Any]) -> dict[str, Any]:
    """Presets may supply every key, so none is required in the file."""
    return {key: value for key, value in model.items() if key != "required"}


def _motion(name: str, part: Any) -> dict[str, Any]:
    kind = resolve("motion", name, MOTIONS)
    model = {**part(kind), "examples": [kind.example]}
    return {"type": "object", "required": [name], "additionalProperties": False, "properties": {name: model}}


def _sensor(name: str, model: dict[str, Any]) -> dict[str, Any]:
    optional = _optional(model)
    presets = {"preset": {"enum": preset_names("testbed.sensors")}, "type": {"const": name}}
    return {**optional, "properties": {**optional["properties"], **presets}}


def _filter(name: str, part: Any) -> dict[str, Any]:
    model = _optional(part(resolve("filter", name, FILTERS).Parameters))
    extra = {"type": {"type": "string"}, "belief": {"type": ["string", "object"], "description": _BELIEF}}
    return {**model, "properties": {**model["properties"], **extra}}
