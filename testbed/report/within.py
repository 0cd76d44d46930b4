"""What happened inside the filters, gathered from a run: what they adapted, and whether their innovations are white."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from testbed.metrics.consistency import Whiteness
from testbed.pages.envelope import Envelope

if TYPE_CHECKING:
    from testbed.runs.results import RunRecord
    from testbed.runs.signals import Signals
    from testbed.signals import FloatArray

BLOCK = 2**18
N_BINS = 400
LAGS = 40
_VARIANCE = "innovation_variance_"
# What is drawn over time, by the first letters of its name; a counter of gated readings only where it counted.
ADAPTED = ("R_", "N_", "Q_rate", "gated_", "frequency_")


@dataclass(frozen=True)
class Correlations:
    """Correlation [-] of normalised innovations with those 1, 2, ... readings before, and how many there were."""

    values: FloatArray
    n: int


def adapted(run: RunRecord) -> dict[str, dict[str, Envelope]]:
    """Return by diagnostic, such as ``R_mhd_ars``, and filter what it was over time.

    What never changes after settle (the fixed R of a filter that does not adapt, a gate that never closed) is left out.

    Parameters
    ----------
    run : RunRecord
        In memory or on disk.
    """
    found: dict[str, dict[str, Envelope]] = {}
    for kind in ADAPTED:
        for name in run.metrics.fusion:
            signals = run.fusion[name]
            for key in signals:
                if key.startswith(kind) and _moves(envelope := _over_time(signals, key)):
                    found.setdefault(key, {})[name] = envelope
    return found


def _over_time(signals: Signals, key: str) -> Envelope:
    envelope = Envelope(0, signals.n_time, signals.sample_rate_hz, N_BINS)
    for first in range(0, signals.n_time, BLOCK):
        envelope.process(first, np.asarray(signals.read(key, first, first + BLOCK), dtype=np.float64))
    return envelope


def _moves(envelope: Envelope) -> bool:
    known = np.isfinite(envelope.low)
    return bool(np.any(known)) and float(envelope.high[known].max()) > float(envelope.low[known].min())


def correlations(run: RunRecord) -> dict[str, dict[str, Correlations]]:
    """Return by sensor and filter the correlations of its normalised innovations after settle.

    Parameters
    ----------
    run : RunRecord
        In memory or on disk.
    """
    found: dict[str, dict[str, Correlations]] = {}
    for name in run.metrics.fusion:
        signals = run.fusion[name]
        settled = int(np.ceil(run.metrics.settle_s * signals.sample_rate_hz - 1e-6))
        for key in signals:
            sensor = key.removeprefix(_VARIANCE)
            if sensor != key and f"innovation_{sensor}" in signals:
                sums = Whiteness(LAGS)
                for first in range(settled, signals.n_time, BLOCK):
                    rows = (signals.read(one, first, first + BLOCK) for one in (f"innovation_{sensor}", key))
                    sums.add(*(np.asarray(one, dtype=np.float64) for one in rows))
                if (values := sums.correlations()).size:
                    found.setdefault(sensor, {})[name] = Correlations(values, sums.n)
    return found
