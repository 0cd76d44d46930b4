"""Parts that a scenario names: closed parameter sets, their registries and their presets."""

from __future__ import annotations

import copy
import functools
import importlib
from importlib import resources
from typing import TYPE_CHECKING, Any, Self, cast

from pydantic import BaseModel, ConfigDict, ValidationError

from testbed.document import findings
from testbed.errors import Problem, ScenarioError, UnknownNameError

if TYPE_CHECKING:
    from collections.abc import Mapping

    from testbed.inputs.plugins import Plugins


class Part(BaseModel):
    """Frozen parameters of one block of the chain; SI floats from Python, strings with units from YAML."""

    model_config = ConfigDict(frozen=True, extra="forbid", arbitrary_types_allowed=True)

    @classmethod
    def known_keys(cls) -> list[str]:
        """Return every key that may stand in a file."""
        return list(cls.model_fields)

    def model_copy(self, *, update: Mapping[str, Any] | None = None, deep: bool = False) -> Self:
        """Return a copy with other values, validated as the constructor does.

        Parameters
        ----------
        update : mapping, optional
            New values by name: SI floats, or strings with units.
        deep : bool, optional
            Copy nested parts too, where there is no update.

        Raises
        ------
        ScenarioError
            If a name is unknown or a value is wrong; all at once.
        """
        if not update:
            return super().model_copy(deep=deep)
        values = {name: getattr(self, name) for name in self.model_fields_set} | dict(update)
        try:
            return type(self).model_validate(values)
        except ValidationError as error:
            problems = [
                Problem(message, ".".join(map(str, place))) for place, message in findings(error, type(self), values)
            ]
            raise ScenarioError(problems) from error


def resolve(kind: str, name: str, registry: Mapping[str, str], plugins: Plugins | None = None) -> type[Any]:
    """Import the class that `registry` (name -> ``package.module:Class``) knows as `name`.

    Parameters
    ----------
    kind : str
        What it is, for messages and entry points.
    name : str
        Name of the registry or, given `plugins`, of an installed package's entry point, or ``module:Class``.
    registry : mapping of str to str
        The shipped ones.
    plugins : Plugins, optional
        Those that may be asked; a scenario's name alone loads no code.

    Raises
    ------
    UnknownNameError
        If there is no such class.
    """
    if plugins is not None:
        part = plugins.part(kind, name, registry) if ":" in name else plugins.installed(kind, name, registry)
        if part is not None:
            return part
    if name not in registry:
        raise UnknownNameError(kind, name, registry)
    module, _, attribute = registry[name].partition(":")
    return cast("type[Any]", getattr(importlib.import_module(module), attribute))


def preset_names(package: str, folder: str = "presets") -> list[str]:
    """Return the names of the YAML files that `package` ships in a folder."""
    entries = (resources.files(package) / folder).iterdir()
    return sorted(entry.name.removesuffix(".yaml") for entry in entries if entry.name.endswith(".yaml"))


@functools.cache
def read_shipped(kind: str, package: str, folder: str, name: str) -> dict[str, Any]:
    """Return the content of a YAML file that is shipped, the same each time: it is not to be changed.

    Parameters
    ----------
    kind : str
        What it is, for the message.
    package, folder, name : str
        Where it is, and its name without ending.

    Raises
    ------
    UnknownNameError
        If there is no such file; lists the known ones.
    """
    from ruamel.yaml import YAML

    names = preset_names(package, folder)
    if name not in names:
        raise UnknownNameError(kind, name, names)
    text = (resources.files(package) / folder / f"{name}.yaml").read_text(encoding="utf-8")
    return cast("dict[str, Any]", YAML(typ="safe", pure=True).load(text))


def preset(package: str, name: str) -> dict[str, Any]:
    """Return the plain mapping (strings with units) of a shipped preset.

    Raises
    ------
    UnknownNameError
        If there is no such preset; lists the known ones.
    """
    return copy.deepcopy(read_shipped("preset", package, "presets", name))


def merge(base: Mapping[str, Any], override: Mapping[str, Any]) -> dict[str, Any]:
    """Return `base` with the keys of `override` laid over it, nested mappings merged."""
    merged = dict(base)
    for key, value in override.items():
        below = merged.get(key)
        merged[key] = merge(below, value) if isinstance(below, dict) and isinstance(value, dict) else value
    return merged


def lay_over(
    base: Mapping[str, Any], entry: Mapping[str, Any], ways: tuple[tuple[tuple[str, ...], ...], ...]
) -> dict[str, Any]:
    """Return the keys of `base` that stay when `entry` is laid over it: what it says in other words goes.

    Parameters
    ----------
    base, entry : mapping
        Of a preset, and of its user.
    ways : tuple
        For each quantity, the sets of keys that say it.
    """
    gone = {
        key
        for quantity in ways
        for said in quantity
        if any(k in entry for k in said)
        for other in quantity
        if other != said
        for key in other
    }
    return {key: value for key, value in base.items() if key not in gone}
