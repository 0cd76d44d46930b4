"""Units at the border: conversions, dimensions, messages."""

from __future__ import annotations

import math
import time

import pytest
from hypothesis import assume, given
from hypothesis import strategies as st
from pydantic import ValidationError

from testbed.models.motions.sine import Sine
from testbed.parts import Part
from testbed.units import Ratio, Temperature, parse

DEG = math.pi / 180


@pytest.mark.parametrize(
    ("text", "si", "value"),
    [
        ("20 kHz", "Hz", 20_000.0),
        ("5.555 mrad", "rad", 5.555e-3),
        ("1 deg/s", "rad/s", DEG),
        ("2.7 deg/h", "rad/s", 2.7 * DEG / 3600),
        ("1 rev/min", "rad/s", 2 * math.pi / 60),
        ("6.5e-7 (deg/s)^2", "rad^2/s^2", 6.5e-7 * DEG**2),
        ("0.3 (deg/s)^2/s", "rad^2/s^3", 0.3 * DEG**2),
        ("15 mm", "m", 0.015),
        ("1.526 mPa*s", "Pa*s", 1.526e-3),
        ("20 mV/(deg/s)", "V*s/rad", 0.02 / DEG),
        ("13.534 g/cm^3", "kg/m^3", 13534.0),
        ("-3 arcsec", "rad", -3 * DEG / 3600),
        ("500 µrad", "rad", 5e-4),
        ("25 degC", "K", 298.15),
        ("-40 degC", "K", 233.15),
        ("298.15 K", "K", 298.15),
        ("200 ppm", "", 2e-4),
        ("1 %", "", 0.01),
        ("0.3", "", 0.3),
        ("10 ppm/K", "K^-1", 1e-5),
        ("10 ppm/degC", "K^-1", 1e-5),
        ("0.02 %/K", "K^-1", 2e-4),
        ("0.005 deg/s/K", "rad/s/K", 0.005 * DEG),
        ("0.01 deg/s/g0", "rad*s/m", 0.01 * DEG / 9.80665),
        # As data sheets and loggers write it; the last degree sign is the masculine ordinal.
        ("250 dps", "rad/s", 250 * DEG),
        ("70 mdps", "rad/s", 0.07 * DEG),
        ("1 deg/sec", "rad/s", DEG),
        ("2.7 deg/hr", "rad/s", 2.7 * DEG / 3600),
        ("1 rad/sec", "rad/s", 1.0),
        ("10 rpm", "rad/s", 20 * math.pi / 60),
        ("5 mas/s", "rad/s", 5e-3 * DEG / 3600),
        ("1 °/s", "rad/s", DEG),
        ("1 º/s", "rad/s", DEG),
        ("3 °/h", "rad/s", 3 * DEG / 3600),
        ("25 °C", "K", 298.15),
        ("131 LSB/dps", "LSB*s/rad", 131 / DEG),
    ],
)
def test_parse_converts_to_si(text, si, value):
    # A product of a few correctly rounded factors: within some units in the last place.
    assert parse(text, si) == pytest.approx(value, rel=1e-14)


@pytest.mark.parametrize(
    "text",
    [
        "0.15 deg/sqrt(h)",
        "0.15 deg/sqrt(hr)",
        "0.15 °/√h",
        "0.15 º/√hr",
        "0.0025 deg/s/sqrt(Hz)",
        "2.5 mdps/sqrt(Hz)",
        "2.5 mdps/√Hz",
        "0.0025 °/s/√(Hz)",
        "0.0025 deg/sqrt(s)",
    ],
)
def test_parse_density_takes_the_cycle_as_a_number(text):
    # deg/sqrt(h) = deg / (60 sqrt(s)): 0.15 / 60 = 0.0025.
    assert parse(text, "rad*s^-0.5", cycle_is_number=True) == pytest.approx(0.0025 * DEG, rel=1e-14)


@pytest.mark.parametrize(
    ("text", "si"),
    [
        ("10 rad/s", "Hz"),
        ("1 Hz", "rad/s"),
        ("4 mrad", ""),
        ("1 deg", "rad/s"),
        ("5 s", "Hz"),
        ("1 deg/sqrt(h)", "rad/s"),
        ("5 degC", ""),
        ("1 %", "K"),
        ("25 degC/s", "K"),
        ("0.01 deg/s/g", "rad*s/m"),
    ],
)
def test_parse_refuses_another_dimension(text, si):
    with pytest.raises(ValueError, match="wrong dimension"):
        parse(text, si)


