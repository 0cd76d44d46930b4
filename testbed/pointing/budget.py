r"""Who makes the residual: shares of its variance that add up to one, and what halving each would bring.

.. math:: s_i = \mathrm{cov}(e_i, e) / \mathrm{var}(e), \quad \sum_i s_i = 1 \ \text{for} \ e = \sum_i e_i

Roots of squares do not add up, since the parts of one motion are correlated.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any

import numpy as np

from testbed.pointing.knowledge import LAG, KnowledgeSplit
from testbed.pointing.line_of_sight import KNOWLEDGE

if TYPE_CHECKING:
    from testbed.pointing.knowledge import TermDensities
    from testbed.pointing.line_of_sight import PointingBlock
    from testbed.signals import FloatArray

URAD = 1e6


class BudgetAccount:
    """Accumulates the covariance of the parts of a residual, and what the knowledge is made of.

    Parameters
    ----------
    sample_rate_hz : float
        Rate of the samples [Hz].
    n_time : int
        Samples of the record.
    terms : mapping
        Densities of the noise of each sensor by term.
    """

    def __init__(self, sample_rate_hz: float, n_time: int, terms: TermDensities) -> None:
        self._names: tuple[str, ...] = ()
        self._n, self._sum, self._square = 0, np.zeros(0), np.zeros((0, 0))
        self._split = KnowledgeSplit(sample_rate_hz, n_time, terms)

    def process(self, block: PointingBlock, settled: int) -> None:
        """Take a block, but for its first `settled` samples.

        Parameters
        ----------
        block : PointingBlock
            Its parts and inputs.
        settled : int
            Samples that are not judged.
        """
        if not self._names:
            self._names = tuple(block.parts)
            self._sum, self._square = np.zeros(len(self._names)), np.zeros((len(self._names),) * 2)
        rows = np.stack([block.parts[name][settled:] for name in self._names])
        self._n += rows.shape[1]
        self._sum += rows.sum(axis=1)
        self._square += rows @ rows.T
        inputs = {name: values[settled:] for name, values in block.inputs.items()}
        self._split.process(inputs, block.parts[KNOWLEDGE][settled:], rows.sum(axis=0))

    def result(self) -> dict[str, Any] | None:
        """Return the budget as metrics.json has it; None without a residual."""
        if not self._n:
            return None
        mean = self._sum / self._n
        covariance = self._square / self._n - np.outer(mean, mean)
        total = float(covariance.sum())
        if not (np.all(np.isfinite(covariance)) and total > 0.0):
            return None
        share = self._by_name(covariance.sum(axis=1) / total)
        variance = self._by_name(np.diag(covariance).clip(0.0))
        halved = {name: total * (1.0 - share[name]) + variance[name] / 4.0 for name in share}
        within = self._split.result()
        return {
            "shares": share,
            "knowledge": _within(share[KNOWLEDGE], within, total),
            "rms_urad": _root(variance),
            "knowledge_rms_urad": _root({name: row["variance"] for name, row in within.items()}),
            "total_urad": URAD * math.sqrt(total),
            "quadrature_urad": URAD * math.sqrt(sum(variance.values())),
            "dominant": max(share, key=lambda name: share[name]),
            "halved_urad": _root(halved),
        }

    def _by_name(self, values: FloatArray) -> dict[str, float]:
        return dict(zip(self._names, values.tolist(), strict=True))


def _within(share: float, within: dict[str, dict[str, Any]], total: float) -> dict[str, float | dict[str, float]]:
    """Return the shares of the knowledge's parts, which add up to its own: the lag is the rest."""
    found: dict[str, float | dict[str, float]] = {}
    known = 0.0
    for name, row in within.items():
        if name != LAG:
            found[name] = {term: value / total for term, value in row["terms"].items()} or row["covariance"] / total
            known += row["covariance"] / total
    return {**found, LAG: share - known}


def _root(variance: dict[str, float]) -> dict[str, float]:
    return {name: URAD * math.sqrt(max(value, 0.0)) for name, value in variance.items()}
