"""Units at the border: strings with units in, SI floats inside.

Angle and cycle are dimensions of their own, so that `10 rad/s` is no frequency, `1 Hz` no rate and `4 mrad` no number.
Only where a density is meant is the cycle taken as a pure number: `nrad/s/sqrt(Hz)` and `deg/sqrt(h)` are both
rad/sqrt(s). A temperature is absolute in `degC` and `K`; in a compound unit such as `ppm/degC` both are the same step.
`g0` is standard gravity, `g` a gram. What data sheets and logs write is read too: `dps`, `mdps`, `deg/sec`, `deg/hr`,
`rpm`, `mas/s`, `°/s`, `°/√h`.

A unit is terms joined by `*`, `/` or a blank. A term is a symbol, `1`, a unit in brackets or `sqrt(unit)`, with an
exponent from -9 to 9 in halves, written `**`, `^` or bare: `m/s^2`, `rad s**-0.5`, `deg/s/sqrt(Hz)`. At most 64
characters and two levels of brackets; anything else is refused before it is worked out.
"""

from __future__ import annotations

import functools
import math
import re
from dataclasses import dataclass
from decimal import Decimal
from typing import TYPE_CHECKING, Annotated, Any, Literal

from pydantic_core import PydanticCustomError, core_schema

from testbed.errors import quoted

if TYPE_CHECKING:
    from collections.abc import Iterable

    import pint
    from pydantic import GetCoreSchemaHandler, GetJsonSchemaHandler, ValidationInfo

DEG = math.radians(1.0)  # rad
DEG_H = DEG / 3600.0  # rad/s
CELSIUS = 273.15  # K, 0 degC
# Units in which the rates of a run are shown, and what rad/s is multiplied by for them.
RateUnit = Literal["deg/s", "deg/h"]
PER_RATE: dict[RateUnit, float] = {"deg/s": 1.0 / DEG, "deg/h": 1.0 / DEG_H}
# A tenth of the Earth's rate.
_SLOW = 1.5 * DEG_H

_DEFINITIONS = """
nano- = 1e-9 = n-
micro- = 1e-6 = u- = µ- = μ-
milli- = 1e-3 = m-
centi- = 1e-2 = c-
kilo- = 1e3 = k-
mega- = 1e6 = M-
second = [time] = s = sec
meter = [length] = m
gram = [mass] = g
ampere = [current] = A
kelvin = [temperature] = K
celsius_step = kelvin = degC
percent = 0.01
ppm = 1e-6
radian = [angle] = rad
cycle = [cycle]
count = [count] = LSB
minute = 60 * second = min
hour = 3600 * second = h = hr
day = 86400 * second
degree = 3.141592653589793 / 180 * radian = deg
arcminute = degree / 60 = arcmin
arcsecond = degree / 3600 = arcsec
milliarcsecond = degree / 3600000 = mas
revolution = 2 * 3.141592653589793 * radian = rev
dps = degree / second
rpm = revolution / minute
hertz = cycle / second = Hz
newton = kilogram * meter / second ** 2 = N
pascal = newton / meter ** 2 = Pa
joule = newton * meter = J
watt = joule / second = W
volt = watt / ampere = V
ohm = volt / ampere
siemens = ampere / volt = S
standard_gravity = 9.80665 * meter / second ** 2 = g0
tesla = volt * second / meter ** 2 = T
henry = volt * second / ampere = H
farad = ampere * second / volt = F
"""

# Spellings of data sheets: the degree sign, the ordinal sign that looks like it, the root sign.
_SPELLINGS = ((re.compile(r"[°º]"), "deg"), (re.compile(r"√\s*(\w+)"), r"sqrt(\1)"), (re.compile(r"√\s*\("), "sqrt("))
# Beyond these, in SI, no quantity of an experiment lies, and its square would overflow or vanish.
LEAST, MOST = 1e-30, 1e30
_ICE_POINT = Decimal("273.15")
_NUMBER = re.compile(
    r"\s*([+-]?(?:\d+\.?\d*|\.\d+)(?:[eE][+-]?\d+)?|[+-]?(?:inf|nan)\w*)\s*(.*)", re.IGNORECASE | re.DOTALL
)

_MOST_UNIT, _MOST_TEXT = 64, 256
# Atomic, so that g0 is never g to the power of 0.
_SYMBOL = r"(?>g0|[A-Za-zµμ]+|%)"
_POWER = r"[+-]?(?:9(?:\.0)?|[0-8](?:\.[05])?)"
_RAISED = r"(?:\s*(?:\*\*|\^)\s*)?"


