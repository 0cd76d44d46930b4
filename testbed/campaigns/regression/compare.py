"""A campaign against its baseline, seed by seed: what moved, by how much, and whether that is chance."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from testbed.campaigns.regression.standard import AXES
from testbed.campaigns.statistics import COVERAGE, holm

if TYPE_CHECKING:
    from collections.abc import Iterable, Mapping

    from testbed.signals import FloatArray

    Row = Mapping[str, Any]
    Key = tuple[str, ...]

# Errors that are compared, by their columns; those of a line of sight only where there is one.
ERRORS = {"error": "rmse_deg_s", "residual": "residual_rms_urad", "RPE": "rpe_urad.0.1"}
# Beyond this a change fails whatever its interval, in error and gain [dB]; a phase turns by as much relatively [deg].
LIMIT_DB = 0.5
LIMIT_DEG = float(np.rad2deg(10.0 ** (LIMIT_DB / 20.0) - 1.0))
# Below this a change is rounding [dB]; above it, one that chance makes once in so many campaigns fails too.
ROUNDING_DB, CHANCE = 1e-3, 0.01
_DB = 20.0 / np.log(10.0)


@dataclass(frozen=True)
class Move:
    """A quantity of a source in a case that is no longer what it was.

    Parameters
    ----------
    case : str
        In words.
    source : str
        Sensor or filter.
    quantity : {"error", "residual", "RPE", "gain", "phase", "definition"}
        What moved, `residual` and `RPE` (over 100 ms) of the line of sight; `definition`: an error is defined in one of
        the two only.
    change, lower, upper : float
        By how much, with its 95 % interval over paired seeds [dB; deg for a phase]; NaN where undefined.
    p_value : float
        Chance of it if nothing had changed, after Holm's correction over all that is compared [-].
    """

    case: str
    source: str
    quantity: str
    change: float
    lower: float
    upper: float
    p_value: float

    def words(self) -> str:
        """Return it as a line."""
        if self.quantity == "definition":
            return f"{self.source}, {self.case}: its error is defined in one of the two only"
        unit = "deg" if self.quantity == "phase" else "dB"
        interval = f" ({self.lower:+.3g} to {self.upper:+.3g})" if np.isfinite(self.lower) else ""
        return f"{self.source}, {self.case}: {self.quantity} moved by {self.change:+.3g} {unit}{interval}"


def in_words(values: Iterable[str]) -> str:
    """Return a case by what is not the usual of it.

    Parameters
    ----------
    values : iterable of str
        Of the axes, in their order.
    """
    signal, *others = values
    return ", ".join([signal, *(one for one in others if one not in _USUAL)])


_USUAL = ("rest", "none", "exact", "sx300, adis16505_filtered")


def moves(now: Iterable[Row], before: Iterable[Row]) -> list[Move]:
    """Return what is no longer what it was: beyond 0.5 dB, or by more than chance.

    Sources and cases that are in one of the two only are left out (`incomparable` names them).

    Parameters
    ----------
    now, before : iterable of mapping
        Rows as `testbed.campaigns.regression.history.essence` gives them.
    """
    new, old = _grouped(now), _grouped(before)
    found = []
    for key in [key for key in new if key in old]:
        seeds = sorted(new[key].keys() & old[key].keys())
        pair = [[side[key][seed] for seed in seeds] for side in (new, old)]
        found += _moves_of(key, *pair)
    errors = [one for one in found if one.quantity in ERRORS]
    corrected = dict(zip(map(id, errors), holm([one.p_value for one in errors]), strict=True))
    judged = [_with(one, corrected.get(id(one), 1.0)) for one in found]
    return [one for one in judged if _fails(one)]


def incomparable(now: Iterable[Row], before: Iterable[Row]) -> list[str]:
    """Return what cannot be compared, in words: new sources and cases, and those that are gone.

    Parameters
    ----------
    now, before : iterable of mapping
        As for `moves`.
    """
    new, old = _grouped(now), _grouped(before)
    return [*_only(new, old, "has no baseline yet"), *_sights(new, old), *_only(old, new, "is gone")]


def _sights(new: Mapping[Key, Any], old: Mapping[Key, Any]) -> list[str]:
    """Return the cases whose line of sight is new."""

    def aimed(rows: Mapping[int, Row]) -> bool:
        return bool(np.isfinite(_column(rows.values(), ERRORS["residual"])).any())

    cases = {key[1:] for key, rows in new.items() if key in old and aimed(rows) and not aimed(old[key])}
    return [f"line of sight, {in_words(case)}: has no baseline yet" for case in sorted(cases)]


def _only(here: Mapping[Key, Any], there: Mapping[Key, Any], words: str) -> list[str]:
    """Return what is in one of the two alone; a source with all its cases is one line."""
    if not there:
        return [f"everything {words}"] if here else []
    known = {key[0] for key in there}
    whole = sorted({key[0] for key in here} - known)
    cases = sorted(key for key in here if key not in there and key[0] in known)
    return [f"{name} {words}" for name in whole] + [f"{key[0]}, {in_words(key[1:])}: {words}" for key in cases]


def _grouped(rows: Iterable[Row]) -> dict[Key, dict[int, Row]]:
    groups: dict[Key, dict[int, Row]] = {}
    for row in rows:
        groups.setdefault((row["source"], *(row[axis] for axis in AXES)), {})[row["seed"]] = row
    return groups


def _moves_of(key: Key, now: list[Row], before: list[Row]) -> list[Move]:
    source, case = key[0], in_words(key[1:])
    errors = {name: [_column(rows, column) for rows in (now, before)] for name, column in ERRORS.items()}
    # A line of sight that is not in the baseline is no move, and none in both no comparison.
    held = {name: pair for name, pair in errors.items() if name == "error" or np.isfinite(pair[1]).any()}
    if any(not np.array_equal(np.isfinite(new), np.isfinite(old)) for new, old in held.values()):
        return [Move(case, source, "definition", np.nan, np.nan, np.nan, 1.0)]
    gains = [_column(rows, "gain") for rows in (now, before)]
    turn = _column(now, "phase_deg") - _column(before, "phase_deg")
    with np.errstate(divide="ignore", invalid="ignore"):
        return [
            *(_move(case, source, name, _DB * np.log(new / old)) for name, (new, old) in held.items()),
            _move(case, source, "gain", _DB * np.log(gains[0] / gains[1])),
            _move(case, source, "phase", (turn + 180.0) % 360.0 - 180.0),
        ]


def _move(case: str, source: str, quantity: str, changes: FloatArray) -> Move:
    """Return the mean change over seeds with its interval, by Student's t of the pairs."""
    from scipy.stats import t as student

    there = changes[np.isfinite(changes)]
    if not there.size:
        return Move(case, source, quantity, 0.0, np.nan, np.nan, 1.0)
    mean = float(there.mean())
    if there.size < 2:
        return Move(case, source, quantity, mean, np.nan, np.nan, 1.0)
    scale = float(there.std(ddof=1)) / there.size**0.5
    half = float(student.ppf(0.5 + COVERAGE / 2.0, there.size - 1)) * scale
    p = float(2.0 * student.sf(abs(mean) / scale, there.size - 1)) if scale > 0.0 else float(mean == 0.0)
    return Move(case, source, quantity, mean, mean - half, mean + half, p)


def _with(one: Move, p_value: float) -> Move:
    return Move(one.case, one.source, one.quantity, one.change, one.lower, one.upper, p_value)


def _fails(one: Move) -> bool:
    if one.quantity == "definition":
        return True
    if abs(one.change) > (LIMIT_DEG if one.quantity == "phase" else LIMIT_DB):
        return True
    return one.quantity in ERRORS and abs(one.change) > ROUNDING_DB and one.p_value < CHANCE


def _column(rows: Iterable[Row], name: str) -> FloatArray:
    return np.array([np.nan if row.get(name) is None else row[name] for row in rows], dtype=float)
