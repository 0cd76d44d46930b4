"""Numbers as people read them."""

from __future__ import annotations

import math

DASH = "—"
_SUPERSCRIPT = str.maketrans("-0123456789", "⁻⁰¹²³⁴⁵⁶⁷⁸⁹")


def significant(value: float | None, digits: int = 3) -> str:
    """Return a number as text, trailing zeros kept; with a power of ten outside 1e-4 to 1e5.

    Parameters
    ----------
    value : float or None
        Number, any unit; None and what is not finite give a dash.
    digits : int
        Significant digits [-].
    """
    if value is None or not math.isfinite(value):
        return DASH
    if value == 0:
        return "0"
    mantissa, _, exponent = f"{value:.{digits - 1}e}".partition("e")
    power = int(exponent)
    if -4 <= power < 5:
        text = f"{value:.{max(digits - 1 - power, 0)}f}"
        return text.replace("-", "−")
    return f"{mantissa}×10{str(power).translate(_SUPERSCRIPT)}".replace("-", "−")


def decade(value: float, span: tuple[float, float]) -> str:
    """Return a mark of a logarithmic axis as text: all of an axis in digits, 0.001 to 10000, or all as 10⁻⁵, 2×10⁻⁵.

    Parameters
    ----------
    value : float
        One to nine times a power of ten, any unit.
    span : tuple of float
        Where the axis starts and ends.
    """
    if min(span) >= 1e-3 * (1.0 - 1e-9) and max(span) <= 1e4 * (1.0 + 1e-9):
        return plain(value)
    mantissa, _, power = f"{value:.0e}".partition("e")
    times = "" if mantissa == "1" else f"{mantissa}×"
    return f"{times}10{str(int(power)).translate(_SUPERSCRIPT)}"


def fixed(value: float | None, decimals: int) -> str:
    """Return `value` with `decimals` decimals; a dash for None and NaN."""
    if value is None or not math.isfinite(value):
        return DASH
    text = f"{value:.{decimals}f}"
    # What rounds to zero has no sign.
    return ("−" if float(text) < 0.0 else "") + text.removeprefix("-")


def plain(value: float) -> str:
    """Return `value` in up to six digits without trailing zeros, as for an axis or a duration."""
    return f"{value:.6g}"


def decimals_for(half_width: float) -> int:
    """Return how many decimals a number deserves whose 95 % interval has this half width: its first digit is the last
    that is shown, two where that is a 1; six at the most.

    Parameters
    ----------
    half_width : float
        Above zero, any unit.
    """
    power = math.floor(math.log10(half_width))
    leads_with_one = half_width < 2.0 * 10.0**power
    return min(max(-power + leads_with_one, 0), 6)


def bounded(value: float | None, half_width: float | None, digits: int = 4) -> str:
    """Return a number with half its 95 % interval, in the digits that this leaves.

    Parameters
    ----------
    value : float or None
        Number, any unit; None gives a dash.
    half_width : float or None
        In the same unit; where it is not known the number has `digits` significant digits.
    digits : int, optional
        See there.
    """
    if value is None or half_width is None or not math.isfinite(half_width):
        return significant(value, digits)
    if half_width < 5e-7:
        return fixed(value, 6)
    decimals = decimals_for(half_width)
    return f"{fixed(value, decimals)} ± {fixed(half_width, decimals)}"
