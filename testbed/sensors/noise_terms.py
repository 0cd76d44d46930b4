"""Noise terms in time: own random stream, kept state, the same bits for any division into blocks."""

from __future__ import annotations

import functools
import math
from typing import TYPE_CHECKING, Protocol

import numpy as np
from numba import njit

if TYPE_CHECKING:
    from testbed.signals import ComplexArray, FloatArray

# Terms are added piece by piece, so that the pieces stay in the processor's cache.
_PIECE = 16384
# Largest relative deviation of the 1/f density inside its band that the rational approximation may leave.
_RIPPLE = 0.004
# Zeros and poles in z that bend |2 sin(pi f T)|^-1 to (2 pi f T)^-1: a minimax fit in dB over 0 ... Nyquist, 0.022 dB
# at worst.
_BEND_ZEROS = (-0.81790, -0.25917)
_BEND_POLES = (-0.80916, -0.17753)


class NoiseTerm(Protocol):
    """One term in time: `process(n)` returns its next n samples."""

    def process(self, n_time: int) -> FloatArray:
        """Return the next `n_time` samples [rad/s]."""


# Free to add the sections in any order, which is the same one for every sample.
@njit(cache=True, fastmath={"reassoc", "nsz"})
def _run_bank(v, p, g, w, y):  # type: ignore[no-untyped-def] # pragma: no cover
    """v_i <- p_i v_i + g_i w; y = sum of v_i."""
    for k in range(w.size):
        drive, total = w[k], 0.0
        for i in range(v.size):
            v[i] = p[i] * v[i] + g[i] * drive
            total += v[i]
        y[k] = total


class White:
    """White noise of two-sided root density N: y = N / sqrt(T) w."""

    def __init__(self, density: float, sample_rate_hz: float, stream: np.random.Generator) -> None:
        self._std, self._stream = density * math.sqrt(sample_rate_hz), stream

    def process(self, n_time: int) -> FloatArray:
        """Return the next `n_time` samples [unit of the density times sqrt(Hz)]."""
        return self._stream.standard_normal(n_time) * self._std


class Quantization:
    """Angle quantisation as a noise: an independent uniform angle error of standard deviation Q, differenced over T."""

    def __init__(self, angle_std: float, sample_rate_hz: float, stream: np.random.Generator) -> None:
        self._scale, self._stream = math.sqrt(12.0) * angle_std * sample_rate_hz, stream
        self._last = stream.random()

    def process(self, n_time: int) -> FloatArray:
        """Return the next `n_time` samples [rad/s]."""
        error = np.empty(n_time + 1)
        error[0] = self._last
        self._stream.random(out=error[1:])
        self._last = error[-1]
        return np.diff(error) * self._scale


class Ramp:
    """Rate ramp: y = R t, with t = k / fs from the sample's number, so that it does not drift."""

    def __init__(self, slope: float, sample_rate_hz: float) -> None:
        self._slope, self._sample_rate_hz, self._start = slope, sample_rate_hz, 0

    def process(self, n_time: int) -> FloatArray:
        """Return the next `n_time` samples [rad/s]."""
        index = np.arange(self._start, self._start + n_time)
        self._start += n_time
        return self._slope * (index / self._sample_rate_hz)


class FirstOrderBank:
    r"""White noise through first-order sections in parallel, all driven by the one stream.

    .. math:: v_i \leftarrow p_i v_i + g_i w, \quad y = \sum_i v_i

    Parameters
    ----------
    decay : ndarray, shape (n_section,)
        1 - p_i, kept instead of the pole because slow poles round to one [-].
    gain : ndarray, shape (n_section,)
        g_i, unit of the output.
    stream : numpy.random.Generator
        Source of w; also of the initial state, drawn from the stationary covariance g_i g_j / (1 - p_i p_j).
        A section with decay 0 is a random walk from zero.
    """

    def __init__(self, decay: FloatArray, gain: FloatArray, stream: np.random.Generator) -> None:
        self._p, self._gain, self._stream = 1.0 - decay, gain, stream
        self._state = _stationary_root(decay, gain) @ stream.standard_normal(decay.size)

    def process(self, n_time: int) -> FloatArray:
        """Return the next `n_time` samples, unit of the gain."""
        y = self._stream.standard_normal(n_time)
        _run_bank(self._state, self._p, self._gain, y, y)
        return y


