r"""What is in the error of the estimated angle: the noise of each sensor term by term, the belief's error, the lag.

A filter is near a linear one over the record, and what goes into it is known in a simulation and independent: the truth
and the noise n_i of each sensor. By least squares, frequency by frequency (H smooth over a twentieth of a decade),

.. math:: k = H_0 \theta + \sum_i H_i n_i + r

with k the knowledge's part of the residual and every input passed through integral, mirror and tracker as k was. The
sensor's share is that of H_i n_i; that of the belief's error is the sum of H_i times what the sensor makes of the truth
beside what the filter believes; the rest of k is the lag, the filter's own adaptation included.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
from scipy.fft import rfft

from testbed.metrics.spectra import HANN, cosine_window
from testbed.pointing.inputs import NOISE, TRUTH, UNKNOWN

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping

    from numpy.typing import NDArray

    from testbed.signals import ComplexArray, FloatArray

    # By sensor and term: two-sided density at the input, Hz -> rad^2/s.
    TermDensities = Mapping[str, Mapping[str, Callable[[FloatArray], FloatArray]]]

_LONGEST, _SHORTEST, _SEGMENTS = 1 << 16, 64, 16
# Bands wide enough that a few segments tell the gains, narrow enough that these are constant in them.
_BAND, _FEWEST = 10.0 ** (1.0 / 20.0), 4
_RESIDUAL, _KNOWLEDGE = "residual", "knowledge"
# What the knowledge has beside the noise of the sensors.
BELIEF_ERROR, LAG = "belief_error", "lag"


class BandSpectra:
    r"""Cross spectra of several signals in bands of a twentieth of a decade: Welch, Hann window, half overlap.

    .. math:: C_{ij}(b) = \sum_{f \in b} \langle X_i(f) X_j^*(f) \rangle

    scaled so that the sum of :math:`\mathrm{Re}\, C_{ij}` over all bands is the covariance.

    Parameters
    ----------
    sample_rate_hz : float
        Rate of the samples [Hz].
    n_segment : int
        Samples of a segment.
    """

    def __init__(self, sample_rate_hz: float, n_segment: int) -> None:
        self._window: FloatArray = cosine_window(HANN, n_segment)
        freq = np.arange(1, n_segment // 2 + 1) * (sample_rate_hz / n_segment)
        self._first = _band_starts(freq.size)
        count = np.diff(self._first, append=freq.size)
        self.freq_hz: FloatArray = np.add.reduceat(freq, self._first) / count
        self._scale = 2.0 / (n_segment * float(np.sum(self._window**2)))
        self._pending = np.empty((0, 0))
        self._total: ComplexArray = np.zeros((0, 0, 0), dtype=complex)
        self._n = 0

    def process(self, signals: FloatArray) -> None:
        """Take the next samples, shape (n_signal, n_time)."""
        n = self._window.size
        self._pending = signals if not self._pending.size else np.concatenate([self._pending, signals], axis=1)
        while self._pending.shape[1] >= n:
            self._add(self._pending[:, :n])
            self._pending = self._pending[:, n - n // 2 :]

    def _add(self, part: FloatArray) -> None:
        X = rfft(part * self._window)[:, 1:]
        products = np.add.reduceat(X[:, None] * X[None].conj(), self._first, axis=2)
        self._total = products if not self._n else self._total + products
        self._n += 1

    @property
    def spectra(self) -> ComplexArray | None:
        """C, shape (n_signal, n_signal, n_band) [unit^2]; None without a segment."""
        return self._total * (self._scale / self._n) if self._n else None


def _band_starts(n_freq: int) -> NDArray[np.int64]:
    """Return the index of the first frequency of each band; index i is at i + 1 steps."""
    starts = [0]
    while (after := max(round((starts[-1] + 1) * _BAND), starts[-1] + _FEWEST)) + _FEWEST <= n_freq:
        starts.append(after)
    return np.array(starts)


class KnowledgeSplit:
    """Takes what went into the knowledge and returns how it is made up.

    Parameters
    ----------
    sample_rate_hz : float
        Rate of the samples [Hz].
    n_time : int
        Samples of the record.
    terms : mapping
        Densities of the noise of each sensor by term, for the shares within a sensor.
    """

    def __init__(self, sample_rate_hz: float, n_time: int, terms: TermDensities) -> None:
        segment = min(n_time // _SEGMENTS, _LONGEST)
        self._spectra = BandSpectra(sample_rate_hz, segment) if segment >= _SHORTEST else None
        self._names: tuple[str, ...] = ()
        self._terms = terms

    def process(self, inputs: Mapping[str, FloatArray], knowledge: FloatArray, residual: FloatArray) -> None:
        """Take the next samples [rad], each of shape (n_time,).

        Parameters
        ----------
        inputs : mapping of str to ndarray, shape (n_time,)
            What went into the filter, passed through integral, mirror and tracker.
        knowledge, residual : ndarray, shape (n_time,)
            The knowledge's part of the residual, and the residual.
        """
        if self._spectra is not None:
            self._names = (*inputs, _KNOWLEDGE, _RESIDUAL)
            self._spectra.process(np.stack([*inputs.values(), knowledge, residual]))

    def result(self) -> dict[str, dict[str, Any]]:
        """Return, by sensor, for ``belief_error`` and for ``lag``, `covariance` with the residual and `variance`
        [rad^2]; of a sensor's noise `terms`, the parts of that covariance. Nothing from too short a record.
        """
        C = None if self._spectra is None else self._spectra.spectra
        if C is None or not np.all(np.isfinite(C)):
            return {}
        table: dict[str, dict[str, Any]] = {}
        for name, row in self._rows(C).items():
            along = np.einsum("sb,sb->b", row, C[:, self._names.index(_RESIDUAL)]).real
            variance = np.einsum("sb,stb,tb->", row, C, row.conj()).real
            terms = self._by_term(name, along)
            table[name] = {"covariance": float(along.sum()), "variance": float(variance), "terms": terms}
        return table

    def _rows(self, C: ComplexArray) -> dict[str, ComplexArray]:
        """Return each part as a combination of the signals, shape (n_signal, n_band)."""
        place = {name: i for i, name in enumerate(self._names)}
        sensors = [name.removeprefix(NOISE) for name in self._names if name.startswith(NOISE)]
        gains = self._gains(C, [place[TRUTH], *(place[f"{NOISE}{name}"] for name in sensors)])
        rows = {name: np.zeros(C.shape[1:], dtype=complex) for name in (*sensors, BELIEF_ERROR, LAG)}
        for name, H in zip(sensors, gains[1:], strict=True):
            rows[name][place[f"{NOISE}{name}"]] = H
            rows[BELIEF_ERROR][place[f"{UNKNOWN}{name}"]] = H
        rows[LAG][place[_KNOWLEDGE]] = 1.0
        rows[LAG] -= np.sum([rows[name] for name in (*sensors, BELIEF_ERROR)], axis=0)
        return rows

    def _gains(self, spectra: ComplexArray, inputs: list[int]) -> ComplexArray:
        """Return H of each input, shape (n_input, n_band), by least squares."""
        among = np.moveaxis(spectra[np.ix_(inputs, inputs)], 2, 0)
        with_k = np.moveaxis(spectra[self._names.index(_KNOWLEDGE), inputs], 1, 0)
        # Inputs differ by many orders of magnitude; one that is zero has no H.
        size = np.sqrt(np.einsum("bii->bi", among).real)
        size[size == 0.0] = np.inf
        scaled = among / (size[:, :, None] * size[:, None, :])
        # k X_j* = sum_i H_i X_i X_j*: the transpose of the inputs' matrix.
        H = np.einsum("bij,bj->bi", np.linalg.pinv(np.swapaxes(scaled, 1, 2)), with_k / size) / size
        gains: ComplexArray = H.T
        return gains

    def _by_term(self, sensor: str, along: FloatArray) -> dict[str, float]:
        """Return the parts of a covariance; at each frequency the terms share it as their densities do."""
        assert self._spectra is not None
        freq = self._spectra.freq_hz
        densities = {name: psd(freq) for name, psd in self._terms.get(sensor, {}).items()}
        whole = np.sum(list(densities.values()), axis=0) if densities else np.zeros(freq.size)
        known = np.isfinite(whole) & (whole > 0.0)
        if not known.any():
            return {}
        # Where no density is known, such as beyond a sensor's clock, they share it as on the whole.
        parts = {name: float(np.sum(along[known] * one[known] / whole[known])) for name, one in densities.items()}
        total, all_of_it = sum(parts.values()), float(along.sum())
        return {name: part * all_of_it / total for name, part in parts.items()} if total else {}
