"""Levels that an error stays below for a share of the time, with confidence, from counts that do not grow."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from testbed.signals import FloatArray

SHARES = (0.68, 0.95, 0.997)
_N_BATCH = 16
# Bins of equal ratio, 0.7 % wide, from a picoradian up [rad].
_LOWEST, _HIGHEST, _N_BIN = 1e-13, 1e2, 4800
# Student's t for 15 degrees of freedom, two-sided 95 %.
_T95 = 2.131


class Levels:
    """Quantiles of |e| from counts in narrow bins; their intervals from the scatter between batches of the record.

    Samples follow each other closely, so that their number says nothing: the 95 % interval is Student's, of the
    quantiles of 16 parts of the record, which it takes as independent.

    Parameters
    ----------
    n_time : int
        Samples of the record.
    """

    def __init__(self, n_time: int) -> None:
        self._edges = np.geomspace(_LOWEST, _HIGHEST, _N_BIN + 1)
        self._counts = np.zeros((_N_BATCH, _N_BIN))
        self._n_time, self._done = n_time, 0

    def process(self, error: FloatArray) -> None:
        """Take the next samples of the error [rad], shape (n_time,)."""
        batch = (self._done + np.arange(error.size)) * _N_BATCH // max(self._n_time, 1)
        place = np.clip(np.searchsorted(self._edges, np.abs(error), side="right") - 1, 0, _N_BIN - 1)
        cell = np.minimum(batch, _N_BATCH - 1) * _N_BIN + place
        self._counts += np.bincount(cell, minlength=self._counts.size).reshape(self._counts.shape)
        self._done += error.size

    def result(self) -> list[dict[str, float | None]]:
        """Return, for each of `SHARES`, `share` and the `level` below which |e| is [rad], and its `lower` and `upper`
        end of 95 %; ends are None if a batch is empty.
        """
        filled = bool(np.all(self._counts.sum(axis=1) > 0))
        rows: list[dict[str, float | None]] = []
        for share in SHARES:
            level = self._quantile(self._counts.sum(axis=0), share)
            ends: tuple[float | None, float | None] = (None, None)
            if filled:
                half = _T95 * float(np.std([self._quantile(one, share) for one in self._counts], ddof=1))
                half /= _N_BATCH**0.5
                ends = (max(level - half, 0.0), level + half)
            rows.append({"share": share, "level": level, "lower": ends[0], "upper": ends[1]})
        return rows

    def _quantile(self, counts: FloatArray, share: float) -> float:
        total = np.concatenate([[0.0], np.cumsum(counts)])
        return float(np.interp(share * total[-1], total, self._edges)) if total[-1] else 0.0