def _stationary_root(decay: FloatArray, gain: FloatArray) -> FloatArray:
    """Return a square root of the stationary covariance of the bank's state; zero where there is none."""
    root = np.zeros((decay.size, decay.size))
    moving = decay > 0.0
    d = decay[moving]
    # 1 - p_i p_j without cancellation.
    correlation = 1.0 / (d[:, None] + d - d[:, None] * d)
    size = np.sqrt(np.diag(correlation))
    value, vector = np.linalg.eigh(correlation / size / size[:, None])
    root[np.ix_(moving, moving)] = (gain[moving] * size)[:, None] * vector * np.sqrt(np.maximum(value, 0.0))
    return root


def _zolotarev(kappa: float) -> FloatArray:
    r"""Return poles and zeros of the best rational approximation of x^-1/2 on [1, kappa^-2] [1]_.

    Zolotarev's are known in closed form and interlaced on the negative axis: -x_l with x_l = sinh^2(l K' / 2m),
    K' = ln(4 / kappa), mirrored about the middle of the band (exact to order kappa); the even ones are the poles.

    Parameters
    ----------
    kappa : float
        Lower over upper frequency of the band, x being the square of a frequency [-].

    Returns
    -------
    ndarray, shape (2 m - 1,)
        x_l, ascending [-].

    References
    ----------
    .. [1] van den Eshof, Frommer, Lippert, Schilling, van der Vorst, "Numerical methods for the QCD
       overlap operator. I", Comput. Phys. Commun. 146 (2002).
    """
    quarter = math.log(4.0 / kappa)
    m = math.ceil(quarter * math.log(4.0 / _RIPPLE) / math.pi**2)
    lower = np.sinh(np.arange(1, m) * quarter / (2 * m)) ** 2
    return np.concatenate([lower, [1.0 / kappa], 1.0 / (kappa**2 * lower[::-1])])


@functools.lru_cache(maxsize=32)
def continuous_flicker(lowest_freq_hz: float, highest_freq_hz: float) -> tuple[FloatArray, FloatArray]:
    """Return poles and gains of sections in parallel, sum g_i / (s + p_i), whose |H|^2 is 1 / (2 pi f) over a band.

    Parameters
    ----------
    lowest_freq_hz, highest_freq_hz : float
        The band; flat below, falling by 1 / f^2 above [Hz].

    Returns
    -------
    ndarray, shapes (n_section,), (n_section,)
        p_i [rad/s] and g_i [sqrt(rad/s)].
    """
    low = 2.0 * np.pi * lowest_freq_hz
    roots = low * np.sqrt(_zolotarev(lowest_freq_hz / highest_freq_hz))
    poles, zeros = roots[0::2], roots[1::2]
    gain = _residues(zeros, poles)
    turn = np.geomspace(low, 2.0 * np.pi * highest_freq_hz, 40 * poles.size)
    level = turn * np.abs((gain / (1j * turn[:, None] + poles)).sum(axis=1)) ** 2
    return poles, gain / (level.max() * level.min()) ** 0.25


@functools.lru_cache(maxsize=32)
def _one_over_f(relative_band: float) -> tuple[FloatArray, FloatArray]:
    """Return decays and gains of sections whose |H|^2 is 1 / (2 pi f T) from f T = `relative_band` to 1/2: in
    x = |1 - z|^2 = 4 sin^2(pi f T), of which a section pair is a real rational factor, the best approximation of
    x^-1/2.
    """
    c = _zolotarev(math.sin(math.pi * relative_band)) * (2.0 * math.sin(math.pi * relative_band)) ** 2
    # (1 - p)^2 / p = c, solved for 1 - p.
    decay = np.sqrt(c + c**2 / 4.0) - c / 2.0
    poles = np.concatenate([decay[0::2], 1.0 - np.array(_BEND_POLES)])
    zeros = np.concatenate([decay[1::2], 1.0 - np.array(_BEND_ZEROS)])
    gain = _residues(zeros, poles)
    freq = np.geomspace(relative_band, 0.5, 40 * decay.size)
    level = 2.0 * np.pi * freq * np.abs(bank_response(poles, gain, freq)) ** 2
    return poles, gain / (level.max() * level.min()) ** 0.25


