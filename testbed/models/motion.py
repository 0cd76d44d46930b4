"""Commanded motion: a sum of terms with a smooth ramp-in, delivered in blocks of the base clock."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, ClassVar

import numpy as np

from testbed.errors import RunError
from testbed.inputs.plugins import PluginError, running
from testbed.parts import Part
from testbed.signals import FloatArray, sample_times

if TYPE_CHECKING:
    from collections.abc import Sequence
    from pathlib import Path
    from typing import Self

RateFunction = Callable[[FloatArray], FloatArray]


class Motion(Part):
    """One term of the commanded motion.

    `example` is how a scenario may write it: the schema offers it, and the contract tests run on it. A term is
    `lasting` if its parameters say all of it: no file may change what it plays.
    """

    example: ClassVar[dict[str, Any]] = {}
    lasting: ClassVar[bool] = True

    def start(self, duration: float, rng: np.random.Generator) -> RateFunction:
        """Return the commanded rate [rad/s] as a pure function of time [s], shape (n_time,) -> (n_time,).

        Parameters
        ----------
        duration : float
            Length of the run [s].
        rng : numpy.random.Generator
            For terms that are realisations of a random process.
        """
        raise NotImplementedError

    def kept_in(self, folder: Path, name: str) -> Self:
        """Return the term with the file that it reads, if it reads one, copied to `folder`.

        Parameters
        ----------
        folder : Path
            Where to.
        name : str
            Of the copy, without its ending.
        """
        return self

    @property
    def draws(self) -> bool:
        """Whether `start` uses its generator: another seed is another motion then."""
        return True

    def lines(self) -> tuple[float, ...]:
        """Return the frequencies [Hz] at which gain and phase are reported; empty for motions without lines."""
        return ()

    def top_frequency(self) -> float:
        """Return the highest frequency [Hz] that the term contains."""
        raise NotImplementedError

    def n_term(self) -> int:
        """Return how many sines cost as much time as the rate."""
        return max(len(self.lines()), 1)


@dataclass(frozen=True)
class CommandBlock:
    """Commanded motion over `n_time` steps of the base clock.

    Parameters
    ----------
    start : int
        Index k of the first step; t_k = k / sample_rate.
    rate, angle : ndarray, shape (n_time + 1,)
        Commanded rate [rad/s] and its integral [rad] at t_start ... t_(start + n_time): one more than the steps, so
        that the change over the last step is known.
    rate_mid, angle_mid : ndarray, shape (n_time,)
        The same at mid-step.
    """

    start: int
    rate: FloatArray
    angle: FloatArray
    rate_mid: FloatArray
    angle_mid: FloatArray

    @property
    def n_time(self) -> int:
        """Number of steps."""
        return int(self.rate_mid.size)


def ramp(t: FloatArray, length: float) -> FloatArray:
    r"""Return the ramp-in factor 10 x^3 - 15 x^4 + 6 x^5, x = t / length held to [0, 1].

    Rate, acceleration and jerk start from zero, so that the table is not kicked.

    Parameters
    ----------
    t : ndarray, shape (n_time,)
        Time [s].
    length : float
        Length of the ramp [s]; 0 for none.

    Returns
    -------
    ndarray, shape (n_time,)
        Factor [-], 0 ... 1.
    """
    if length == 0.0:
        return np.ones_like(t)
    x = np.clip(t / length, 0.0, 1.0)
    factor: FloatArray = x**3 * (10.0 + x * (6.0 * x - 15.0))
    return factor


def watched(kind: str, motion: Motion, duration: float, rng: np.random.Generator) -> RateFunction:
    """Start a motion of a plug-in and return its rate, which is checked whenever it is asked for.

    Parameters
    ----------
    kind : str
        Name of the motion, for messages.
    motion : Motion
        To start.
    duration : float
        Length of the run [s].
    rng : numpy.random.Generator
        For the motion.

    Raises
    ------
    RunError
        If the motion raises anything; the returned function does too, and if a rate is not finite or has not one value
        per time.
    """

    def rate(t: FloatArray) -> FloatArray:
        value = np.asarray(_foreign(kind, lambda: term(t.copy())))
        if value.shape != t.shape or value.dtype.kind != "f" or not np.isfinite(value).all():
            msg = f"motion {kind}: expected finite rates of shape {t.shape}, got {value.dtype} of shape {value.shape}"
            raise RunError(msg)
        return value

    term = _foreign(kind, lambda: motion.start(duration, rng))
    return rate


def _foreign(kind: str, call: Callable[[], Any]) -> Any:
    try:
        with running(f"motion {kind}"):
            return call()
    except PluginError as error:
        raise RunError(str(error)) from error


class MotionProfile:
    """The commanded motion of a run, block by block.

    The angle is the integral of the rate from t = 0, by Simpson's rule over each step and its midpoint; the sum is
    carried from block to block in the same order, so that any division into blocks gives the same bits.

    Parameters
    ----------
    terms : sequence of callable
        Rates [rad/s] as functions of time [s].
    ramp_in : float
        Length of the ramp-in [s].
    sample_rate_hz : float
        Base clock [Hz].
    """

    def __init__(self, terms: Sequence[RateFunction], ramp_in: float, sample_rate_hz: float) -> None:
        self._terms = tuple(terms)
        self._ramp_in = ramp_in
        self._sample_rate_hz = sample_rate_hz
        self._start = 0
        self._angle = 0.0

    def rate(self, t: FloatArray) -> FloatArray:
        """Return the commanded rate [rad/s] at the times `t` [s], shape (n_time,)."""
        total = np.zeros_like(t)
        for term in self._terms:
            total += term(t)
        total *= ramp(t, self._ramp_in)
        return total

    def process(self, n_time: int) -> CommandBlock:
        """Return the next `n_time` steps."""
        block = self._block(self._start, n_time, self._angle)
        self._start += n_time
        self._angle = float(block.angle[-1])
        return block

    def peek(self, n_time: int, start: int | None = None) -> CommandBlock:
        """Return the next `n_time` steps, or those from `start` on with angles from zero, and stay before them."""
        return self._block(self._start, n_time, self._angle) if start is None else self._block(start, n_time, 0.0)

    def _block(self, start: int, n_time: int, angle_before: float) -> CommandBlock:
        h = 1.0 / self._sample_rate_hz
        half_steps = self.rate(sample_times(2 * start, 2 * n_time + 1, 2.0 * self._sample_rate_hz))
        w0, wm, w1 = half_steps[:-1:2], half_steps[1::2], half_steps[2::2]
        angle = np.cumsum(np.concatenate([[angle_before], (w0 + 4.0 * wm + w1) * (h / 6.0)]))
        return CommandBlock(
            start=start,
            rate=half_steps[::2].copy(),
            angle=angle,
            rate_mid=wm.copy(),
            angle_mid=angle[:-1] + (5.0 * w0 + 8.0 * wm - w1) * (h / 24.0),
        )
