"""An Allan deviation as a record of its own, for the computation and for the fit."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from testbed.signals import FloatArray


@dataclass(frozen=True)
class AllanCurve:
    """An overlapping Allan deviation with its 95 % limits.

    Parameters
    ----------
    tau : ndarray, shape (n_tau,)
        Averaging times [s], whole multiples of the sample period.
    deviation, lower, upper : ndarray, shape (n_tau,)
        Allan deviation and its limits [rad/s].
    edf : ndarray, shape (n_tau,)
        Equivalent degrees of freedom [-].
    n_time : int
        Number of samples of the record, lost ones counted.
    sample_rate_hz : float
        Its sample rate [Hz].
    used : ndarray, shape (n_tau,), optional
        Share of the second differences that lost samples left [-]; None: all.
    """

    tau: FloatArray
    deviation: FloatArray
    lower: FloatArray
    upper: FloatArray
    edf: FloatArray
    n_time: int
    sample_rate_hz: float
    used: FloatArray | None = None

    def between(self, low: float, high: float) -> AllanCurve:
        """Return the part of the curve with `low` <= tau <= `high` [s]."""
        chosen = (self.tau >= low) & (self.tau <= high)
        parts = {name: getattr(self, name)[chosen] for name in ("tau", "deviation", "lower", "upper", "edf")}
        return replace(self, used=None if self.used is None else self.used[chosen], **parts)
