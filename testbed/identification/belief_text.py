"""The belief file that `testbed identify` writes."""

from __future__ import annotations

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from collections.abc import Sequence

    from testbed.identification.session import Identification

_UNITS = {
    "delay": "s",
    "bias": "rad/s",
    "input_noise": "rad/s/sqrt(Hz)",
    "output_noise": "rad/s/sqrt(Hz)",
    "noise_knee": "Hz",
    "bias_instability": "rad/s",
    "range": "rad/s",
    "resolution": "rad/s",
}


def belief_text(found: Sequence[Identification], source: str) -> str:
    """Return the text of a belief file, with what each value is known to.

    Parameters
    ----------
    found : sequence of Identification
        The sensors.
    source : str
        What it is from, for the reader.
    """
    lines = [f"# Identified from {source}; s in rad/s, highest power first; densities are two-sided."]
    for one in found:
        freq = one.measured.response.freq_hz
        lines.append(
            f"{one.name}:  # {freq.size} frequencies from {freq[0]:.4g} to {freq[-1]:.4g} Hz; fit and points differ by "
            f"at most {100.0 * one.model.worst:.2g} %"
        )
        lines += [
            f"  {key}: [{', '.join(repr(value) for value in getattr(one.belief, key))}]"
            for key in ("numerator", "denominator")
        ]
        lines += [
            f"  {key}: {value!r} {unit}{_comment(one, key)}"
            for key, unit in _UNITS.items()
            if (value := getattr(one.belief, key)) or key == "output_noise"
        ]
    return "\n".join(lines) + "\n"


def _comment(one: Identification, key: str) -> str:
    if key == "delay":
        limit = f"the filters know it up to {one.belief.delay_holds_to:.3g} Hz"
        low, high = (1e6 * end for end in one.model.delay_span)
        return f"  # {low:.4g} to {high:.4g} us; {limit}"
    if key in ("noise_knee", "bias_instability"):
        return "  # 1/f as far as the record shows it"
    return ""
