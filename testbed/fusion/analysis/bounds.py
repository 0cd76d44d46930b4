r"""What no causal linear filter of a signal gets below under the whole noise of exactly known sensors: no simulation.

The candidates are Kalman filters of the augmented model with the slow noise as states (`testbed.fusion.coloured`), over
the order m and the density q of the signal model. Each error has two parts, for a truth that is not random but made of
lines: what the noise leaves, and what the filter lags behind a line.

The covariance of a Kalman filter counts a random signal of density q that is not there. Its gains are least for that
very covariance, so that its derivative by q is what the signal alone adds (the change of the gains adds nothing to
first order): the noise leaves

.. math:: \sigma^2(t) = P_{11}(t) - \partial P_{11}(t) / \partial \ln q,

at any time after the start, by doubling the map of a period of the readings.
"""

from __future__ import annotations

import functools
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from testbed.fusion.analysis.optimum import DECADES, CycleMap, FixedFilters, FixedGains, filters_from, period_map
from testbed.fusion.model import build_model

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping, Sequence

    from testbed.fusion.belief import SensorBelief
    from testbed.fusion.start import StartKind
    from testbed.signals import ComplexArray, FloatArray

Lines = tuple[tuple[float, float], ...]

_ORDERS = (1, 2, 3)
# Of the derivative by ln q: its error is (h s)^2 / 6 of a part that falls as q^s, s <= 1/2, so 4e-4.
_HALF_STEP = 0.1
# The decades of q are refined to quarters around the best.
_QUARTERS = 10.0 ** (np.array([-3.0, -2.0, -1.0, 1.0, 2.0, 3.0]) / 4.0)
# Times at which the window of a run is sampled (Gauss-Legendre): covariances change slowly behind the start.
_TIMES = 4
# 2^36 periods are past any time constant, at 2 kHz a year.
_DOUBLINGS = 36


@dataclass(frozen=True)
class SignalBound:
    """The least error of a causal filter.

    Parameters
    ----------
    rmse, noise, lag : float
        Error and its two parts, rmse^2 = noise^2 + lag^2 [rad/s].
    order : int
        Order m of the signal model of the best filter.
    q : float
        Its signal noise [rad^2/s^(2m+1)].
    """

    rmse: float
    noise: float
    lag: float
    order: int
    q: float


def never_settles(belief: Mapping[str, SensorBelief]) -> str:
    """Return why no filter settles, "" if one does: a rate that walks at random is told from a walk of its sensor by
    nothing.

    Parameters
    ----------
    belief : mapping of str to SensorBelief
        Exact sensors.
    """
    walks = [name for name, one in belief.items() if one.walks]
    return f"the random walk of {', '.join(walks)} grows without end" if walks else ""


def settled_bounds(
    belief: Mapping[str, SensorBelief],
    sample_rate_hz: Mapping[str, float],
    signals: Sequence[Sequence[tuple[float, float]]],
) -> list[SignalBound]:
    """Return the bound of each signal after all time constants, those of the slow noise (hours) too.

    Parameters
    ----------
    belief : mapping of str to SensorBelief
        What the sensors are.
    sample_rate_hz : mapping of str to float
        Rate of each sensor [Hz].
    signals : sequence of sequence of (float, float)
        Lines of each signal: frequency [Hz] and amplitude [rad/s].

    Raises
    ------
    ValueError
        As for `build_model`, or if a sensor has no output noise.
    """
    return _cached(tuple(belief.items()), tuple(sample_rate_hz.items()), _fixed(signals), "unknown", None)


def run_bounds(
    belief: Mapping[str, SensorBelief],
    sample_rate_hz: Mapping[str, float],
    signals: Sequence[Sequence[tuple[float, float]]],
    *,
    start: StartKind,
    window: tuple[float, float],
) -> list[SignalBound]:
    """Return the bound of each signal over a window of a run, from what is known of its start.

    The lag is that of the lines once their own beginning is forgotten, within seconds.

    Parameters
    ----------
    belief, sample_rate_hz, signals : mapping, mapping, sequence
        As for `settled_bounds`.
    start : {"unknown", "rest"}
        What the filter knows at t = 0 (`testbed.fusion.start`).
    window : tuple of float
        Begin and end [s].

    Raises
    ------
    ValueError
        As for `settled_bounds`.
    """
    return _cached(tuple(belief.items()), tuple(sample_rate_hz.items()), _fixed(signals), start, window)


def _fixed(signals: Sequence[Sequence[tuple[float, float]]]) -> tuple[Lines, ...]:
    return tuple(tuple((float(f), float(a)) for f, a in lines) for lines in signals)


@functools.lru_cache(maxsize=64)
def _cached(
    belief: tuple[tuple[str, SensorBelief], ...],
    sample_rate_hz: tuple[tuple[str, float], ...],
    signals: tuple[Lines, ...],
    start: StartKind,
    window: tuple[float, float] | None,
) -> list[SignalBound]:
    search = _Search(belief, sample_rate_hz, signals, start, window)
    coarse = [
        search.best(order, np.logspace(*DECADES[order], DECADES[order][1] - DECADES[order][0] + 1)) for order in _ORDERS
    ]
    best = [min(found, key=lambda one: one.rmse) for found in zip(*coarse, strict=True)]
    for order in _ORDERS:
        # Refined candidates of a lower order may have taken all that this one had.
        of_order = [one.q * _QUARTERS for one in best if one.order == order]
        if not of_order:
            continue
        near = np.unique(np.concatenate(of_order))
        best = [min(pair, key=lambda one: one.rmse) for pair in zip(best, search.best(order, near), strict=True)]
    return best


