"""When the Sage-Husa recursion (17) takes the filter's own lag for sensor noise, and R runs away."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from collections.abc import Sequence


def critical_q(lines: Sequence[tuple[float, float]], sample_rate_hz: float, order: int = 1) -> float:
    r"""Return the signal noise below which R of a filter that adapts by (17) runs away on a sum of sines.

    .. math:: q_{crit} = \frac{T}{2} \sum_i A_i^2 w_i^{2m}

    A settled filter of order m has the bandwidth w_0 of w_0^(2m) = q / (R T) and, for w well below it, the lag |e| = A
    (w / w_0)^m in its innovation, so that e^2 = R q_crit / q: as much as R times a number that does not depend on R.
    (17) sets R to e^2 and more; with q < q_crit it grows by that factor within every memory of (17), until the filter
    follows nothing. Above, R settles. For order 1 and one sensor without dynamics the gain K that it settles at follows
    exactly: (q - q_crit) T = 2 R_true K^2 / (2 - K).

    Parameters
    ----------
    lines : sequence of two floats each
        Frequency [Hz] and amplitude [rad/s] of every line of the signal.
    sample_rate_hz : float
        Rate 1/T of the sensor that the filter follows the signal by [Hz].
    order : int, optional
        Order m of the signal model.

    Returns
    -------
    float
        q_crit [rad^2/s^(2m+1)].
    """
    freq_hz, amplitude = np.array(lines, dtype=float).T
    return float(0.5 / sample_rate_hz * np.sum(amplitude**2 * (2.0 * np.pi * freq_hz) ** (2 * order)))
