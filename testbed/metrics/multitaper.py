"""Thomson's multitaper density of a record."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from scipy.fft import rfft, rfftfreq

if TYPE_CHECKING:
    from testbed.signals import FloatArray

HALF_BANDWIDTH = 4.0
TAPERS = 7


def multitaper_density(values: FloatArray, sample_rate_hz: float) -> tuple[FloatArray, FloatArray]:
    r"""Return the two-sided density, the mean over orthogonal tapers :math:`w_j` of one record.

    .. math:: S(f) = \frac{1}{J f_s} \sum_{j=1}^{J} \left| \sum_k w_{j,k} x_k e^{-2 \pi i f k / f_s} \right|^2,
              \quad \sum_k w_{j,k}^2 = 1

    Seven tapers of half bandwidth 4 / T, so that a value has 14 degrees of freedom over 8 / T.

    Parameters
    ----------
    values : ndarray, shape (n_time,)
        Even samples, finite, any unit.
    sample_rate_hz : float
        Their rate [Hz].

    Returns
    -------
    freq_hz, density : ndarray, shapes (n_freq,), (n_freq,)
        Frequency [Hz] from zero on, density [unit^2/Hz].

    References
    ----------
    D. J. Thomson (1982), Proc. IEEE 70(9):1055-1096.
    """
    from scipy.signal.windows import dpss

    total = np.zeros(values.size // 2 + 1)
    for taper in dpss(values.size, HALF_BANDWIDTH, TAPERS):
        spectrum = rfft(values * taper)
        total += spectrum.real**2 + spectrum.imag**2
    return rfftfreq(values.size, 1.0 / sample_rate_hz), total / (TAPERS * sample_rate_hz)
