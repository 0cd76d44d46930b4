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


def decade(value: float) -> str:
    """Return a power of ten as text, such as 10⁻³; the digits outside 1e-2 to 1e2 only, and nothing for other numbers.

    Parameters
    ----------
    value : float
        Number on a logarithmic axis, any unit.
    """
    power = round(math.log10(value))
    if abs(value / 10.0**power - 1.0) > 1e-9:
        return ""
    return plain(value) if abs(power) <= 2 else f"10{str(power).translate(_SUPERSCRIPT)}"


def fixed(value: float | None, decimals: int) -> str:
    """Return `value` with `decimals` decimals; a dash for None and NaN."""
    if value is None or not math.isfinite(value):
        return DASH
    return f"{value:.{decimals}f}".replace("-", "−")


def plain(value: float) -> str:
    """Return `value` in up to six digits without trailing zeros, as for an axis or a duration."""
    return f"{value:.6g}"
