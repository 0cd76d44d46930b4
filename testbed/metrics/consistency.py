"""Whether a filter's claims about itself hold: squared errors and innovations against their claimed variances, and
whiteness.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any

import numpy as np
from scipy.special import chdtri, ndtri

from testbed.metrics.errors import finite

if TYPE_CHECKING:
    from collections.abc import Mapping

    from testbed.signals import FloatArray

# Innovations are compared with those this many readings before them, each.
LAGS = 10
# A bound is missed by chance once in a thousand.
MISS = 1e-3
# A claim of the variance is called right within this factor: the standard deviation within 1.4.
FACTOR = 2.0
_INNOVATION, _VARIANCE = "innovation_", "innovation_variance_"


class Whiteness:
    r"""Sums over the normalised innovations :math:`\nu_k = e_k / \sqrt{C_k}` of one sensor, those in a gap left out.

    .. math:: \mathrm{NIS} = \langle \nu^2 \rangle, \qquad
        \rho_l = \sum \nu_k \nu_{k-l} / \sum \nu_k^2, \; l = 1 \ldots 10

    Only sums and the last values are kept, so memory does not grow.

    Parameters
    ----------
    lags : int, optional
        How many; ten unless told otherwise.
    """

    def __init__(self, lags: int = LAGS) -> None:
        self.n = 0
        self._lags = lags
        self._products = np.zeros(lags + 1)
        self._last = np.zeros(lags)

    def add(self, innovation: FloatArray, variance: FloatArray) -> None:
        """Add the innovations of a block.

        Parameters
        ----------
        innovation, variance : ndarray, shape (n_time,)
            Innovation [rad/s] and its claimed variance [rad^2/s^2]; NaN where no reading was used.
        """
        there = np.isfinite(innovation) & (variance > 0.0)
        fresh = innovation[there] / np.sqrt(variance[there])
        # Zeros stand for what was before the first one: they add nothing to any product.
        series = np.concatenate([self._last, fresh])
        self.n += fresh.size
        self._products += [series[self._lags - lag : series.size - lag] @ fresh for lag in range(self._lags + 1)]
        # A copy: a view would keep the whole block.
        self._last = series[fresh.size :].copy()

    def nis(self) -> float | None:
        """Return the mean normalised innovation squared [-], 1 if the claims hold; None without readings."""
        return finite(self._products[0] / self.n) if self.n else None

    def nis_bounds(self) -> tuple[float, float]:
        """Return what it lies between by chance, if the innovations are white and Gaussian: quantiles of chi-square
        over n [-].
        """
        low, high = chdtri(self.n, [1.0 - MISS / 2.0, MISS / 2.0]) / self.n
        return float(low), float(high)

    def correlations(self) -> FloatArray:
        """Return the correlation at lags 1, 2, ... [-], shape (n_lag,); none if undefined."""
        return self._products[1:] / self._products[0] if self._products[0] > 0.0 else np.empty(0)

    def correlation(self) -> float | None:
        """Return the correlation of largest size over the lags [-]; None if undefined."""
        rho = self.correlations()
        return finite(rho[np.argmax(np.abs(rho))]) if rho.size else None

    def correlation_bound(self) -> float:
        """Return what it stays below by chance if they are white [-]: 1/sqrt(n) per lag, and the miss shared by the
        lags.
        """
        return float(-ndtri(MISS / (2.0 * self._lags)) / math.sqrt(self.n))


class Consistency:
    r"""Consistency of one filter: its error against the standard deviation it claims, its innovations against theirs.

    .. math:: \mathrm{NEES} = \langle (\hat x - x)^2 / \sigma^2 \rangle

    of the rate. Errors of one run hang together in time, by the slowest mode of the filter, so no bound is given for
    it; the innovations of a consistent filter are white, and have one. Without a truth the innovations alone decide.

    Parameters
    ----------
    known : bool, optional
        Whether there is a truth.

    References
    ----------
    Bar-Shalom, Li, Kirubarajan, Estimation with Applications to Tracking and Navigation (2001), section 5.4.
    """

    def __init__(self, *, known: bool = True) -> None:
        self._known = known
        self._n = 0
        self._square = 0.0
        self._sensors: dict[str, Whiteness] = {}

    def add(self, error: FloatArray, std: FloatArray, diagnostics: Mapping[str, FloatArray], start: int = 0) -> None:
        """Add a block.

        Parameters
        ----------
        error, std : ndarray, shape (n_time,)
            Estimate minus truth, and the standard deviation claimed [rad/s].
        diagnostics : mapping of str to ndarray, shape (n_block,)
            Of the filter; innovations [rad/s] and their variances [rad^2/s^2] are looked up, if it has them.
        start : int, optional
            Diagnostics before this sample are left out.
        """
        self._n += error.size
        with np.errstate(divide="ignore", invalid="ignore"):
            self._square += float(np.sum((error / std) ** 2))
        for key, variance in diagnostics.items():
            sensor = key.removeprefix(_VARIANCE)
            if sensor != key and _INNOVATION + sensor in diagnostics:
                sums = self._sensors.setdefault(sensor, Whiteness())
                sums.add(diagnostics[_INNOVATION + sensor][start:], variance[start:])

    def result(self) -> dict[str, Any]:
        """Return NEES, per sensor NIS and the largest correlation with their bounds, and the verdict; None where
        undefined.
        """
        found: dict[str, Any] = {"nees": finite(self._square / self._n) if self._n else None}
        for sensor, sums in self._sensors.items():
            known = sums.n > 0
            found[f"nis_{sensor}"] = sums.nis()
            found[f"nis_bounds_{sensor}"] = list(sums.nis_bounds()) if known else None
            found[f"whiteness_{sensor}"] = sums.correlation()
            found[f"whiteness_bound_{sensor}"] = sums.correlation_bound() if known else None
        found["verdict"] = self._verdict(found["nees"])
        return found

    def _verdict(self, nees: float | None) -> str | None:
        """Return in one word whether the claims hold within FACTOR: the error decides, then the innovations."""
        if nees is None and self._known:
            return None
        if nees is not None and nees > FACTOR:
            return "optimistic"
        if nees is not None and nees < 1.0 / FACTOR:
            return "pessimistic"
        judged = [(nis, sums.nis_bounds()) for sums in self._sensors.values() if (nis := sums.nis()) is not None]
        for nis, (low, high) in judged:
            if not low / FACTOR <= nis <= high * FACTOR:
                return "innovations too large" if nis > 1.0 else "innovations too small"
        return "consistent" if judged or self._known else None
