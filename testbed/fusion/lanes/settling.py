"""Gains of `steady_state` over a block: those of the recursion until they settle, then the settled ones."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from testbed.fusion.kernels.covariance import (
    COUNTS,
    EVERY,
    KEEPING,
    MODE,
    PRESENT,
    SETTLED,
    SETTLED_CHANGE,
    SINCE,
    STARTED,
    STEP,
    still_changing,
)

if TYPE_CHECKING:
    from testbed.fusion.filters.steady_state import SteadyState
    from testbed.signals import FloatArray


class SettlingGains:
    """Gains, variances and covariance over a block, from a `SteadyState` at its beginning.

    They are not usable where it keeps the gains of a cycle, misses a sensor, or might recall the rate: such a block is
    for its own kernel.

    Parameters
    ----------
    one : SteadyState
        That filter.
    due : ndarray of bool, shape (n_sensor, n_time)
        Which readings there are.
    kernel : callable
        Of `gains_kernel`.
    """

    def __init__(self, one: SteadyState, due: Any, kernel: Any) -> None:
        n_sensor, n_time = due.shape
        self.due, self._past, self.started = due, _past(one), one._progress[STARTED] > 0
        self._P, self._progress, self._settling = one._P.copy(), one._progress.copy(), one._cycle[-1].copy()
        self.usable = bool(
            one._progress[MODE] != KEEPING
            and one._progress[PRESENT] == len(one._Q) - 1
            and not one._progress[COUNTS:].any()
            and due.any(axis=0).all()
        )
        if not self.usable:
            return
        steps = (one._progress[STEP] + np.arange(n_time)) % len(one._cycle[0])
        if one._progress[MODE] == SETTLED:
            gains, variance, P, _ = one._cycle
            self.gains, self.variance = np.moveaxis(gains, 2, 1)[steps], np.where(due.T, variance[steps], np.nan)
            self.std = np.sqrt(P[steps, 0, 0])
            self._last = P[steps[-1], 0, 0]
        else:
            self.gains, self.std = np.empty((n_time, n_sensor, len(one._x))), np.empty(n_time)
            self.variance = np.full((n_time, n_sensor), np.nan)
            model, out = (one.model.F, one._Q[-1], one.model.H, one.model.R), (self.gains, self.variance, self.std)
            widest = kernel(self._P, *model, due, self.started, *out)
            self._last = self._P[0, 0]
            self.usable = bool(widest <= one._last[2]) and self._go_on(steps)
        self.shown = self.variance.T.copy()
        self._progress[STARTED], self._progress[STEP] = 1, (steps[-1] + 1) % len(one._cycle[0])

    def _go_on(self, steps: np.ndarray) -> bool:
        """Look at the gains when the filter would; return whether they go on changing."""
        since, every = int(self._progress[SINCE]), int(self._progress[EVERY])
        n, n_sensor = self._settling.shape
        begin = 0
        for k in np.flatnonzero(steps == 0):
            if since + k + 1 - begin > every:
                now = np.where(self.due[:, k], self.gains[k].T, 0.0)
                if not still_changing(now, self._settling, SETTLED_CHANGE, n, n_sensor):
                    return False
                since, begin = 0, int(k) + 1
        self._progress[SINCE] = since + steps.size - begin
        return True

    def hold(self, one: SteadyState) -> bool:
        """Return whether they are those of another filter too."""
        return all(map(np.array_equal, _past(one), self._past))

    def leave(self, one: SteadyState, x: FloatArray) -> None:
        """Leave a filter at the end of the block, in the state `x`."""
        one._x[:], one._P[:], one._progress[:] = x, self._P, self._progress
        one._cycle[-1][:], one._last[:2] = self._settling, (x[0], self._last)


def _past(one: SteadyState) -> tuple[FloatArray, ...]:
    """Return copies of what the gains to come depend on."""
    return one._P.copy(), one._progress.copy(), *(part.copy() for part in one._cycle), one._last[2:].copy()
