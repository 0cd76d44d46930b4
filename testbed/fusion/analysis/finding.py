"""What readings contradict, one thing at a time: kind, sensor, value with its interval, and what to do about it."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Literal

from testbed.units import DEG

Kind = Literal[
    "axis",
    "swapped",
    "sign",
    "unit",
    "gain",
    "offset",
    "rate",
    "bandwidth",
    "saturation",
    "bias",
    "belief",
    "repeats",
    "gaps",
]
# What `remedied` can apply to readings and stamps without knowing more than the record tells.
SAFE: tuple[Kind, ...] = ("sign", "unit", "gain", "offset", "rate")
# Half of an interval over a normal standard deviation: a finding that is none has a chance of 1e-4.
QUANTILE = 3.8906
# A departure below these is no finding however sure it is: of a gain [-], of an offset [s], of a rate [-].
TOLERANCE: dict[str, float] = {"gain": 0.01, "offset": 3e-4, "rate": 1e-4}

# What else rates are written in: how many of it are 1 rad/s.
UNITS = {
    "deg/s": 1.0 / DEG,
    "rev/s": 0.5 / math.pi,
    "rpm": 30.0 / math.pi,
    "mrad/s": 1e3,
    "arcmin/s": 60.0 / DEG,
    "deg/h": 3600.0 / DEG,
}

# A unit of `Finding` -> how it is shown: factor, decimals, unit.
_SHOWN = {
    "s": (1e3, 3, " ms"),
    "rad/s": (1.0 / DEG, 4, " deg/s"),
    "Hz": (1.0, 4, " Hz"),
    "1": (1.0, 4, ""),
}


@dataclass(frozen=True)
class Finding:
    """A contradiction between the readings of a sensor and those of another one, or what is believed of it.

    Parameters
    ----------
    kind : str
        ``axis``, ``swapped``, ``sign``, ``unit``, ``gain``, ``offset``, ``rate``, ``bandwidth``, ``saturation``,
        ``bias``, ``belief``, ``repeats`` or ``gaps``.
    sensor : str
        The one that is named, since two that contradict each other do not tell which is wrong.
    value, lower, upper : float
        What was found, and its interval at 1e-4. A gain, a unit and a sign are the factor that the readings are too
        large by, and of an axis what of the other one's motion they show; an offset is by how much the stamps are late
        at the record's first one [s]; a rate by how much they run fast [-]; a bandwidth is where the noise ends [Hz]; a
        bias is in [rad/s]; of a belief it is the noise over the believed one; of ``saturation``, ``repeats`` and
        ``gaps`` the share of the readings.
    unit : str
        SI unit of the three, "1" for a number.
    remedy : str
        What to do about it.
    fixed : bool, optional
        It was applied to the readings that were handed on.
    """

    kind: Kind
    sensor: str
    value: float
    lower: float
    upper: float
    unit: str
    remedy: str
    fixed: bool = False

    def __str__(self) -> str:
        """Return sensor, kind, value, interval and remedy in a line, in the units of the border."""
        scale, decimals, unit = (1e6, 1, " ppm") if self.kind == "rate" else _SHOWN[self.unit]
        value, lower, upper = (
            f"{scale * one:.{decimals}f}" if abs(scale * one) < 1e6 else f"{scale * one:.3g}"
            for one in (self.value, self.lower, self.upper)
        )
        interval = "" if math.isnan(self.lower) else f" ({lower} to {upper})"
        done = " [fixed]" if self.fixed else ""
        return f"{self.sensor}: {self.kind} {value}{unit}{interval}: {self.remedy}{done}"


@dataclass(frozen=True)
class Verdict:
    """What stands against a record before anything is estimated from it.

    Parameters
    ----------
    findings : tuple of Finding
        What is significant at 1e-4 and above the tolerance of its kind.
    undecided : tuple of str
        What this record cannot tell, and why, one sentence each.
    """

    findings: tuple[Finding, ...] = ()
    undecided: tuple[str, ...] = ()

    @property
    def unfixed(self) -> tuple[Finding, ...]:
        """The findings that still stand."""
        return tuple(one for one in self.findings if not one.fixed)