def _product(atom: str) -> str:
    """Return the pattern of terms, which are 1 or an atom with its exponent, joined."""
    term = rf"(?:1|{atom}(?:{_RAISED}{_POWER})?)"
    return rf"\s*{term}(?:(?:\s*[*/]\s*|\s+){term})*\s*"


_INNER = _product(rf"(?:{_SYMBOL}|(?:sqrt)?\({_product(_SYMBOL)}\))")
_UNIT = re.compile(_product(rf"(?:{_SYMBOL}|(?:sqrt)?\({_INNER}\))"), re.ASCII)
_EXPONENT = re.compile(rf"({_SYMBOL}|\)){_RAISED}({_POWER})", re.ASCII)
_ROOT = re.compile(r"sqrt(\((?:[^()]|\([^()]*\))*\))")


@functools.cache
def _registry() -> pint.UnitRegistry:
    import pint

    registry = pint.UnitRegistry(None)
    registry.load_definitions(_DEFINITIONS.strip().splitlines())
    return registry


@functools.lru_cache(4096)
def _factor(unit: str, si: str, *, cycle_is_number: bool) -> float:
    """Return the factor from `unit` to `si`; ValueError with the expectation if the dimensions differ."""
    if len(unit) > _MOST_UNIT:
        msg = f"expected a unit of at most {_MOST_UNIT} characters, got {len(unit)}"
        raise ValueError(msg)
    registry = _registry()
    try:
        given = registry.Quantity(1.0, registry.parse_units(_expression(unit))).to_base_units()
    except Exception as error:
        msg = f"unit {quoted(unit)} is not understood"
        raise ValueError(msg) from error
    wanted = registry.Quantity(1.0, registry.parse_units(si.replace("^", "**") if si else "")).to_base_units()
    have, want = dict(given.dimensionality), dict(wanted.dimensionality)
    if cycle_is_number:
        have.pop("[cycle]", None)
    if have.keys() != want.keys() or any(not math.isclose(have[k], want[k]) for k in want):
        msg = f"{quoted(unit)} has the wrong dimension"
        raise ValueError(msg)
    return float(given.magnitude / wanted.magnitude)


def _expression(unit: str) -> str:
    """Return a unit of the grammar as the library of units takes it; ValueError if it is none."""
    if not _UNIT.fullmatch(unit):
        raise ValueError(unit)
    text = _EXPONENT.sub(r"\1**\2", unit).replace("%", "percent")
    while _ROOT.search(text):
        text = _ROOT.sub(r"(\1**0.5)", text)
    return text


def parse(text: str, si: str, *, example: str = "", cycle_is_number: bool = False) -> float:
    """Read a number with its unit and return it in the SI unit `si`.

    Parameters
    ----------
    text : str
        Such as ``0.15 deg/sqrt(h)``.
    si : str
        The unit of the result, such as ``rad*s^-0.5``; empty for a ratio, which needs no unit.
    example : str, optional
        A correct value, for the message.
    cycle_is_number : bool, optional
        Accept Hz where 1/s is meant (densities).

    Returns
    -------
    float
        The value in `si`.

    Raises
    ------
    ValueError
        If the number, the unit or the dimension is wrong; NaN and infinity are refused.

    Examples
    --------
    >>> parse("20 kHz", "Hz")
    20000.0
    >>> parse("10 rad/s", "Hz")
    Traceback (most recent call last):
    ValueError: expected a quantity in Hz, got '10 rad/s': 'rad/s' has the wrong dimension
    """
    expected = _expectation(si, example)
    if len(text) > _MOST_TEXT:
        msg = f"{expected}, got a text of {len(text)} characters"
        raise ValueError(msg)
    match = _NUMBER.fullmatch(text)
    if match is None:
        msg = f"{expected}, got {quoted(text)}"
        raise ValueError(msg)
    number, unit = float(match[1]), _plain(match[2].strip())
    if not math.isfinite(number):
        msg = f"{expected}, got {quoted(text)}, which is not finite"
        raise ValueError(msg)
    if not unit and si:
        msg = f"{expected}, got {quoted(text)}: the unit is missing"
        raise ValueError(msg)
    try:
        value = number * _factor(unit, si, cycle_is_number=cycle_is_number) if unit else number
    except ValueError as error:
        msg = f"{expected}, got {quoted(text)}: {error}"
        raise ValueError(msg) from error
    if (unit, si) == ("degC", "K"):
        # In decimals, so that 25 degC and 298.15 K are the same bits.
        value = float(Decimal(match[1]) + _ICE_POINT)
    if not math.isfinite(value):
        msg = f"{expected}, got {quoted(text)}, which is not finite"
        raise ValueError(msg)
    return value


