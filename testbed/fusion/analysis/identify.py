"""Beliefs from measurements: the response to a sine, and a transfer function of given order fitted to responses by
least squares.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from testbed.fusion.analysis.whitening import parts, whitened
from testbed.fusion.belief import SensorBelief

if TYPE_CHECKING:
    from numpy.typing import ArrayLike

    from testbed.signals import ComplexArray, FloatArray

_ROUNDS = 200
# Parts of the band (in logarithm) over which the poles are spread at the start: a search can end in a local minimum.
_SPREADS = ((0.0, 1.0), (0.5, 1.0), (0.0, 0.5))
# Half the sum of squares that is rounding only.
_EXACT = 1e-20
# How far beyond the band a pole may go (in logarithm), and how far a damping may be from 1: farther off it acts as a
# constant or an integrator there, and its powers overflow.
_BEYOND = np.log(1e4)
# A coefficient of the numerator that adds less than this to the response is rounding: left in, a zero at 1e18 rad/s
# would make a sensor's inverse useless.
_ROUNDING = 1e-9


@dataclass(frozen=True)
class Identified:
    """A fitted transfer function and what it leaves.

    Parameters
    ----------
    numerator, denominator : ndarray, shapes (n_zero + 1,), (n_pole + 1,)
        Coefficients in s [rad/s], highest power first; the denominator starts with 1.
    worst : float
        Largest |fit / measured - 1| over the frequencies of the fit [-].
    delay : float
        Dead time behind it [s]; 0 unless it was searched.
    """

    numerator: FloatArray
    denominator: FloatArray
    worst: float
    delay: float = 0.0

    def belief(self, *, input_noise: float = 0.0, output_noise: float = 0.0) -> SensorBelief:
        """Return it as a belief.

        Parameters
        ----------
        input_noise, output_noise : float, optional
            Two-sided root densities before and behind the dynamics [rad/sqrt(s)].
        """
        return SensorBelief(
            numerator=tuple(self.numerator.tolist()),
            denominator=tuple(self.denominator.tolist()),
            delay=self.delay,
            input_noise=input_noise,
            output_noise=output_noise,
        )


def sine_response(
    reading: ArrayLike, sample_rate_hz: float, freq_hz: float, amplitude: float, *, settle: float = 0.0
) -> complex:
    r"""Return the frequency response at one point of a stepped-sine sweep: gain and phase of a sensor shaken by A sin(2
    pi f t).

    .. math:: \min \sum_k (z_k - c_0 - c_1 t_k - a \sin 2 \pi f t_k - b \cos 2 \pi f t_k)^2, \quad G = (a + j b) / A

    over the last whole periods of the record after `settle`. Offset and drift go with the fit, so that a slow transient
    does not count as response. White noise of two-sided root density N leaves a standard deviation of N sqrt(2/T)/A in
    either part of G, T the time fitted.

    Parameters
    ----------
    reading : array_like, shape (n_time,)
        Readings [rad/s], the first at t = 0.
    sample_rate_hz, freq_hz : float
        Rate of the readings and frequency of the sine [Hz].
    amplitude : float
        A [rad/s].
    settle : float, optional
        Time at the start that is left out [s].

    Returns
    -------
    complex
        G(j 2 pi f) [-].

    Raises
    ------
    ValueError
        If less than a period is left, or the frequency is not below half the sample rate.
    """
    z = np.asarray(reading, float)
    periods = np.floor((z.size / sample_rate_hz - settle) * freq_hz + 1e-9)
    if not (0.0 < freq_hz < sample_rate_hz / 2.0 and periods >= 1.0):
        msg = (
            f"reading: expected at least a period of {freq_hz:g} Hz, below {sample_rate_hz / 2.0:g} Hz, got "
            f"{z.size} samples and {settle:g} s to settle"
        )
        raise ValueError(msg)
    first = z.size - round(periods * sample_rate_hz / freq_hz)
    t = np.arange(first, z.size) / sample_rate_hz
    turn = 2.0 * np.pi * freq_hz * t
    basis = np.column_stack([np.sin(turn), np.cos(turn), np.ones_like(t), t - t.mean()])
    a, b = np.linalg.lstsq(basis, z[first:], rcond=None)[0][:2]
    return complex(a, b) / amplitude


def identify(
    freq_hz: FloatArray,
    response: ComplexArray,
    *,
    real_poles: int,
    pole_pairs: int = 0,
    blind_at_dc: bool = False,
    n_zero: int | None = None,
    weight: FloatArray | None = None,
    shared: ComplexArray | None = None,
    delay: float | None = None,
    tolerance: float = 1e-14,
) -> Identified:
    r"""Fit a strictly proper, stable transfer function to samples of a frequency response.

    .. math:: \min \sum_k w_k^2 |G(j 2 \pi f_k) / H_k - 1|^2, \quad G(s) = N(s) / D(s), \deg N < \deg D

    With a dead time it is G e^{-s tau}. Poles and dead time are searched (Levenberg-Marquardt in the logarithms of real
    poles, corners and damping, which keeps them stable, and in tau); for given ones N is linear least squares (variable
    projection, Golub and Pereyra 1973). s is scaled to the middle of the band.

    Parameters
    ----------
    freq_hz : ndarray, shape (n_freq,)
        Frequencies [Hz], best spaced evenly in logarithm.
    response : ndarray of complex, shape (n_freq,)
        Indicated over true rate H [-].
    real_poles, pole_pairs : int
        Number of real poles and of complex pairs, at least one pole in all.
    blind_at_dc : bool, optional
        Force G(0) = 0, as for an MHD sensor.
    n_zero : int, optional
        Degree of N, that zero included; default one less than there are poles.
    weight : ndarray, shape (n_freq,), optional
        Weight w of each sample [-]; default 1: relative errors count alike.
    shared : ndarray of complex, shape (n_freq,), optional
        What one standard deviation of an error that all samples have in common, such as that of a clock, adds to H, the
        weights being those of one standard deviation of each sample's own [-].
    delay : float, optional
        Where the search for a dead time begins [s], of either sign; left out there is none.
    tolerance : float, optional
        Relative change of the misfit and of the places at which the search ends [-]; what noise has no more digits for
        is found sooner with 1e-8.

    Returns
    -------
    Identified
        Transfer function and its worst relative misfit.

    Raises
    ------
    ValueError
        If there are fewer samples than coefficients, N has no such degree, or a sample is zero or not finite.
    """
    from scipy.optimize import least_squares

    freq, H = np.asarray(freq_hz, float), np.asarray(response, complex)
    w = np.ones(freq.size) if weight is None else np.asarray(weight, float)
    common = np.zeros(2 * freq.size) if shared is None else parts(w * shared / H)
    n_pole = real_poles + 2 * pole_pairs
    if n_pole < 1 or freq.shape != H.shape or freq.size < 2 * n_pole or w.shape != freq.shape:
        msg = (
            f"response: expected at least {max(2 * n_pole, 2)} samples at as many frequencies for {n_pole} poles, "
            f"got {freq.size}, {H.size}"
        )
        raise ValueError(msg)
    if not (np.all(np.isfinite(H)) and np.all(np.abs(H) > 0.0) and np.all(freq > 0.0)):
        msg = "response: expected finite values other than 0 at frequencies above 0 Hz"
        raise ValueError(msg)
    unit = 2.0 * np.pi * np.sqrt(freq[0] * freq[-1])
    s = 2j * np.pi * freq / unit

    degrees = int(blind_at_dc), n_pole - 1 if n_zero is None else n_zero
    if n_zero is not None and not degrees[0] <= n_zero < n_pole:
        msg = f"n_zero: expected {degrees[0]} to {n_pole - 1}, got {degrees[1]}"
        raise ValueError(msg)
    lowest, highest = _reach(np.abs(s), real_poles, pole_pairs)
    n_place, late = real_poles + 2 * pole_pairs, [] if delay is None else [delay * unit]

    def denominator(place: FloatArray) -> FloatArray:
        return _denominator(np.clip(place[:n_place], lowest, highest), real_poles)

    def in_time(place: FloatArray) -> ComplexArray:
        return H if delay is None else H * np.exp(s * place[-1])

    def residual(place: FloatArray) -> FloatArray:
        wanted = in_time(place)
        fit = _fitted(s, wanted, w, common, denominator(place), degrees)[1]
        return whitened(parts(w * (fit / wanted - 1.0)), common)

    tried = []
    for share in _SPREADS:
        start = np.concatenate([_start(np.abs(s), real_poles, pole_pairs, share), late])
        rounds = _ROUNDS * start.size
        tried.append(
            least_squares(residual, start, method="lm", xtol=tolerance, ftol=tolerance, gtol=tolerance, max_nfev=rounds)
        )
        if tried[-1].cost < _EXACT:
            break
    place = min(tried, key=lambda one: float(one.cost)).x
    D, wanted = denominator(place), in_time(place)
    N, G = _fitted(s, wanted, w, common, D, degrees)
    powers = unit ** np.arange(n_pole + 1.0)
    found = 0.0 if delay is None else float(place[-1]) / unit
    return Identified(N * powers[-N.size :], D * powers, float(np.max(np.abs(G / wanted - 1.0))), found)


def _reach(freq: FloatArray, real_poles: int, pole_pairs: int) -> tuple[FloatArray, FloatArray]:
    """Return the least and the largest place of real poles and corners, and of dampings, in logarithm."""
    damping = np.full(pole_pairs, _BEYOND)
    low, high = (np.full(real_poles + pole_pairs, np.log(edge)) for edge in (freq[0], freq[-1]))
    return np.concatenate([low - _BEYOND, -damping]), np.concatenate([high + _BEYOND, damping])


def _start(reach: FloatArray, real_poles: int, pole_pairs: int, share: tuple[float, float]) -> FloatArray:
    """Return poles spread over a share of the band: logarithms of the real ones, then of corner and damping of each
    pair.
    """
    low, high = np.interp(share, [0.0, 1.0], np.log([reach[0], reach[-1]]))
    real = low + (high - low) * (np.arange(real_poles) + 1.0) / (real_poles + 1.0)
    corners = low + (high - low) * (np.arange(pole_pairs) + 1.0) / (pole_pairs + 1.0)
    return np.concatenate([real, corners, np.full(pole_pairs, np.log(0.7))])


def _denominator(place: FloatArray, real_poles: int) -> FloatArray:
    """Return D, monic, highest power first."""
    pairs = (place.size - real_poles) // 2
    D = np.ones(1)
    for value in place[:real_poles]:
        D = np.convolve(D, [1.0, np.exp(value)])
    for corner, damping in zip(place[real_poles : real_poles + pairs], place[real_poles + pairs :], strict=True):
        D = np.convolve(D, [1.0, 2.0 * np.exp(damping + corner), np.exp(2.0 * corner)])
    return D


def _fitted(
    s: ComplexArray, H: ComplexArray, w: FloatArray, common: FloatArray, D: FloatArray, degrees: tuple[int, int]
) -> tuple[FloatArray, ComplexArray]:
    """Return the best N, of such lowest and highest degree, for the poles of D (highest power first) and G = N/D."""
    lowest, highest = degrees
    basis = s[:, None] ** np.arange(highest, lowest - 1, -1) / np.polyval(D, s)[:, None]
    system = whitened(parts((w / H)[:, None] * basis), common)
    wanted = whitened(np.concatenate([w, np.zeros_like(w)]), common)
    size = np.linalg.norm(system, axis=0)
    share = np.linalg.lstsq(system / size, wanted, rcond=None)[0]
    fit = np.where(np.abs(share) > _ROUNDING * np.linalg.norm(w), share, 0.0) / size
    N = np.concatenate([fit, np.zeros(lowest)])
    return N, basis @ fit
