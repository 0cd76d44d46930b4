"""Who sees what: the crossover of the sensors and their share in the noise floor by band."""

from __future__ import annotations

from itertools import combinations
from typing import TYPE_CHECKING, Any

import numpy as np

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping, Sequence

    from testbed.signals import FloatArray

# Where the first band of a budget begins, as the integral of the floor does.
_LOWEST_HZ = 1e-6
_BLIND = 1e30
# Logarithm of the lowest frequency at which two sensors are compared [Hz].
_LOWEST_CROSSOVER = -5.0


def crossovers(
    first: Callable[[FloatArray], FloatArray],
    second: Callable[[FloatArray], FloatArray],
    high_hz: float = 1e3,
) -> FloatArray:
    """Return the frequencies [Hz] at which two sensors are equally good, shape (n_crossing,), rising; to 1e-4 of
    themselves.

    Parameters
    ----------
    first, second : callable
        Input-referred two-sided noise density, Hz -> rad^2/s.
    high_hz : float, optional
        Up to where to look, from 1e-5 Hz on [Hz].
    """
    freq = np.logspace(_LOWEST_CROSSOVER, np.log10(high_hz), 4001)
    # Where a sensor is blind its density is infinite.
    ratio = np.log(np.fmin(first(freq), _BLIND) / np.fmin(second(freq), _BLIND))
    (at,) = np.nonzero(np.sign(ratio[1:]) != np.sign(ratio[:-1]))
    part = ratio[at] / (ratio[at] - ratio[at + 1])
    crossing: FloatArray = freq[at] * (freq[at + 1] / freq[at]) ** part
    return crossing


def noise_budget(
    psds: Mapping[str, Callable[[FloatArray], FloatArray]], edges_hz: Sequence[float]
) -> dict[str, FloatArray]:
    r"""Return the variance that each sensor leaves in the best combination of all, band by band.

    .. math:: \sigma_{i,b}^2 = 2 \int_b W_i^2 S_i df, \quad W_i = S_i^{-1} / \sum_j S_j^{-1}

    All sensors and bands together are the square of `floor_rmse` between the outer edges. 400 points per band,
    trapezoid in ln f.

    Parameters
    ----------
    psds : mapping of str to callable
        Input-referred two-sided noise density of each sensor, Hz -> rad^2/s.
    edges_hz : sequence of float
        Edges of the bands [Hz], rising, above 0.

    Returns
    -------
    dict of str to ndarray, shape (n_band,)
        Variance [rad^2/s^2].
    """
    edges = np.asarray(edges_hz, float)
    if edges.size < 2 or edges[0] <= 0.0 or np.any(np.diff(edges) <= 0.0):
        msg = f"edges_hz: expected at least two rising frequencies above 0 Hz, got {edges.tolist()}"
        raise ValueError(msg)
    freq = edges[:-1, None] * (edges[1:] / edges[:-1])[:, None] ** np.linspace(0.0, 1.0, 400)
    information = {name: 1.0 / psd(freq.ravel()).reshape(freq.shape) for name, psd in psds.items()}
    total = np.sum(list(information.values()), axis=0)
    return {name: 2.0 * np.trapezoid(one / total**2 * freq, np.log(freq), axis=1) for name, one in information.items()}


def budget_summary(psds: Mapping[str, Callable[[FloatArray], FloatArray]], bandwidth_hz: float) -> dict[str, Any]:
    """Return the entry `budget` of metrics.json: crossovers, contributions by decade and the densities, in deg/s and
    deg/s/sqrt(Hz).

    Parameters
    ----------
    psds : mapping of str to callable
        Input-referred two-sided noise density of each sensor, Hz -> rad^2/s.
    bandwidth_hz : float
        W, where the last band ends [Hz].
    """
    edges = [_LOWEST_HZ, *(10.0**k for k in range(-3, 7) if 10.0**k < bandwidth_hz), bandwidth_hz]
    shares = noise_budget(psds, edges)
    # Below the lowest frequency the densities are taken as constant, as for the floor.
    information = {name: 1.0 / float(psd(np.array([_LOWEST_HZ]))[0]) for name, psd in psds.items()}
    for name, share in shares.items():
        share[0] += 2.0 * _LOWEST_HZ * information[name] / sum(information.values()) ** 2
    total = np.sum(list(shares.values()), axis=0)
    bands = [
        {
            "low_hz": 0.0 if i == 0 else edges[i],
            "high_hz": edges[i + 1],
            "floor_deg_s": float(np.rad2deg(np.sqrt(total[i]))),
            "sensors_deg_s": {name: float(np.rad2deg(np.sqrt(share[i]))) for name, share in shares.items()},
        }
        for i in range(len(edges) - 1)
    ]
    freq = np.logspace(-3, np.log10(bandwidth_hz), 121)
    density = {name: np.rad2deg(np.sqrt(psd(freq))) for name, psd in psds.items()}
    return {
        "crossovers_hz": [float(f) for f in _all_crossovers(psds, bandwidth_hz)],
        "bands": bands,
        "frequency_hz": freq.tolist(),
        # Where a sensor is blind its density is no number.
        "densities": {name: [float(d) if np.isfinite(d) else None for d in one] for name, one in density.items()},
    }


def _all_crossovers(psds: Mapping[str, Callable[[FloatArray], FloatArray]], bandwidth_hz: float) -> list[float]:
    """Return where the best sensor changes [Hz]: crossings of two of which no third is better."""
    found = []
    for first, second in combinations(psds, 2):
        for freq in crossovers(psds[first], psds[second], bandwidth_hz):
            here = {name: float(psd(np.array([freq]))[0]) for name, psd in psds.items()}
            if here[first] <= 1.01 * min(here.values()):
                found.append(float(freq))
    return sorted(found)
