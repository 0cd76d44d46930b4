"""What the name of a column says: its unit, and whether it is a time, a rate, an angle or a temperature."""

from __future__ import annotations

import functools
import re
from dataclasses import dataclass

from testbed import units

# SI unit of each quantity that a log's column may hold; the first that fits a unit is taken.
QUANTITIES = {
    "rate": "rad/s",
    "angle": "rad",
    "time": "s",
    "temperature": "K",
    "acceleration": "m/s^2",
    "voltage": "V",
    "field": "T",
    "frequency": "Hz",
}
_BRACKETS = re.compile(r"^(?P<name>.*?)\s*[\[(](?P<unit>[^\[\]()]*(?:\([^()]*\))?[^\[\]()]*)[\])]\s*$")
_SUFFIX = re.compile(r"^(?P<name>.*[^_. ])[_. ](?P<unit>[^_ ]+)$")
_COMMA = re.compile(r"^(?P<name>.*?)\s*,\s*(?P<unit>[^,]+)$")
# Units in the name of a column that are written without a stroke.
_SPELLED = re.compile(
    r"^(?P<name>.*[^_. ])[_. ](?P<prefix>m|u)?(?P<angle>rad|deg)(?:[ _]?(?:s-1|ps|s)|_?per_?s(?:ec)?|_sec)$",
    re.IGNORECASE,
)
_TIME = re.compile(
    r"^(t|time|times|timestamp\w*|time ?stamp|stamp|stamps|zeit|zeitstempel|epoch|datetime|date|secs?|seconds?|"
    r"us|ms|ns|usec|msec|nsec|unix\w*|utc\w*|clock|tsample\w*|systime\w*|sampletime\w*|t_\w+|time_\w+|"
    r"i?tow(_\w+)?|seconds_elapsed|elapsed\w*|(field\.)?header\.stamp.*)$",
    re.IGNORECASE,
)
_SECONDS = {"sec": "s", "secs": "s", "second": "s", "seconds": "s", "usec": "us", "msec": "ms", "nsec": "ns"}
_ALONE = {"us", "ms", "ns"} | set(_SECONDS)


@dataclass(frozen=True)
class Label:
    """A column's name taken apart.

    Parameters
    ----------
    name : str
        Without the unit.
    unit : str
        As written, or empty.
    quantity : str
        A key of `QUANTITIES`, ``time`` by its name alone, or empty.
    """

    name: str
    unit: str
    quantity: str


def take_apart(name: str, unit: str = "") -> Label:
    """Return what the name of a column, and the unit that stands elsewhere, say.

    Parameters
    ----------
    name : str
        As in the file.
    unit : str, optional
        From a line of units or an attribute; beats what is in the name.

    Returns
    -------
    Label
        Such as rate in rad/s for ``w_x [rad s^-1]``.
    """
    bare = name.strip().lstrip("#%").strip()
    written = clean_unit(unit)
    found = "" if written else _unit_in(bare)
    short = _without_unit(bare)
    chosen = written or found
    quantity = quantity_of(chosen)
    if not quantity and not chosen and _TIME.match(short):
        quantity = "time"
    return Label(short, chosen, quantity)


def clean_unit(text: str) -> str:
    """Return a unit without the brackets of a line of units, or the date that NetCDF counts from; none of a dash."""
    bare = re.sub(r"\s+since\s.*", "", text.strip())
    if not bare.strip("-"):
        return ""
    return bare[1:-1].strip() if bare[:1] + bare[-1:] in {"[]", "()"} else bare


@functools.lru_cache(maxsize=1024)
def quantity_of(unit: str) -> str:
    """Return which of `QUANTITIES` has this unit, or an empty text."""
    if not unit:
        return ""
    for quantity, si in QUANTITIES.items():
        try:
            units.parse(f"1 {_SECONDS.get(unit.lower(), unit)}", si)
        except ValueError:
            continue
        return quantity
    return ""


def second(unit: str) -> str:
    """Return a unit of time as `testbed.units` writes it."""
    return _SECONDS.get(unit.lower(), unit)


def _unit_in(name: str) -> str:
    if name.lower() in _ALONE:
        return second(name)
    if match := _SPELLED.match(name):
        return f"{(match['prefix'] or '').lower()}{match['angle'].lower()}/s"
    for pattern in (_BRACKETS, _COMMA, _SUFFIX):
        match = pattern.match(name)
        if match is None:
            continue
        unit = match["unit"].strip()
        # One letter is an axis or a number more often than a unit; seconds are said by the name before.
        if pattern is _SUFFIX and len(unit) == 1 and not (unit == "s" and _TIME.match(match["name"])):
            continue
        if quantity_of(unit) or unit.lower() in _SECONDS:
            return second(unit)
    return ""


def _without_unit(name: str) -> str:
    match = _BRACKETS.match(name)
    if match and match["name"] and not match["unit"].strip().isdigit():
        return match["name"].strip()
    match = _COMMA.match(name)
    return match["name"] if match and quantity_of(match["unit"]) else name
