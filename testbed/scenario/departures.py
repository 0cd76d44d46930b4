"""What a scenario takes from presets, and where it departs from them."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from testbed.errors import UnknownNameError
from testbed.parts import preset

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping

    from testbed.scenario.model import Scenario

# Keys of a part's entry that are no parameters.
_NAMES = {"preset", "type"}


def departures(scenario: Scenario) -> list[dict[str, Any]]:
    """Return of each part its preset, and what is written beside it that says something else.

    Parameters
    ----------
    scenario : Scenario
        Of which the mapping as written is known.

    Returns
    -------
    list of dict
        `part` (``turntable``, ``sensors.mhd_ars``, ``fusion.kalman``), `preset` (None without one) and `differs`: rows
        of `key`, `here` and `preset` (None where the preset, or the default, says nothing), as written.
    """
    written = scenario.source
    parts = [_part("turntable", written.get("turntable") or {}, "testbed.models", "air_bearing")]
    for name, entry in (written.get("sensors") or {}).items():
        parts.append(_part(f"sensors.{name}", entry or {}, "testbed.sensors", None))
    for name, entry in (written.get("fusion") or {}).items():
        parts.append({"part": f"fusion.{name}", "preset": None, "differs": _differences(entry or {}, {})})
    return parts


def _part(part: str, entry: Mapping[str, Any], package: str, default: str | None) -> dict[str, Any]:
    name = entry.get("preset", default)
    try:
        base = {} if name is None else preset(package, str(name))
    except UnknownNameError:  # checked where the scenario is read
        base = {}
    return {"part": part, "preset": name, "differs": _differences(entry, base)}


def _differences(entry: Mapping[str, Any], base: Mapping[str, Any]) -> list[dict[str, Any]]:
    before = dict(_leaves(base))
    rows = [{"key": key, "here": _text(value), "preset": _text(before.get(key))} for key, value in _leaves(entry)]
    return [row for row in rows if row["key"] not in _NAMES and row["here"] != row["preset"]]


def _leaves(node: Mapping[str, Any], prefix: str = "") -> Iterator[tuple[str, Any]]:
    for key, value in node.items():
        name = f"{prefix}.{key}" if prefix else str(key)
        if isinstance(value, dict) and value:
            yield from _leaves(value, name)
        else:
            yield name, value


def _text(value: Any) -> str | None:
    if value is None:
        return None
    if isinstance(value, bool):
        return "on" if value else "off"
    return _listed(value) if isinstance(value, list) else str(value)


def _listed(entries: list[Any]) -> str:
    """Return a list in words: its values, or what each of its mappings says, such as `kind lost, at 5 s`."""
    if not any(isinstance(entry, dict) for entry in entries):
        return ", ".join(map(str, entries))
    return "; ".join(
        ", ".join(f"{key} {_text(value)}" for key, value in entry.items()) if isinstance(entry, dict) else str(entry)
        for entry in entries
    )
