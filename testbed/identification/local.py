r"""The response over a narrow part of the spectrum, by the local polynomial method.

.. math:: Y(f) = (g_0 + g_1 d + g_2 d^2) X(f) + t_0 + t_1 d + t_2 d^2 + N(f)

with d the distance from the middle of what X has there. The second polynomial takes up the transients of both ends of
the record, and all else that leaks smoothly; so no time is left to settle and no window is needed, and whatever X is
(steps of a sine, a sweep, lines, noise) is used whole.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from scipy.stats import f as fisher

if TYPE_CHECKING:
    from testbed.identification.windows import SpectrumPart
    from testbed.signals import ComplexArray, FloatArray

_ORDER = 2
# Of the largest singular value: what X does not tell apart. Of a single line g_1 X d is smooth, so that no g_1 is
# known.
_RANK = 1e-4


@dataclass(frozen=True)
class LocalFit:
    """The response in a part of the spectrum.

    Parameters
    ----------
    freq_hz : float
        Middle of the reference's power there [Hz].
    response, slope : complex
        g_0 [-], and its derivative by the clock of the output [-].
    variance : float
        E|g_0 - true|^2 by the noise there [-].
    freedom : int
        Degrees of freedom of the noise's estimate, complex ones.
    noise, power : float
        Mean |N|^2, and mean |Y|^2 less the transients, over the bins.
    noise_hz : float
        Where a noise of density 1/f, averaged as this one is, has its mean [Hz].
    curvature, pull : float
        Sums of |dY/de|^2 and of Re((dY/de)* Y) that the model leaves, over the noise [-].
    spread : float
        For how long the reference is at these frequencies, less what looks like a smooth phase [s].
    coherence : float
        Share of the output that follows the reference [-].
    ratio, n_term : float, int
        Mean square that follows the reference over that of the noise, and how many terms of the response were told.
    is_line : bool
        Whether the reference has a line there and little else.
    rest : ndarray of complex, shape (n_freq,)
        What the fit leaves of the output [rad].
    """

    freq_hz: float
    response: complex
    slope: complex
    variance: float
    freedom: int
    noise: float
    power: float
    noise_hz: float
    curvature: float
    pull: float
    spread: float
    coherence: float
    ratio: float
    n_term: int
    is_line: bool
    rest: ComplexArray

    @property
    def chance(self) -> float:
        """Logarithm of the chance of a larger ratio without any connection."""
        return float(fisher.logsf(self.ratio, 2 * self.n_term, 2 * self.freedom))


def fit_local(part: SpectrumPart, freq: FloatArray, X: ComplexArray, Y: ComplexArray, Z: ComplexArray) -> LocalFit:
    """Return the response in a part of the spectrum.

    Parameters
    ----------
    part : SpectrumPart
        Which part.
    freq : ndarray, shape (n_freq,)
        Frequencies of all bins [Hz].
    X, Y : ndarray of complex, shape (n_freq,)
        Transforms of reference and output [rad].
    Z : ndarray of complex, shape (n_freq,)
        Derivative of Y by the clock of the output [rad].

    References
    ----------
    J. Schoukens, G. Vandersteen, K. Barbé, R. Pintelon (2009), IFAC Proc. 42(10):396-401.
    """
    peak_hz = float(freq[part.peak])
    freq, X, Y, Z = (one[part.bins] for one in (freq, X, Y, Z))
    power = np.abs(X) ** 2
    middle = _line_frequency(freq - peak_hz, X) + peak_hz if part.is_line else float(power @ freq / power.sum())
    d = (freq - middle) / (freq[-1] - freq[0])
    powers = d[:, None] ** np.arange(_ORDER + 1)
    smooth = np.linalg.qr(powers)[0]
    rest = [one - smooth @ (smooth.T @ one) for one in (Y, Z)]
    columns = X[:, None] * powers
    columns = columns - smooth @ (smooth.T @ columns)
    U, s, Vh = np.linalg.svd(columns, full_matrices=False)
    kept = s > _RANK * s[0]
    U, s, Vh = U[:, kept], s[kept], Vh[kept]
    first = Vh[:, 0].conj() / s
    onto = [U.conj().T @ one for one in rest]
    left = [one - U @ part for one, part in zip(rest, onto, strict=True)]
    freedom = freq.size - powers.shape[1] - s.size
    explained, unexplained = (float(np.vdot(one, one).real) for one in (onto[0], left[0]))
    noise = unexplained / freedom
    # What the residual of each bin has of the noise there.
    share = 1.0 - np.sum(smooth**2, axis=1) - np.sum(np.abs(U) ** 2, axis=1)
    return LocalFit(
        freq_hz=middle,
        response=complex(first @ onto[0]),
        slope=complex(first @ onto[1]),
        variance=noise * float(np.vdot(first, first).real),
        freedom=freedom,
        noise=noise,
        power=(explained + unexplained) / (freq.size - powers.shape[1]),
        noise_hz=float(share.sum() / (share @ (1.0 / freq))),
        curvature=float(np.vdot(left[1], left[1]).real) / noise if noise > 0.0 else 0.0,
        pull=float(np.vdot(left[1], left[0]).real) / noise if noise > 0.0 else 0.0,
        spread=float(np.linalg.norm(left[1]) / (2.0 * np.pi * middle * max(float(np.linalg.norm(Y)), 1e-300))),
        coherence=explained / (explained + unexplained) if explained > 0.0 else 0.0,
        ratio=explained / s.size / noise if noise > 0.0 else np.inf,
        n_term=s.size,
        is_line=part.is_line,
        rest=left[0],
    )


def _line_frequency(offset: FloatArray, X: ComplexArray) -> float:
    r"""Return where the line stands of which X is the transform without a window, :math:`X (f - f_0)
    = c_0 + c_1 f + c_2 f^2`, by least squares [Hz]; the right side holds what else there is.
    """
    smooth = (offset[:, None] / np.abs(offset).max()) ** np.arange(_ORDER + 1)
    columns = np.concatenate([X[:, None] / np.abs(X).max(), smooth], axis=1)
    found = np.linalg.lstsq(columns, X * offset, rcond=None)[0]
    return float(found[0].real / np.abs(X).max())
