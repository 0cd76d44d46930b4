"""The delay that a record itself shows: the residual regressed on the rate in a band."""

from __future__ import annotations

import numpy as np

from testbed.signals import FloatArray, LinearFilter

BAND_HZ = (10.0, 60.0)


class DelayRegression:
    r"""A late correction leaves e = S (theta(t) - theta(t - d)), near S d omega: d by least squares.

    .. math:: d = \sum_k e_k r_k / \sum_k r_k^2, \quad r = S \omega

    both band-passed (fourth-order Butterworth, 10 to 60 Hz). What is proportional to angle or acceleration is at right
    angles to the rate of a stationary record and does not count.

    Parameters
    ----------
    gains : tuple of float
        k_1 [1/s] and k_2 [1/s^2] of S = s^2 / (s^2 + k_1 s + k_2).
    sample_rate_hz : float
        Rate of the samples, above 120 Hz [Hz].
    """

    def __init__(self, gains: tuple[float, float], sample_rate_hz: float) -> None:
        from scipy.signal import butter

        self._sensitivity = LinearFilter([1.0, 0.0, 0.0], [1.0, *gains], sample_rate_hz)
        self._sos = butter(2, BAND_HZ, "bandpass", fs=sample_rate_hz, output="sos")
        self._state = np.zeros((len(self._sos), 2, 2))
        self._product, self._square = 0.0, 0.0

    def process(self, error: FloatArray, rate: FloatArray, settled: int) -> None:
        """Take the next samples.

        Parameters
        ----------
        error, rate : ndarray, shape (n_time,)
            Residual [rad] and true rate [rad/s].
        settled : int
            Samples of the block that are not judged yet.
        """
        from scipy.signal import sosfilt

        both = np.stack([error, self._sensitivity.process(rate)])
        passed, self._state = sosfilt(self._sos, both, zi=self._state)
        e, r = passed[:, settled:]
        self._product += float(e @ r)
        self._square += float(r @ r)

    @property
    def delay(self) -> float | None:
        """The delay d [s], above zero where the correction is late; None without any rate in the band."""
        return self._product / self._square if self._square > 0.0 else None