class _Search:
    """The errors of candidates for several signals at once."""

    def __init__(
        self,
        belief: tuple[tuple[str, SensorBelief], ...],
        sample_rate_hz: tuple[tuple[str, float], ...],
        signals: tuple[Lines, ...],
        start: StartKind,
        window: tuple[float, float] | None,
    ) -> None:
        self._filters = functools.partial(_candidates, belief, sample_rate_hz, start, window)
        self._freq = np.array([freq for lines in signals for freq, _ in lines])
        self._power = np.array([0.5 * amplitude**2 for lines in signals for _, amplitude in lines])
        self._of_signal = np.repeat(np.eye(len(signals)), [len(lines) for lines in signals], axis=0)
        known = dict(belief)
        self._truth: ComplexArray = np.array(
            [known[name].realisation().response(self._freq) for name, _ in sample_rate_hz]
        )

    def best(self, order: int, q: FloatArray) -> list[SignalBound]:
        """Return the best of the candidates of one order, signal by signal."""
        noise, times = self._filters(order, tuple(q.tolist()))
        lag = np.zeros((q.size, self._of_signal.shape[1]))
        for weight, filters in times:
            error = filters.line_error(self._freq, self._truth) ** 2 * self._power @ self._of_signal
            lag += weight * 0.5 * (error[: q.size] + error[q.size :])
        at = np.argmin(noise[:, None] + lag, axis=0)
        return [_bound(noise[i], lag[i, k], order, q[i]) for k, i in enumerate(at)]


# The signal has no part in them, so that the cases of a campaign share them: half a megabyte each.
@functools.lru_cache(maxsize=16)
def _candidates(
    belief: tuple[tuple[str, SensorBelief], ...],
    sample_rate_hz: tuple[tuple[str, float], ...],
    start: StartKind,
    window: tuple[float, float] | None,
    order: int,
    q: tuple[float, ...],
) -> tuple[FloatArray, list[tuple[float, FixedGains]]]:
    """Return what the sensors' noise leaves of each candidate [rad^2/s^2], and weights and gains of the window."""
    noise, times = np.zeros(len(q)), list[tuple[float, FixedGains]]()
    for weight, filters in _times(dict(belief), dict(sample_rate_hz), start, window, order, np.array(q)):
        low, high = np.split(filters.posterior()[:, :, 0, 0].mean(axis=0), 2)
        noise += weight * (0.5 * (low + high) - (high - low) / (2.0 * _HALF_STEP))
        times.append((weight, FixedGains(filters.model, filters.K)))
    # Where the start's covariance swamps what is left of it, rounding may leave less than nothing: no candidate.
    return np.where(noise > 0.0, noise, np.inf), times


def _times(
    belief: dict[str, SensorBelief],
    sample_rate_hz: dict[str, float],
    start: StartKind,
    window: tuple[float, float] | None,
    order: int,
    q: FloatArray,
) -> Iterator[tuple[float, FixedFilters]]:
    """Yield weights and filters, half a step of ln q below each q and half a step above."""
    pairs = np.concatenate([q * np.exp(-_HALF_STEP), q * np.exp(_HALF_STEP)])
    model = build_model(belief, sample_rate_hz, order=order, q=0.0, coloured=True, start=start)
    unit = build_model(belief, sample_rate_hz, order=order, q=1.0, coloured=True, start=start)
    Q = model.Q + pairs[:, None, None] * (unit.Q - model.Q)
    period = period_map(model, Q)
    if window is None:
        for _ in range(_DOUBLINGS):
            period = period.then(period)
        yield 1.0, filters_from(model, pairs, Q, period.applied(model.P0))
        return
    begin, end = window
    nodes, weights = np.polynomial.legendre.leggauss(_TIMES)
    times = begin + 0.5 * (nodes + 1.0) * (end - begin)
    counts = np.maximum(np.rint(times * model.sample_rate_hz / model.cycle), 0).astype(int).tolist()
    for weight, P in zip(0.5 * weights, _after_periods(period, model.P0, counts), strict=True):
        yield float(weight), filters_from(model, pairs, Q, P)


def _after_periods(period: CycleMap, P0: FloatArray, counts: Sequence[int]) -> Iterator[FloatArray]:
    """Yield the covariance after each number of periods, from `P0`; the powers of two of the map are shared."""
    found = [np.broadcast_to(P0, period.Q.shape) for _ in counts]
    for bit in range(int(max(counts)).bit_length()):
        for k, count in enumerate(counts):
            if count >> bit & 1:
                found[k] = period.applied(found[k])
        period = period.then(period)
    yield from found


def _bound(noise: float, lag: float, order: int, q: float) -> SignalBound:
    return SignalBound(float(np.sqrt(noise + lag)), float(np.sqrt(noise)), float(np.sqrt(lag)), order, float(q))