def rate_unit(noise: Iterable[float]) -> RateUnit:
    """Return the unit in which all rates of a run are shown, known before it starts: deg/h where no reading is noisier
    than a tenth of the Earth's rate, else deg/s.

    Parameters
    ----------
    noise : iterable of float
        Standard deviation of the noise of a reading, of each sensor [rad/s]; zero and NaN say nothing.

    Examples
    --------
    >>> rate_unit([0.05 * DEG_H]), rate_unit([0.05 * DEG_H, 0.1 * DEG]), rate_unit([0.0])
    ('deg/h', 'deg/s', 'deg/s')
    """
    known = [std for std in noise if std > 0.0]
    return "deg/h" if known and max(known) < _SLOW else "deg/s"


def _plain(unit: str) -> str:
    """Return a unit with the signs of data sheets spelt out: `°/√h` is `deg/sqrt(h)`."""
    for sign, words in _SPELLINGS:
        unit = sign.sub(words, unit)
    return unit


def _expectation(si: str, example: str) -> str:
    return (f"expected a quantity in {si}" if si else "expected a ratio") + (
        f", such as {example!r}" if example else ""
    )


@dataclass(frozen=True)
class Quantity:
    """Pydantic annotation of a float that carries a unit at the border.

    A YAML file gives a string with a unit (validation context ``{"border": True}``); Python gives an SI float.

    Parameters
    ----------
    unit : str
        SI unit of the float; empty for a ratio, which YAML may also give as a plain number.
    example : str
        A correct value, shown in messages and in the schema.
    above, at_least, at_most : float, optional
        Bounds in SI; `above` is exclusive.
    cycle_is_number : bool, optional
        For densities per hertz.
    """

    unit: str
    example: str
    above: float | None = None
    at_least: float | None = None
    at_most: float | None = None
    cycle_is_number: bool = False

    def validate(self, value: Any, info: ValidationInfo) -> float:
        """Return the SI float of `value`; raise a pydantic error that says what was expected."""
        try:
            return self.read(value, border=bool((info.context or {}).get("border")))
        except ValueError as error:
            kind = "quantity"
            raise PydanticCustomError(kind, "{reason}", {"reason": str(error)}) from error

    def read(self, value: Any, *, border: bool) -> float:
        """Return the SI float of `value`, a string with a unit at the `border`; ValueError says what was expected."""
        si = self._read(value, border=border)
        self._bound(si, value)
        return si

    def _read(self, value: Any, *, border: bool) -> float:
        if isinstance(value, str):
            return parse(value, self.unit, example=self.example, cycle_is_number=self.cycle_is_number)
        if isinstance(value, bool) or not isinstance(value, int | float) or not abs(value) < math.inf:
            msg = f"{_expectation(self.unit, self.example)}, got {quoted(value)}"
            raise ValueError(msg)
        if border and self.unit:
            msg = f"{_expectation(self.unit, self.example)}, got {quoted(value)}: the unit is missing"
            raise ValueError(msg)
        try:
            return float(value)
        except OverflowError as error:
            msg = f"{_expectation(self.unit, self.example)}, got {quoted(value)}"
            raise ValueError(msg) from error

    def _bound(self, si: float, value: Any) -> None:
        checks = (
            (si != 0.0 and not LEAST <= abs(si) <= MOST, f"0, or a magnitude of {LEAST:g} to {MOST:g}"),
            (self.above is not None and si <= (self.above or 0.0), f"more than {self.above}"),
            (self.at_least is not None and si < (self.at_least or 0.0), f"at least {self.at_least}"),
            (self.at_most is not None and si > (self.at_most or 0.0), f"at most {self.at_most}"),
        )
        for failed, bound in checks:
            if failed:
                msg = f"expected {bound} {self.unit}, got {quoted(value)}"
                raise ValueError(msg)

    def __get_pydantic_core_schema__(self, source: Any, handler: GetCoreSchemaHandler) -> core_schema.CoreSchema:
        return core_schema.with_info_plain_validator_function(
            self.validate,
            serialization=core_schema.plain_serializer_function_ser_schema(self._write, info_arg=True),
        )

    def __get_pydantic_json_schema__(
        self, schema: core_schema.CoreSchema, handler: GetJsonSchemaHandler
    ) -> dict[str, Any]:
        if not self.unit:
            return {"type": ["string", "number"], "description": "ratio", "examples": [self.example]}
        return {"type": "string", "description": f"quantity in {self.unit}", "examples": [self.example]}

    def _write(self, value: float, info: Any) -> str | float:
        # A default of NumPy's own float would be written with its type's name.
        si = float(value)
        return f"{si!r} {self.unit}" if self.unit and (info.context or {}).get("border") else si


