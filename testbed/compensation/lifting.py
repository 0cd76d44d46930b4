"""Thresholds on the coefficients of a lifting wavelet: noise is small in all of them, a signal large in a few."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from testbed.signals import NORMAL_MEDIAN

if TYPE_CHECKING:
    from testbed.signals import FloatArray

# The wavelet of Cohen, Daubechies and Feauveau with five and three taps: one step of prediction and one of update.
WAVELET = "bior2.2"


def lifting_threshold(signal: FloatArray) -> FloatArray:
    r"""Return a signal less what the soft universal threshold takes from each level of its wavelet transform.

    .. math:: d \to \mathrm{sign}(d) \max(|d| - \sigma \sqrt{2 \ln n}, 0), \quad
        \sigma = \mathrm{median} |d| / 0.6745

    The transform is the 5/3 wavelet of the lifting scheme [1]_, by PyWavelets' filter bank, which has its coefficients;
    the threshold is that of [2]_, level by level, as the noise of a mode is not white.

    Parameters
    ----------
    signal : ndarray, shape (n_time,)
        Any unit.

    Returns
    -------
    ndarray, shape (n_time,)
        Unit of `signal`.

    References
    ----------
    .. [1] Sweldens, SIAM J. Math. Anal. 29 (1998) 511-546.
    .. [2] Donoho, Johnstone, Biometrika 81 (1994) 425-455.
    """
    import pywt

    coarse, *details = pywt.wavedec(signal, WAVELET)
    kept = [
        pywt.threshold(d, np.median(np.abs(d)) / NORMAL_MEDIAN * np.sqrt(2.0 * np.log(signal.size)), "soft")
        for d in details
    ]
    rebuilt: FloatArray = pywt.waverec([coarse, *kept], WAVELET)[: signal.size]
    return rebuilt
