"""A scenario and its parts as mappings with SI units, which load to the same again."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from pydantic import BaseModel

from testbed.fusion.belief import declared

if TYPE_CHECKING:
    from collections.abc import Iterable, Mapping
    from pathlib import Path

    from testbed.scenario.model import Bound, FilterSpec


def dump(part: BaseModel, folder: Path | None = None) -> dict[str, Any]:
    """Return a part as a mapping with SI units that validates to the same part; what is unset by default and unset here
    is left out.

    Parameters
    ----------
    part : BaseModel
        The part.
    folder : Path, optional
        Paths into it are relative.
    """
    written = part.model_dump(mode="json", context={"border": True, "folder": folder})
    fields = type(part).model_fields
    return {key: value for key, value in written.items() if value is not None or fields[key].default is not None}


def resolved_fusion(specs: Mapping[str, FilterSpec]) -> dict[str, Any]:
    """Return the part `fusion` of a scenario or a replay as a mapping with SI units, which loads to the same again.

    Parameters
    ----------
    specs : mapping of str to FilterSpec
        The filters.
    """
    return {name: {"type": spec.type, "belief": _belief(spec), **_parameters(spec)} for name, spec in specs.items()}


def _belief(spec: FilterSpec) -> dict[str, Any] | str:
    """Return what a filter believes; the exact belief as the word, since the sensors stand beside it."""
    word = declared(spec.belief)
    return word if word == "exact" else {name: dump(one) for name, one in spec.belief.items()}


def _parameters(spec: FilterSpec) -> dict[str, Any]:
    return dump(spec.parameters) if isinstance(spec.parameters, BaseModel) else dict(spec.parameters)


def resolved_expectations(bounds: Iterable[Bound]) -> dict[str, dict[str, str]]:
    """Return the part `expect` of a scenario, which loads to the same bounds again.

    Parameters
    ----------
    bounds : iterable of Bound
        The expectations.
    """
    table: dict[str, dict[str, str]] = {}
    for bound in bounds:
        table.setdefault(bound.subject, {})[bound.metric] = f"{bound.relation} {bound.limit!r}"
    return table