Angle = Annotated[float, Quantity("rad", "5 mrad")]
AngularAcceleration = Annotated[float, Quantity("rad/s^2", "0.1 deg/h/s")]
Duration = Annotated[float, Quantity("s", "20 s", at_least=0.0)]
# A delay is a line of samples; a second of it is more than any instrument has.
DelayTime = Annotated[float, Quantity("s", "200 us", at_least=0.0, at_most=1.0)]
PositiveDuration = Annotated[float, Quantity("s", "20 s", above=0.0)]
Frequency = Annotated[float, Quantity("Hz", "10 Hz", above=0.0)]
# Some minutes between two readings, up to the base clock.
SampleRate = Annotated[float, Quantity("Hz", "2 kHz", at_least=0.005, at_most=20_000.0)]
Length = Annotated[float, Quantity("m", "15 mm", above=0.0)]
Position = Annotated[float, Quantity("m", "15 mm")]
Mass = Annotated[float, Quantity("kg", "20 kg", above=0.0)]
Inertia = Annotated[float, Quantity("kg*m^2", "0.05 kg*m^2", above=0.0)]
Torque = Annotated[float, Quantity("N*m", "6 N*m", at_least=0.0)]
AngularDrag = Annotated[float, Quantity("N*m*s/rad", "0.5 mN*m*s/rad", at_least=0.0)]
Rate = Annotated[float, Quantity("rad/s", "1 deg/s")]
Range = Annotated[float, Quantity("rad/s", "30 deg/s", above=0.0)]
RateStd = Annotated[float, Quantity("rad/s", "2.7 deg/h", at_least=0.0)]
RatePsd = Annotated[float, Quantity("rad^2/s", "1e-6 (deg/s)^2/Hz", at_least=0.0, cycle_is_number=True)]
RateDensity = Annotated[float, Quantity("rad*s^-0.5", "0.15 deg/sqrt(h)", at_least=0.0, cycle_is_number=True)]
RateRandomWalk = Annotated[float, Quantity("rad*s^-1.5", "0.1 deg/h/sqrt(h)", at_least=0.0, cycle_is_number=True)]
QuantizationAngle = Annotated[float, Quantity("rad", "1 urad", at_least=0.0)]
MagneticField = Annotated[float, Quantity("T", "0.448 T", at_least=0.0)]
MassDensity = Annotated[float, Quantity("kg/m^3", "13534 kg/m^3", above=0.0)]
Viscosity = Annotated[float, Quantity("Pa*s", "1.526 mPa*s", above=0.0)]
Conductivity = Annotated[float, Quantity("S/m", "1.04e6 S/m", above=0.0)]
# No instrument, and no liquid metal of one, is hotter.
Temperature = Annotated[float, Quantity("K", "25 degC", above=0.0, at_most=1000.0)]
Ratio = Annotated[float, Quantity("", "200 ppm")]
Probability = Annotated[float, Quantity("", "1 %", at_least=0.0, at_most=1.0)]
# What doubles with a kelvin is no property; e to this times a temperature is still a number.
RatioPerKelvin = Annotated[float, Quantity("K^-1", "10 ppm/K", at_least=-1.0, at_most=1.0)]
RatePerKelvin = Annotated[float, Quantity("rad/s/K", "0.005 deg/s/K")]
RatePerAcceleration = Annotated[float, Quantity("rad*s/m", "0.01 deg/s/g0")]
Voltage = Annotated[float, Quantity("V", "10 V", above=0.0)]
ScaleFactor = Annotated[float, Quantity("V*s/rad", "20 mV/(deg/s)", above=0.0)]
