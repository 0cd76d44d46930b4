"""Why a record identifies nothing, in words."""

from __future__ import annotations

from typing import TYPE_CHECKING

from testbed.logs.options import refusal
from testbed.metrics.lines import spectral_lines

if TYPE_CHECKING:
    from testbed.errors import ScenarioError
    from testbed.identification.response import Measured
    from testbed.logs.channel import LogChannel

# Lines of an output are looked up among those of the reference within this share of their frequency: clocks differ.
_NEAR = 0.01


def refusal_of(reference: LogChannel, output: LogChannel, found: Measured | str) -> ScenarioError:
    """Return the error for an output of which nothing can be said.

    Parameters
    ----------
    reference, output : LogChannel
        The channels.
    found : Measured or str
        What was found, or why nothing was.
    """
    path = output.table.path
    if isinstance(found, str):
        return refusal(path, found, output.name)
    if found.response.freq_hz.size:
        message = (
            f"{reference.name} passes each frequency once, so that the clock of {output.name} cannot be told from its "
            "phase; sweep there and back, or say --one-clock if one clock sampled both"
        )
        return refusal(path, message, output.name)
    said = [f"nothing of {output.name} follows {reference.name}"]
    if found.mains:
        lines = _listed(list(found.mains))
        said.append(f"both have {lines}, the mains' frequency, which may be hum in both cables: excite beside it")
    if found.unfollowed:
        said.append(f"{reference.name} has {_listed(list(found.unfollowed))}, of which {output.name} has nothing")
    own = _own_lines(reference, output)
    if own:
        said.append(f"{output.name} has {_listed(own)}, of which {reference.name} has nothing: no excitation")
    if len(said) == 1:
        said.append("both are noise to each other: check that the channels are those, or excite more")
    return refusal(path, "; ".join(said), output.name)


def _own_lines(reference: LogChannel, output: LogChannel) -> list[float]:
    lines = [
        [line.frequency_hz for line in spectral_lines(one.rate().even(), one.rate_hz)] for one in (reference, output)
    ]
    return [freq for freq in lines[1] if all(abs(freq - other) > _NEAR * freq for other in lines[0])]


def _listed(freq_hz: list[float]) -> str:
    """Return frequencies for a reader, at most five."""
    shown = ", ".join(f"{freq:.5g}" for freq in sorted(freq_hz)[:5])
    more = f" and {len(freq_hz) - 5} more" if len(freq_hz) > 5 else ""
    return f"{'a line' if len(freq_hz) == 1 else 'lines'} at {shown} Hz{more}"
