"""Everything that comparing a sensor with a cleaner one says of the two."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from testbed.fusion.analysis.agreement import Agreement, Pair
from testbed.fusion.analysis.continuity import repeated
from testbed.fusion.analysis.contradictions import (
    Names,
    axis_finding,
    bias_findings,
    gain_findings,
    shape_findings,
    sign_findings,
    time_findings,
    undecided_of,
    unit_factors,
    unit_findings,
)
from testbed.fusion.analysis.floor import NoiseRatio, loudness_findings, noise_beside

if TYPE_CHECKING:
    from testbed.fusion.analysis.finding import Finding
    from testbed.fusion.analysis.paths import Trace
    from testbed.signals import FloatArray

# What two sensors must have in common [s], and how many readings of the slower one.
_LEAST_SECONDS, _LEAST_READINGS = 2.0, 200
# From this share of a sensor's motion on that is its own, what little it has of the other one's is no common motion.
_OWN = 0.8


@dataclass(frozen=True)
class Compared:
    """A sensor beside a cleaner one.

    Parameters
    ----------
    names : Names
        What the findings are said of.
    pair : Pair
        The two.
    found : Agreement
        What makes them agree.
    path : ndarray, shape (n_time,)
        The noisy path with its stamps put right [rad/s].
    noise, clean_noise : NoiseRatio or None
        Of either, over its belief.
    apart : bool
        They do not show the same motion.
    """

    names: Names
    pair: Pair
    found: Agreement
    path: FloatArray
    noise: NoiseRatio | None
    clean_noise: NoiseRatio | None
    apart: bool

    @property
    def factors(self) -> dict[str, float]:
        """By what each sensor's readings are too large, because of their unit [-]."""
        gain = abs(self.found.gain) if self.found.common else None
        noisy, clean = unit_factors(gain, self.noise, self.clean_noise, (self.pair.noisy.said, self.pair.clean.said))
        return {self.names.noisy: noisy, self.names.clean: clean}

    @property
    def findings(self) -> list[Finding]:
        """What the two contradict each other in, and the noisy one its belief."""
        names, found = self.names, self.found
        if self.apart:
            # What is the noise of each, and what its own motion, nothing tells.
            return [axis_finding(found, names)]
        factors = self.factors
        shape = list(shape_findings(self.pair, found, self.noise, names))
        units = {names.noisy: self.pair.noisy.said, names.clean: self.pair.clean.said}
        said = [*unit_findings(factors, found, units), *shape]
        # What the response is believed to be decides over gain and offset.
        sure = all(one.kind != "bandwidth" for one in shape)
        if found.common:
            unit = factors[names.noisy] / factors[names.clean]
            said += sign_findings(found, names, unit)
            said += gain_findings(found, names, unit) if sure else ()
            said += time_findings(found, names, offset=sure)
        if not shape:
            said += loudness_findings(names.noisy, self.noise, factors[names.noisy])
        return [*said, *bias_findings(self.pair, found, self.path, names, factors)]

    @property
    def undecided(self) -> list[str]:
        """What these two cannot decide in this record."""
        kinds = {finding.kind for finding in self.findings}
        return list(undecided_of(self.pair, self.found, kinds, self.names))


def compared(noisy: tuple[str, Trace], clean: tuple[str, Trace], clean_noise: NoiseRatio | None) -> Compared | str:
    """Return a sensor beside a cleaner one, or why they cannot be compared.

    Parameters
    ----------
    noisy, clean : tuple of str and Trace
        The sensors with their names.
    clean_noise : NoiseRatio or None
        Of the clean one, over its belief.
    """
    names = Names(
        noisy[0],
        clean[0],
        timed=noisy[1].interval >= clean[1].interval,
        scaled=clean[1].belief.sees_constant or not noisy[1].belief.sees_constant,
    )
    both = f"{noisy[0]} and {clean[0]}: sign, unit, gain, offset and rate:"
    one, other = (without_repeats(trace) for trace in (noisy[1], clean[1]))
    common = min(one.t[-1], other.t[-1]) - max(one.t[0], other.t[0])
    if common < max(_LEAST_SECONDS, _LEAST_READINGS * max(one.interval, other.interval)):
        return f"{both} they have {max(common, 0.0):.3g} s in common"
    if any(trace.reading_noise(np.array([10.0]))[0] == 0.0 for trace in (one, other)):
        return f"{both} without a believed noise nothing is significant"
    pair = Pair(one, other)
    if not pair.grid.weight(one, other).any():
        return f"{both} there is no stretch in which both have readings"
    if np.ptp(pair.c) == 0.0 or np.ptp(pair.path(one)) == 0.0:
        return f"{both} one of them always reads the same"
    found = pair.agreement()
    path = pair.path(pair.put_right(found.offset, found.rate, found.middle) if found.common else one)
    apart = found.own > _OWN if found.common else _are_apart(found)
    return Compared(names, pair, found, path, noise_beside(pair, path), clean_noise, apart)


def _are_apart(found: Agreement) -> bool:
    """Return whether one of two sensors does not show what moved the other one."""
    (noisy_moved, clean_moved), (noisy_misses, clean_misses) = found.moved, found.misses
    return (clean_moved and noisy_misses) or (noisy_moved and clean_misses)


def without_repeats(trace: Trace) -> Trace:
    """Return a trace with what filters take off it: its believed bias, and readings that are stuck or at the end of the
    range, which repeat themselves.
    """
    return replace(trace, z=np.where(repeated(trace), math.nan, trace.z - trace.belief.bias))
