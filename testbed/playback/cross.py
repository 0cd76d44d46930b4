"""The sensors of a recording against each other, by bands, beside what is believed of them."""

from __future__ import annotations

from itertools import combinations
from typing import TYPE_CHECKING, Any

import numpy as np

from testbed.metrics.cross import at_slower, cross_bands

if TYPE_CHECKING:
    from collections.abc import Mapping

    from testbed.fusion.belief import SensorBelief
    from testbed.playback.lineup import Lineup
    from testbed.signals import ComplexArray, FloatArray

# Below this a band says nothing of gain and phase.
_LEAST_COHERENCE = 0.5


def sensor_agreement(lineup: Lineup, belief: Mapping[str, SensorBelief], settle: float) -> list[dict[str, Any]]:
    """Return what each pair of sensors shares: coherence by band, and the ratio of the slower to the faster over that
    of their beliefs, 1 and 0 deg if these hold.

    Parameters
    ----------
    lineup : Lineup
        The sensors on one time base.
    belief : mapping of str to SensorBelief
        Of each.
    settle : float
        From when on [s].
    """
    times, rows = lineup.times(), []
    for one, other in combinations(lineup.sensors, 2):
        fast, slow = sorted((one, other), key=lambda name: -lineup.rates[name])
        begin = int(np.searchsorted(times[slow], settle))
        if times[slow].size - begin < 2:
            continue
        wanted = times[slow][begin:]
        mean, smoothing = at_slower(lineup.readings[fast], times[fast], wanted)

        def expected(
            freq: FloatArray, smoothing: Any = smoothing, pair: tuple[str, str] = (fast, slow)
        ) -> ComplexArray:
            first, second = (belief[name].realisation().response(freq) for name in pair)
            found: ComplexArray = second / (first * smoothing(freq))
            return found

        bands = cross_bands(mean, lineup.readings[slow][begin:], lineup.rates[slow], expected)
        rows.append({"first": fast, "second": slow, "bands": [_row(band) for band in bands]})
    return rows


def _row(band: Any) -> dict[str, float | None]:
    known = band.coherence >= _LEAST_COHERENCE
    return {
        "low_hz": band.low_hz,
        "high_hz": band.high_hz,
        "coherence": band.coherence,
        "gain_over_belief": abs(band.ratio) if known else None,
        "phase_off_belief_deg": float(np.angle(band.ratio, deg=True)) if known else None,
    }