@pytest.mark.parametrize("text", ["nan deg/s", "inf deg/s", "-inf deg/s", "NaN deg/s", "1e400 deg/s", "infinity deg/s"])
def test_parse_refuses_what_is_not_finite(text):
    with pytest.raises(ValueError, match="not finite"):
        parse(text, "rad/s")


@pytest.mark.parametrize(
    "text",
    ["", "deg/s", "1,5 deg/s", "1 deg/s/3", "1 furlong", "1 deg/(s", "__import__('os')", "1 deg s s", "0x10 s", "1e5"],
)
def test_parse_refuses_nonsense_and_says_what_was_expected(text):
    with pytest.raises(ValueError, match=r"expected a quantity in rad/s, such as '1 deg/s'"):
        parse(text, "rad/s", example="1 deg/s")


# Symbols with their size in SI and their dimension (length, time, angle), by hand: the oracle of the grammar.
SYMBOLS = {
    "m": (1.0, 1, 0, 0),
    "mm": (1e-3, 1, 0, 0),
    "s": (1.0, 0, 1, 0),
    "h": (3600.0, 0, 1, 0),
    "rad": (1.0, 0, 0, 1),
    "deg": (DEG, 0, 0, 1),
}
HALVES = [i / 2 for i in range(-6, 7) if i]


def raised(unit, power):
    return (unit[0] ** power, *(d * power for d in unit[1:]))


def powers(atom):
    """Return (text, value) of an atom, or of it to a power, in each way of writing that."""
    written = st.sampled_from(["**", "^", " ^ ", ""])
    return st.one_of(
        atom,
        st.tuples(atom, st.sampled_from(HALVES), written).map(
            lambda p: (f"{p[0][0]}{p[2]}{p[1]:g}", raised(p[0][1], p[1]))
        ),
    )


def product_of(atom):
    def join(terms):
        text, value = terms[0][1]
        for sign, (other, factor) in terms[1:]:
            text, power = f"{text}{sign}{other}", -1.0 if "/" in sign else 1.0
            value = (
                value[0] * factor[0] ** power,
                *(a + power * b for a, b in zip(value[1:], factor[1:], strict=True)),
            )
        return text, value

    terms = st.tuples(st.sampled_from(["*", "/", " ", " / ", "  "]), powers(atom))
    return st.lists(terms, min_size=1, max_size=3).map(join)


def bracketed(inner):
    root = inner.map(lambda p: (f"sqrt({p[0]})", raised(p[1], 0.5)))
    return st.one_of(inner.map(lambda p: (f"({p[0]})", p[1])), root)


symbol = st.sampled_from(list(SYMBOLS)).map(lambda name: (name, SYMBOLS[name]))
flat = product_of(symbol)
one_level = product_of(st.one_of(symbol, bracketed(flat)))
two_levels = product_of(st.one_of(symbol, bracketed(one_level)))


@pytest.mark.property
@given(two_levels)
def test_parse_of_any_unit_of_the_grammar_is_its_product(unit):
    """The factor by an evaluation of its own: at most 30 factors to the power of 9/2, each off by some eps."""
    text, (size, *dimension) = unit
    assume(len(text) <= 64)
    assume(1e-200 < size < 1e200)
    si = "*".join(f"{name}^{power:g}" for name, power in zip(("m", "s", "rad"), dimension, strict=True) if power) or "1"
    assume(all(abs(power) <= 9 for power in dimension))
    if si == "1":
        return
    assert parse(f"3 {text}", si) == pytest.approx(3.0 * size, rel=1e-12)


@pytest.mark.property
@given(
    two_levels,
    st.sampled_from(
        [
            "({})**9**9",
            "{}^10",
            "{}^-9.5",
            "{}^0.3",
            "({}",
            "{})",
            "((({})))",
            "{}//s",
            "{}*",
            "{} 2",
            "{}^s",
            "{}+s",
            "{}.s",
            "{},s",
            "{}²",
        ]
    ),
)
def test_parse_refuses_a_unit_beside_the_grammar(unit, damage):
    """One level more than a text with two levels has, a power of a power, a number: refused before it is worked out."""
    text = damage.format(unit[0])
    assume(text.count("(") == 0 or damage != "((({})))" or "(" in unit[0])
    begin = time.monotonic()
    with pytest.raises(ValueError, match=r"not understood|at most 64 characters|wrong dimension"):
        parse(f"1 {text}", "kg")
    assert time.monotonic() - begin < 1.0


