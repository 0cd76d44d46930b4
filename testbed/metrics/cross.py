"""Two records of one rate held against each other: what they share, band by band, and how large and how late."""

from __future__ import annotations

from itertools import pairwise
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from scipy.fft import irfft, rfft, rfftfreq
from scipy.signal import csd, welch

if TYPE_CHECKING:
    from collections.abc import Callable

    from testbed.signals import ComplexArray, FloatArray

    Response = Callable[[FloatArray], ComplexArray]

# Welch segments of a record, and samples of the longest.
_SEGMENTS, _LONGEST = 8, 2**17
# Frequencies below the first two of a Hann window's resolution hold the mean.
_FIRST = 2
# Of the slower clock: above this share of half its rate the mean of the faster one falls off too far.
_HIGHEST = 0.8
_FEWEST = 64
_POINTS = 4000


class CrossBand(NamedTuple):
    """What two records share between two frequencies.

    Parameters
    ----------
    low_hz, high_hz : float
        The band [Hz].
    coherence : float
        Share of the power of either that the other explains [-].
    ratio : complex
        Second over first, over what is expected of that [-]: 1 if both are what is believed of them.
    """

    low_hz: float
    high_hz: float
    coherence: float
    ratio: complex


def cross_bands(first: FloatArray, second: FloatArray, sample_rate_hz: float, expected: Response) -> list[CrossBand]:
    r"""Return what two records on one clock share, by decades.

    .. math:: r_b = \frac{\sum_{f \in b} S_{12}}{\sum_{f \in b} S_{11}}, \qquad
        \gamma_b^2 = \frac{|\sum_b S_{12}|^2}{\sum_b S_{11} \sum_b S_{22}}

    S by Welch's method (Hann window, half overlap) of the second record and of the first as it is expected in the
    second: through G over the whole record, so that the skirt of a line keeps the ratio of the line. r is 1 if G holds;
    noise of the first makes it smaller.

    Parameters
    ----------
    first, second : ndarray, shape (n_time,)
        Rates [rad/s]; lost samples are bridged by straight lines.
    sample_rate_hz : float
        Of both [Hz].
    expected : callable
        G, frequencies [Hz] -> ratio [-].

    Returns
    -------
    list of CrossBand
        From the lowest frequency that the record resolves to 0.8 of half the rate; empty if it is too short.
    """
    n_segment = min(first.size // _SEGMENTS, _LONGEST)
    if n_segment < _FEWEST:
        return []
    step, highest = sample_rate_hz / n_segment, 0.5 * _HIGHEST * sample_rate_hz
    other = _bridged(second)
    like = _through(_bridged(first), sample_rate_hz, expected, (step, highest))
    freq, both = csd(like, other, fs=sample_rate_hz, nperseg=n_segment)
    alone, own = (welch(x, fs=sample_rate_hz, nperseg=n_segment)[1] for x in (like, other))
    bands = []
    for low, high in pairwise([_FIRST * step, *_decades(_FIRST * step, highest)]):
        part = (freq >= low) & (freq < high)
        explained, power, shared = np.sum(alone[part]), np.sum(own[part]), np.sum(both[part])
        if explained > 0.0 and power > 0.0:
            coherence = float(abs(shared) ** 2 / (explained * power))
            bands.append(CrossBand(low, high, coherence, complex(shared / explained)))
    return bands


def _through(rate: FloatArray, sample_rate_hz: float, expected: Response, span: tuple[float, float]) -> FloatArray:
    """Return a record behind a response, nothing outside of a band [Hz]."""
    spectrum, freq = rfft(rate - rate.mean()), rfftfreq(rate.size, 1.0 / sample_rate_hz)
    # A response is smooth: worked out at some thousand frequencies, a delay's turns included.
    known = np.unique(np.concatenate([np.geomspace(*span, _POINTS), np.linspace(*span, _POINTS)]))
    values = expected(known)
    G = np.interp(freq, known, values.real) + 1j * np.interp(freq, known, values.imag)
    G[(freq < span[0]) | (freq > span[1]) | ~np.isfinite(G)] = 0.0
    behind: FloatArray = irfft(spectrum * G, rate.size)
    return behind


def at_slower(fast: FloatArray, times: FloatArray, wanted: FloatArray) -> tuple[FloatArray, Response]:
    """Return a record at the instants of a slower clock, as means over a step of it, and what that does to a rate.

    Parameters
    ----------
    fast : ndarray, shape (n_time,)
        Rates [rad/s].
    times, wanted : ndarray, shapes (n_time,), (n_slow,)
        Instants of both [s], increasing.

    Returns
    -------
    ndarray, callable
        Means about the wanted instants, shape (n_slow,), and their response, frequencies [Hz] -> ratio [-].
    """
    step = float(wanted[-1] - wanted[0]) / max(wanted.size - 1, 1)
    own = float(times[-1] - times[0]) / max(times.size - 1, 1)
    total = np.concatenate([[0.0], np.cumsum(_bridged(fast))]) * own
    # The integral at any instant, a sample standing for the step about it.
    edges = np.concatenate([times - 0.5 * own, [times[-1] + 0.5 * own]])
    width = max(step, own)
    mean = (np.interp(wanted + 0.5 * width, edges, total) - np.interp(wanted - 0.5 * width, edges, total)) / width
    return mean, lambda freq: (np.sinc(freq * width) * np.sinc(freq * own)).astype(complex)


def _bridged(rate: FloatArray) -> FloatArray:
    known = np.isfinite(rate)
    if known.all() or not known.any():
        return np.nan_to_num(rate)
    places = np.arange(rate.size)
    bridged: FloatArray = np.interp(places, places[known], rate[known])
    return bridged


def _decades(low: float, high: float) -> list[float]:
    powers = [10.0**k for k in range(-6, 7) if low < 10.0**k < high]
    return [*powers, high]
