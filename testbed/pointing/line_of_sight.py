r"""The line of sight in time: what mirror and tracker leave of it, and what each part has in that.

With the true angle :math:`\theta`, the estimated one :math:`\hat\theta`, the mirror M, its own lead and latency,

.. math:: e = S \left[\theta - M D_\tau (1 + t_{lead} s)\, \hat\theta\right] - T n

is taken apart in the order mirror, latency, knowledge: the mirror alone with its part of the lead; then the latency
with the other part; then the estimate in place of the truth. The parts add up to e sample by sample.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from testbed.pointing.command import CommandPath
from testbed.pointing.inputs import TRUTH
from testbed.pointing.tracking import Correction, LimitedCorrection

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from numpy.typing import NDArray

    from testbed.pointing.blend import Gains
    from testbed.pointing.parameters import Mirror, PointingParameters
    from testbed.signals import FloatArray

# Parts of the residual in their order; the last only where the mirror has an end.
MIRROR, LATENCY, KNOWLEDGE, TRACKER, SATURATION = "mirror", "latency", "knowledge", "tracker_noise", "saturation"


@dataclass(frozen=True)
class PointingBlock:
    """What a block leaves of the line of sight, on the base clock.

    Parameters
    ----------
    residual, knowledge, tracker_only, mirror : ndarray, shape (n_time,)
        Pointing error; error of the estimated angle as the tracker leaves it, S (theta - estimate) - T n, whatever the
        mirror; what the tracker alone would leave, S theta - T n; deflection of the mirror [rad].
    parts : mapping of str to ndarray, shape (n_time,)
        What adds up to the residual [rad]: `mirror`, `latency`, `knowledge`, `tracker_noise`, `saturation`.
    inputs : mapping of str to ndarray, shape (n_time,)
        What went into the filter, passed through integral, mirror and tracker as the knowledge is [rad].
    ends : ndarray of int, shape (n_time,)
        Where the mirror is at an end: 1 of its stroke, 2 of its rate, 0 elsewhere.
    """

    residual: FloatArray
    knowledge: FloatArray
    tracker_only: FloatArray
    mirror: FloatArray
    parts: Mapping[str, FloatArray]
    inputs: Mapping[str, FloatArray]
    ends: NDArray[np.int64]


class Fades:
    """When the tracker sees: all but its fades.

    Parameters
    ----------
    spans : sequence of (float, float)
        Begin and length of each [s].
    sample_rate_hz : float
        Base clock [Hz].
    """

    def __init__(self, spans: Sequence[tuple[float, float]], sample_rate_hz: float) -> None:
        self._spans = [(round(at * sample_rate_hz), round((at + length) * sample_rate_hz)) for at, length in spans]
        self._done = 0

    def process(self, n_time: int) -> FloatArray:
        """Return whether the tracker works over the step that ends at each of the next samples, bool."""
        index = self._done + np.arange(n_time)
        self._done += n_time
        seen = np.ones(n_time, dtype=bool)
        for start, stop in self._spans:
            seen &= (index <= start) | (index > stop)
        return seen


class LineOfSight:
    """The line of sight behind one filter.

    Parameters
    ----------
    parameters : PointingParameters
        Tracker and mirror.
    gains : Gains
        Of the tracker's correction.
    inputs : sequence of str
        Names of what goes into the filter beside the truth.
    sample_rate_hz : float
        Base clock [Hz].
    """

    def __init__(
        self, parameters: PointingParameters, gains: Gains, inputs: Sequence[str], sample_rate_hz: float
    ) -> None:
        mirror, fs = parameters.mirror, sample_rate_hz
        own, _ = mirror.lead_times
        hold = 0 if mirror.rate is None else round(fs / mirror.rate)
        self._own = CommandPath(mirror.dynamics, fs, lead=own, hold=hold)
        self._true, self._estimated = whole_path(mirror, fs), whole_path(mirror, fs)
        self._inputs = {name: whole_path(mirror, fs) for name in inputs}
        self._correction = Correction(gains, fs, 7 + len(self._inputs))
        ends = mirror.stroke, mirror.rate_limit
        stroke, rate_limit = (math.inf if end is None else end for end in ends)
        self._limited = LimitedCorrection(gains, fs, stroke, rate_limit) if any(ends) else None

    def process(
        self,
        truth: tuple[FloatArray, FloatArray],
        estimate: tuple[FloatArray, FloatArray],
        inputs: Mapping[str, tuple[FloatArray, FloatArray]],
        noise: FloatArray,
        seen: FloatArray,
    ) -> PointingBlock:
        """Take the next samples; angles [rad] and rates [rad/s] of the base clock, each of shape (n_time,).

        Parameters
        ----------
        truth, estimate : tuple of ndarray, shape (n_time,)
            Angle and rate.
        inputs : mapping of str to tuple of ndarray, shape (n_time,)
            What goes into the filter beside the truth, angle and rate.
        noise : ndarray, shape (n_time,)
            Of the tracker [rad].
        seen : ndarray of bool, shape (n_time,)
            Whether the tracker works.
        """
        angle, forward = truth[0], self._estimated.process(*estimate)
        own, true = self._own.process(*truth), self._true.process(*truth)
        passed = [path.process(*inputs[name]) for name, path in self._inputs.items()]
        chain = [angle - own, own - true, true - forward]
        alone = [angle, angle - estimate[0], noise, true]
        left = self._correction.process(np.stack([*chain, *alone, *passed]), seen)
        tracker = left[5] - noise
        parts = dict(zip((MIRROR, LATENCY, KNOWLEDGE, TRACKER), (*left[:3], tracker), strict=True))
        linear = np.sum(list(parts.values()), axis=0)
        deflection, ends = angle - linear, np.zeros(angle.size, dtype=np.int64)
        if self._limited is not None:
            deflection, ends = self._limited.process(angle, forward, noise, seen)
            parts[SATURATION] = angle - deflection - linear
        through = dict(zip((TRUTH, *self._inputs), left[6:], strict=True))
        left_alone, knowledge = left[3] + tracker, left[4] + tracker
        return PointingBlock(angle - deflection, knowledge, left_alone, deflection, parts, through, ends)


def whole_path(mirror: Mirror, sample_rate_hz: float) -> CommandPath:
    """Return the way of the command with all of its lead, latency and hold.

    Parameters
    ----------
    mirror : Mirror
        Its parameters.
    sample_rate_hz : float
        Base clock [Hz].
    """
    hold = 0 if mirror.rate is None else round(sample_rate_hz / mirror.rate)
    lead, latency = sum(mirror.lead_times), mirror.latency
    return CommandPath(mirror.dynamics, sample_rate_hz, lead=lead, latency=latency, hold=hold)
