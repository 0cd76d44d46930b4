"""Modes sorted into noise, mixed and drift: by entropy as in the paper, or by period as physics has it."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Literal

import numpy as np

from testbed.compensation.entropy import multiscale_permutation_entropy, multiscale_sample_entropy
from testbed.errors import quoted

if TYPE_CHECKING:
    from collections.abc import Callable

    from testbed.signals import FloatArray

Method = Literal["period", "sample_entropy", "permutation_entropy"]


@dataclass(frozen=True)
class ModeGroups:
    """Rows of a decomposition by group, fastest first; together they are all rows, and the residual is drift.

    Parameters
    ----------
    noise, mixed, drift : range
        Row indices; noise and mixed may be empty.
    """

    noise: range
    mixed: range
    drift: range


def mean_period(mode: FloatArray, sample_rate_hz: float) -> float:
    """Return the mean period by zero crossings: twice the length of the record over their number.

    Parameters
    ----------
    mode : ndarray, shape (n_time,)
        Samples, any unit; zero counts as positive.
    sample_rate_hz : float
        Rate of the samples [Hz].

    Returns
    -------
    float
        Mean period [s]; infinite without a crossing.
    """
    crossings = np.count_nonzero(np.diff(np.signbit(mode)))
    return 2.0 * (mode.size - 1) / (sample_rate_hz * crossings) if crossings else np.inf


def group_modes(
    modes: FloatArray,
    sample_rate_hz: float,
    *,
    method: Method = "period",
    periods: tuple[float, float] = (21.0, 900.0),
    scale: int = 55,
    threshold: float = 0.5,
) -> ModeGroups:
    """Sort the rows of a decomposition into three contiguous groups.

    - `period`: noise ends before the first mode with a mean period of `periods[0]` or more, drift begins at the first
      one with `periods[1]` or more. 21 s is where angle random walk gives way to bias instability in the paper's gyro,
      900 s the shortest thermal lag.
    - `sample_entropy`: mixed is all between the first and the last mode whose sample entropy at `scale` is `threshold`
      or more. Faster ones average out within a block, slower ones hardly move from block to block. At 1 Hz and scale 50
      to 60 this is the paper's grouping.
    - `permutation_entropy`: the same rule with permutation entropy, as the paper's text has it ("below 0.5 is noise").
      Permutation entropy only falls with the period, so no fast mode is ever below: the noise group comes out empty.

    Parameters
    ----------
    modes : ndarray, shape (n_mode + 1, n_time)
        Modes, fastest first, then the residual, any unit.
    sample_rate_hz : float
        Rate of the samples [Hz].
    method : {"period", "sample_entropy", "permutation_entropy"}
        What the groups are told apart by.
    periods : tuple of float
        Where mixed begins and where drift begins, for `period` [s].
    scale : int
        Samples per block, for the entropies [-].
    threshold : float
        Least entropy of a mixed mode [-].

    Returns
    -------
    ModeGroups
        Three ranges of rows.

    Raises
    ------
    ValueError
        If the modes are not rows, the rate is not positive, the method unknown, the periods fall, or no mode reaches
        the threshold.
    """
    if modes.ndim != 2 or modes.shape[0] == 0:
        msg = f"modes: expected two axes, a mode per row and the residual last, got shape {modes.shape}"
        raise ValueError(msg)
    if not sample_rate_hz > 0.0:
        msg = f"sample_rate_hz: expected above 0 Hz, got {sample_rate_hz}"
        raise ValueError(msg)
    rows = range(modes.shape[0])
    n_mode = len(rows) - 1
    if method == "period":
        if not 0.0 <= periods[0] <= periods[1]:
            msg = f"periods: expected two rising ones [s], got {periods}"
            raise ValueError(msg)
        values = [mean_period(mode, sample_rate_hz) for mode in modes[:-1]]
        begin, end = (next((k for k in range(n_mode) if values[k] >= limit), n_mode) for limit in periods)
    else:
        entropy = _entropy_of(method)
        mixed = [k for k in range(n_mode) if not entropy(modes[k], [scale])[0] < threshold]
        if not mixed:
            msg = (
                f"modes: expected one with {method} of at least {threshold} at scale {scale}, "
                "got none; try method='period'"
            )
            raise ValueError(msg)
        begin, end = mixed[0], mixed[-1] + 1
    return ModeGroups(rows[:begin], rows[begin:end], rows[end:])


def _entropy_of(method: str) -> Callable[[FloatArray, list[int]], FloatArray]:
    """Return the entropy that a method goes by."""
    if method == "sample_entropy":
        return multiscale_sample_entropy
    if method == "permutation_entropy":
        return multiscale_permutation_entropy
    msg = f"method: expected period, sample_entropy or permutation_entropy, got {quoted(method)}"
    raise ValueError(msg)
