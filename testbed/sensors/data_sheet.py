r"""Keys as data sheets have them, turned into the parameters of an instrument, and how that was done.

A data sheet's "rate noise density" is one-sided, :math:`N = n / \sqrt 2`; its "in-run bias stability" is the floor of
the Allan deviation, :math:`\sqrt{2 \ln 2 / \pi} B = 0.664 B`; its "bandwidth" is where the response is down by 3 dB.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from pydantic import ValidationError
from pydantic_core import InitErrorDetails, PydanticCustomError

from testbed.errors import quoted
from testbed.units import Quantity, parse

if TYPE_CHECKING:
    from collections.abc import Mapping

ALLAN_FLOOR = math.sqrt(2.0 * math.log(2.0) / math.pi)

# Per root hertz and nothing else: deg/sqrt(h) is an angle random walk, which is two-sided.
_ONE_SIDED = Quantity("rad/s/Hz^0.5", "5 mdps/sqrt(Hz)", at_least=0.0)
_RATE = Quantity("rad/s", "250 dps", above=0.0)
_FLOOR = Quantity("rad/s", "2.7 deg/h", at_least=0.0)
_FREQUENCY = Quantity("Hz", "100 Hz", above=0.0)


@dataclass(frozen=True)
class Step:
    """One key as it stood, the rule, and what it became.

    Parameters
    ----------
    key, written, rule, becomes : str
        For people to read.
    """

    key: str
    written: str
    rule: str
    becomes: str


@dataclass(frozen=True)
class Word:
    """A key of data sheets that stands for one parameter.

    Parameters
    ----------
    key, field : str
        Its name, and the parameter's.
    quantity : Quantity
        What it takes.
    factor : float
        Parameter over value [-].
    rule : str
        The same in words.
    unit : str
        SI unit of the parameter.
    shown : str
        A unit of data sheets for the parameter.
    """

    key: str
    field: str
    quantity: Quantity
    factor: float
    rule: str
    unit: str
    shown: str

    def schema(self) -> dict[str, Any]:
        """Return its JSON schema."""
        return _described(self.quantity, f"{self.rule}; in place of {self.field}")

    def becomes(self, value: float) -> str:
        """Return what a value in SI becomes, in words."""
        shown = value * self.factor / parse(f"1 {self.shown}", self.unit, cycle_is_number="Hz" not in self.unit)
        return f"{self.field}: {shown:.6g} {self.shown}"


OUTPUT_RATE = Word("output_rate", "sample_rate", _FREQUENCY, 1.0, "the same", "Hz", "Hz")
FULL_SCALE = Word("full_scale", "range", _RATE, 1.0, "the same", "rad/s", "deg/s")
RATE_NOISE_DENSITY = Word(
    "rate_noise_density",
    "angle_random_walk",
    _ONE_SIDED,
    math.sqrt(0.5),
    "one-sided: over sqrt(2)",
    "rad*s^-0.5",
    "deg/sqrt(h)",
)
IN_RUN_BIAS_STABILITY = Word(
    "in_run_bias_stability",
    "bias_instability",
    _FLOOR,
    1.0 / ALLAN_FLOOR,
    "floor of the Allan deviation: over 0.664",
    "rad/s",
    "deg/h",
)
GYRO_WORDS = (OUTPUT_RATE, FULL_SCALE, RATE_NOISE_DENSITY, IN_RUN_BIAS_STABILITY)
# Ways to give a low-pass, one of them.
LOW_PASSES = (("corner", "damping"), ("numerator", "denominator"), ("bandwidth", "order"))
_MOST_POLES = 8
# A default that follows from other fields, which are wrong.
_CONSEQUENCE = "default_factory_not_called"


class Sheet:
    """The keys of an instrument while those of data sheets are turned into parameters.

    Parameters
    ----------
    values : mapping
        The keys as they stand: strings with units, or SI floats from Python.
    border : bool
        Whether units are required.
    """

    def __init__(self, values: Mapping[str, Any], *, border: bool) -> None:
        self.values, self._border = dict(values), border
        self.steps: list[Step] = []
        self.problems: dict[str, str] = {}
        # Parameters that are missing only because their word could not be read.
        self._unread: set[tuple[str, ...]] = set()

    def translate(self, word: Word) -> None:
        """Replace the key of `word`, if it is there, by its parameter."""
        if word.key not in self.values or self._said_twice(word.key, (word.field,)):
            return
        written = self.values.pop(word.key)
        value = self._read(word.key, word.quantity, written)
        if value is None:
            self._unread.add((word.field,))
        else:
            si = value * word.factor
            self.values[word.field] = f"{si!r} {word.unit}" if self._border else si
            self.steps.append(Step(word.key, str(written), word.rule, word.becomes(value)))

    def translate_low_pass(self) -> None:
        """Replace `bandwidth` and `order` by the parameters of a Butterworth low-pass."""
        *others, own = LOW_PASSES
        if not any(key in self.values for key in own) or self._said_twice(own[0], tuple(k for o in others for k in o)):
            return
        written, order = self.values.pop("bandwidth", None), self.values.pop("order", 2)
        if written is None:
            self.problems["order"] = "expected beside bandwidth, which is missing"
        elif isinstance(order, bool) or not isinstance(order, int) or not 1 <= order <= _MOST_POLES:
            self.problems["order"] = f"expected a whole number of poles from 1 to {_MOST_POLES}, got {quoted(order)}"
        else:
            self._lay_low_pass(written, order)

    def _lay_low_pass(self, written: Any, order: int) -> None:
        bandwidth = self._read("bandwidth", _FREQUENCY, written)
        if bandwidth is None:
            return
        fields = butterworth(bandwidth, order)
        becomes = "numerator and denominator"
        if "corner" in fields:
            becomes = f"corner: {bandwidth:.6g} Hz, damping: {fields['damping']:.6g}"
            fields["corner"] = f"{bandwidth!r} Hz" if self._border else bandwidth
        self.values |= fields
        rule = f"-3 dB of a Butterworth low-pass of order {order}"
        self.steps.append(Step("bandwidth", str(written), rule, becomes))

    def refusal(self, title: str) -> ValidationError:
        """Return the error of all problems, for a model called `title`."""
        return ValidationError.from_exception_data(title, self._lines())

    def beside(self, error: ValidationError) -> ValidationError:
        """Return the problems together with what else is wrong, less what only follows from either."""
        others = [
            _line(one["type"], one["loc"], one["msg"], one["input"], one.get("ctx", {}))
            for one in error.errors()
            if one["loc"] not in self._unread and one["type"] != _CONSEQUENCE
        ]
        return ValidationError.from_exception_data(error.title, [*self._lines(), *others])

    def _lines(self) -> list[InitErrorDetails]:
        return [_line("quantity", (key,), message, None, {}) for key, message in self.problems.items()]

    def _said_twice(self, key: str, others: tuple[str, ...]) -> bool:
        twice = [other for other in others if other in self.values]
        if twice:
            del self.values[key]
            self.problems[key] = f"says the same as {twice[0]!r}: give one of the two"
        return bool(twice)

    def _read(self, key: str, quantity: Quantity, written: Any) -> float | None:
        try:
            return quantity.read(written, border=self._border)
        except ValueError as error:
            self.problems[key] = str(error)
            return None


def _line(
    kind: str, place: tuple[str | int, ...], message: str, value: Any, context: dict[str, Any]
) -> InitErrorDetails:
    error = PydanticCustomError(kind, "{reason}", {**context, "reason": message})
    return InitErrorDetails(type=error, loc=place, input=value)


def _described(quantity: Quantity, meaning: str) -> dict[str, Any]:
    words = f"quantity in {quantity.unit}, {meaning}"
    return {"type": "string", "description": words, "examples": [quantity.example]}


def low_pass_schema() -> dict[str, Any]:
    """Return the JSON schema of `bandwidth` and `order`."""
    order = {"type": "integer", "minimum": 1, "maximum": _MOST_POLES, "default": 2, "description": "poles"}
    return {"bandwidth": _described(_FREQUENCY, "-3 dB, Butterworth; in place of corner and damping"), "order": order}


def butterworth(bandwidth: float, order: int) -> dict[str, Any]:
    r"""Return the parameters of a Butterworth low-pass, which is down by 3 dB at `bandwidth`.

    Parameters
    ----------
    bandwidth : float
        Half-power frequency [Hz].
    order : int
        Number of poles [-].

    Returns
    -------
    dict of str to float or tuple of float
        `corner` and `damping` for two poles, else `numerator` and `denominator` in s.
    """
    if order == 2:
        return {"corner": bandwidth, "damping": math.sqrt(0.5)}
    from scipy.signal import butter

    numerator, denominator = butter(order, 2.0 * np.pi * bandwidth, analog=True)
    return {"numerator": tuple(map(float, numerator)), "denominator": tuple(map(float, denominator))}