@pytest.mark.parametrize(
    "unit",
    ["s**9**9**9", "s" * 100_000, "(" * 30 + "s" + ")" * 30, "s " * 50_000, "s*" * 31 + "!", "(s s " * 12, "9" * 5000],
    ids=["tower", "long", "deep", "terms", "end", "open", "digits"],
)
def test_parse_refuses_a_hostile_unit_at_once_with_a_short_message(unit):
    begin = time.monotonic()
    with pytest.raises(ValueError, match="expected a quantity in s") as caught:
        parse(f"1 {unit}", "s")
    assert time.monotonic() - begin < 1.0
    assert len(str(caught.value)) < 300


@pytest.mark.parametrize("value", [10**400, -(10**5000), 2**1023 * 2], ids=["400", "5000", "first"])
def test_quantity_refuses_a_whole_number_beyond_a_float(value):
    with pytest.raises(ValidationError, match="expected a quantity in Hz"):
        Sine(frequency=value, rate=0.1)


@pytest.mark.property
@given(st.floats(min_value=-1e12, max_value=1e12, allow_subnormal=False))
def test_parse_of_a_written_si_value_returns_the_same_bits(value):
    """The resolved scenario is written in SI: reading it again gives the same run."""
    assert parse(f"{value!r} rad/s", "rad/s") == value


@pytest.mark.property
@given(st.text(max_size=30))
def test_parse_of_any_text_gives_a_finite_number_or_a_value_error(text):
    try:
        value = parse(text, "rad/s")
    except ValueError:
        return
    assert math.isfinite(value)


def test_quantity_from_python_is_si_and_from_a_file_needs_a_unit():
    assert Sine(frequency=0.5, rate=0.1).frequency == 0.5
    assert Sine.model_validate({"frequency": "0.5 Hz", "rate": "0.1 rad/s"}, context={"border": True}).rate == 0.1
    with pytest.raises(ValidationError, match="the unit is missing"):
        Sine.model_validate({"frequency": 0.5, "rate": "0.1 rad/s"}, context={"border": True})


@pytest.mark.parametrize("value", [float("nan"), float("inf"), True, None, [1.0], "1 deg"])
def test_quantity_refuses_what_is_no_finite_number(value):
    with pytest.raises(ValidationError, match="expected a quantity in Hz"):
        Sine(frequency=value, rate=0.1)


def test_quantity_bounds_are_checked_in_si():
    with pytest.raises(ValidationError, match=r"expected more than 0\.0 Hz"):
        Sine(frequency="-1 Hz", rate=0.1)


class Thermal(Part):
    """One absolute temperature and one ratio."""

    temperature: Temperature
    ratio: Ratio


@pytest.mark.parametrize("text", ["25 degC", "-40 degC", "298.15 K", "20.1 degC"])
@pytest.mark.parametrize("ratio", ["200 ppm", "0.02 %", 0.0002, "2e-4", -1, 0])
def test_temperature_and_ratio_survive_the_round_trip(text, ratio):
    part = Thermal.model_validate({"temperature": text, "ratio": ratio}, context={"border": True})
    written = part.model_dump(mode="json", context={"border": True})
    assert written["temperature"].endswith(" K")
    assert Thermal.model_validate(written, context={"border": True}) == part


def test_degrees_celsius_and_kelvin_are_the_same_bits():
    assert parse("25 degC", "K") == 298.15
    assert parse("-40 degC", "K") == 233.15


@pytest.mark.parametrize("bad", [{"temperature": 25.0}, {"temperature": "0 K"}, {"temperature": "-300 degC"}])
def test_temperature_refuses_no_unit_and_less_than_nothing(bad):
    with pytest.raises(ValidationError, match="temperature"):
        Thermal.model_validate({"ratio": 0.0, **bad}, context={"border": True})


@pytest.mark.parametrize("bad", ["1 s", "much", True, math.nan, "inf", "nan %", None])
def test_ratio_says_what_it_expects(bad):
    with pytest.raises(ValidationError, match="expected a ratio, such as '200 ppm'"):
        Thermal.model_validate({"temperature": "25 degC", "ratio": bad}, context={"border": True})
