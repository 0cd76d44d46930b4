"""Two searches of a box for the least value: the grey wolves of paper 3, and scipy's differential evolution with a
simplex behind it.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from scipy.optimize import Bounds, differential_evolution, minimize

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from testbed.signals import FloatArray

    Objective = Callable[[FloatArray], float]
    Box = Sequence[tuple[float, float]]

# Points of evolution per coordinate, its generations after the first, and evaluations for the simplex behind it.
_POPULATION, _GENERATIONS, _SIMPLEX = 8, 6, 60


@dataclass(frozen=True)
class Best:
    """What a search found.

    Parameters
    ----------
    point : ndarray, shape (n_dim,)
        Best point.
    value : float
        Objective there.
    evaluations : int
        Times that the objective was asked.
    """

    point: FloatArray
    value: float
    evaluations: int


class _Counted:
    """The objective on the box in the coordinates of the search; counts, and remembers the best."""

    def __init__(self, objective: Objective, bounds: Box, *, log: bool) -> None:
        box = np.array(bounds, dtype=np.float64)
        if box.ndim != 2 or box.shape[1] != 2 or not np.all(box[:, 0] < box[:, 1]) or not np.isfinite(box).all():
            msg = f"bounds: expected pairs of finite numbers, lower before upper, got {bounds}"
            raise ValueError(msg)
        if log and box.min() <= 0.0:
            msg = f"bounds: expected positive numbers for a logarithmic search, got {bounds}"
            raise ValueError(msg)
        self._objective, self._log = objective, log
        self.low, self.high = (np.log10(box) if log else box).T
        self.best = Best(np.full(len(box), np.nan), np.inf, 0)

    def __call__(self, at: FloatArray) -> float:
        point = 10.0**at if self._log else np.array(at)
        value = float(self._objective(point))
        better = value < self.best.value
        self.best = Best(point if better else self.best.point, min(value, self.best.value), self.best.evaluations + 1)
        return value


def grey_wolf(
    objective: Objective,
    bounds: Box,
    *,
    wolves: int = 50,
    iterations: int = 20,
    seed: int = 0,
    log: bool = False,
) -> Best:
    r"""Minimise by grey wolves: each goes to the mean of three points around the three best.

    .. math:: X \leftarrow \frac13 \sum_{l \in \alpha\beta\delta} (X_l - A_l |C_l X_l - X|), \quad
        A = a (2 r_1 - 1),\; C = 2 r_2,\; a = 2 (1 - i / n)

    Parameters
    ----------
    objective : callable
        Of a point, ndarray of shape (n_dim,), to a float.
    bounds : sequence of (float, float)
        Of each coordinate; wolves that leave the box are put on its border.
    wolves, iterations : int
        50 and 20 in paper 3; wolves x iterations evaluations.
    seed : int
        Of the random numbers.
    log : bool
        Search in the logarithm of the coordinates.

    Returns
    -------
    Best
        Best point seen.

    Raises
    ------
    ValueError
        If the bounds are no box.

    References
    ----------
    Mirjalili, Mirjalili, Lewis, "Grey wolf optimizer", Adv. Eng. Softw. 69 (2014).
    """
    box, rng = _Counted(objective, bounds, log=log), np.random.default_rng(seed)
    pack = rng.uniform(box.low, box.high, (wolves, box.low.size))
    leaders, values = pack[:0], np.empty(0)
    for i in range(iterations):
        found = np.array([box(wolf) for wolf in pack])
        candidates, known = np.concatenate([leaders, pack]), np.concatenate([values, found])
        order = np.argsort(known, kind="stable")[:3]
        leaders, values = candidates[order], known[order]
        A = 2.0 * (1.0 - i / iterations) * rng.uniform(-1.0, 1.0, (wolves, len(leaders), box.low.size))
        C = rng.uniform(0.0, 2.0, A.shape)
        pack = np.clip((leaders - A * np.abs(C * leaders - pack[:, None])).mean(axis=1), box.low, box.high)
    return box.best


def evolve(objective: Objective, bounds: Box, *, seed: int = 0, log: bool = False) -> Best:
    """Minimise by differential evolution (8 points per coordinate, 6 generations after the first), then by Nelder and
    Mead's simplex of at most 60 evaluations from its best point.

    Parameters
    ----------
    objective : callable
        Of a point, ndarray of shape (n_dim,), to a float.
    bounds : sequence of (float, float)
        Of each coordinate.
    seed : int
        Of the random numbers.
    log : bool
        Search in the logarithm of the coordinates.

    Returns
    -------
    Best
        Best point seen.

    Raises
    ------
    ValueError
        If the bounds are no box.

    References
    ----------
    Storn and Price, J. Global Optim. 11 (1997); Nelder and Mead, Comput. J. 7 (1965); both as in scipy.
    """
    box = _Counted(objective, bounds, log=log)
    limits = Bounds(box.low, box.high)
    found = differential_evolution(
        box, limits, popsize=_POPULATION, maxiter=_GENERATIONS, tol=0.0, polish=False, rng=np.random.default_rng(seed)
    )
    # In logarithms a hundredth is 2 %, far below what a cross-validation can tell.
    minimize(
        box, found.x, method="Nelder-Mead", bounds=limits, options={"maxfev": _SIMPLEX, "xatol": 0.01, "fatol": 0.0}
    )
    return box.best