def _residues(zeros: FloatArray, poles: FloatArray) -> FloatArray:
    """Return g_i of sum g_i / (1 - p_i/z) = prod (1 - q_j/z) / prod (1 - p_i/z), roots given as 1 - root; also of
    sum g_i / (s + p_i) = prod (s + q_j) / prod (s + p_i), roots given as -root.
    """
    numerator = np.prod(zeros[None, :] - poles[:, None], axis=1)
    difference = poles[None, :] - poles[:, None]
    np.fill_diagonal(difference, 1.0)
    residues: FloatArray = numerator / np.prod(difference, axis=1)
    return residues


def bank_response(decay: FloatArray, gain: FloatArray, cycles: FloatArray) -> ComplexArray:
    """Return the response of a bank of first-order sections, sum g_i / (1 - p_i exp(-2 pi j f T)).

    Parameters
    ----------
    decay, gain : ndarray, shape (n_section,)
        1 - p_i [-] and g_i [unit of the output].
    cycles : ndarray, shape (n_freq,)
        f T, frequency over sample rate [-].

    Returns
    -------
    ndarray of complex, shape (n_freq,)
        Response, unit of the gain.
    """
    turn = 2j * np.pi * cycles[:, None]
    value: ComplexArray = (gain / (decay * np.exp(-turn) - np.expm1(-turn))).sum(axis=1)
    return value


def flicker(level: float, lowest_freq_hz: float, sample_rate_hz: float, stream: np.random.Generator) -> FirstOrderBank:
    """Return noise of two-sided density level^2 / (2 pi f) from `lowest_freq_hz` to half the sample rate, flat below.

    Within the band the density keeps to 1/f within 0.05 dB (computed from the filter, no statistics).

    Parameters
    ----------
    level : float
        B, unit of the output.
    lowest_freq_hz, sample_rate_hz : float
        Lower end of the band and sample rate [Hz].
    stream : numpy.random.Generator
        The term's own stream.

    Returns
    -------
    FirstOrderBank
        The noise in time, stationary from its first sample.

    Raises
    ------
    ValueError
        If the band is less than two decades.
    """
    if not lowest_freq_hz <= 0.005 * sample_rate_hz:
        highest = 0.005 * sample_rate_hz
        msg = f"lowest_frequency: expected at most 1/200 of the sample rate, {highest:g} Hz, got {lowest_freq_hz:g} Hz"
        raise ValueError(msg)
    decay, gain = _one_over_f(lowest_freq_hz / sample_rate_hz)
    return FirstOrderBank(decay, level * gain, stream)


def random_walk(coefficient: float, sample_rate_hz: float, stream: np.random.Generator) -> FirstOrderBank:
    """Return a rate random walk y <- y + K sqrt(T) w from zero, `coefficient` K [rad/s^1.5]."""
    return FirstOrderBank(np.zeros(1), np.array([coefficient / math.sqrt(sample_rate_hz)]), stream)


def markov(std: float, time_constant: float, sample_rate_hz: float, stream: np.random.Generator) -> FirstOrderBank:
    """Return the first-order Markov bias of paper 1, equation (22), discretised exactly and stationary.

    y <- exp(-T / T_c) y + sigma_b sqrt(1 - exp(-2 T / T_c)) w; Allan deviation at most 0.617 sigma_b, at 1.89 T_c. It
    is no flicker.

    Parameters
    ----------
    std : float
        Standard deviation sigma_b [rad/s].
    time_constant : float
        T_c [s].
    sample_rate_hz : float
        Sample rate [Hz].
    stream : numpy.random.Generator
        The term's own stream.

    Returns
    -------
    FirstOrderBank
        The noise in time.
    """
    step = 1.0 / (time_constant * sample_rate_hz)
    return FirstOrderBank(np.array([-math.expm1(-step)]), np.array([std * math.sqrt(-math.expm1(-2.0 * step))]), stream)


class NoiseStage:
    """Independent noise terms, added.

    Parameters
    ----------
    terms : dict of str to NoiseTerm
        The terms by name.
    """

    def __init__(self, terms: dict[str, NoiseTerm]) -> None:
        self.terms = terms

    def process(self, n_time: int) -> FloatArray:
        """Return the next `n_time` samples of the sum, shape (n_time,), unit of the terms."""
        total = np.zeros(n_time)
        for start in range(0, n_time, _PIECE):
            piece = total[start : start + _PIECE]
            for term in self.terms.values():
                piece += term.process(piece.size)
        return total
