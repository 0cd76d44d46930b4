"""What becomes of commanded lines: gain and phase by least squares, and what the error beside each leaves unsure."""

from __future__ import annotations

import itertools
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from scipy.special import stdtrit

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from testbed.signals import FloatArray

# Parts of the record of which sums are kept: as many phases as the offsets below need, to 2 % of their amplitude.
_PARTS = 64
# Offsets from a line, in periods of the record, at which the error is looked at.
_OFFSETS = (-3, -2, -1, 1, 2, 3)
_LEAST_NEIGHBOURS = 2
# A line that is not in the truth (a fixed table) has no gain: below 1e-9 deg/s it is arithmetic noise.
_SMALLEST = np.deg2rad(1e-9)


@dataclass(frozen=True)
class Line:
    """What became of a line.

    Parameters
    ----------
    amplitude : float
        Of the truth [rad/s].
    gain : complex or None
        Estimate over truth [-]; None if the truth has no such line.
    half_width : float or None
        Of the 95 % interval of real and imaginary part of `gain` [-], None if unknown.
    """

    amplitude: float
    gain: complex | None
    half_width: float | None

    def phase_half_width(self) -> float | None:
        """Return the half width of the 95 % interval of the phase [deg], 180 if the line is lost in the noise."""
        if self.gain is None or self.half_width is None:
            return None
        return (
            float(np.rad2deg(np.arcsin(self.half_width / abs(self.gain))))
            if self.half_width < abs(self.gain)
            else 180.0
        )


class Waves:
    """Cosine and sine of each line at the times of a block, worked out once for all fits that share it.

    Parameters
    ----------
    lines : sequence of float
        Frequencies [Hz].
    """

    def __init__(self, lines: Sequence[float]) -> None:
        self.lines = tuple(lines)
        self._t: FloatArray | None = None
        self._basis = np.empty((0, 0))
        self._span: tuple[float, float] | None = None
        self._pieces: list[Piece] | None = None

    def at(self, t: FloatArray) -> FloatArray:
        """Return cos and sin of each line [-], shape (2 n_line, n_time), those of the last call if it was for the same
        array.

        Parameters
        ----------
        t : ndarray, shape (n_time,)
            Time [s], not changed as long as it is in use.
        """
        if t is not self._t:
            turns = [2.0 * np.pi * line * t for line in self.lines]
            self._basis = np.array([f(turn) for turn in turns for f in (np.cos, np.sin)])
            self._t, self._pieces = t, None
        return self._basis

    def pieces(self, t: FloatArray, span: tuple[float, float] | None) -> list[Piece]:
        """Return the pieces of a block, each in one part of the record; those of the last call if it was for the same.

        Parameters
        ----------
        t : ndarray, shape (n_time,)
            As for `at`.
        span : tuple of two floats, optional
            From when to when the record lasts [s]; without it all is one part.
        """
        basis = self.at(t)
        if self._pieces is None or span != self._span:
            self._span = span
            parts = _part_of(t, span)
            cuts = [0, *(np.flatnonzero(np.diff(parts)) + 1), t.size]
            self._pieces = [
                Piece(int(parts[a]), slice(a, b), basis[:, a:b], basis[:, a:b] @ basis[:, a:b].T)
                for a, b in itertools.pairwise(cuts)
            ]
        return self._pieces


@dataclass(frozen=True)
class Piece:
    """Samples of a block in one part of the record.

    Parameters
    ----------
    part : int
        Number of the part.
    samples : slice
        Which.
    basis : ndarray, shape (2 n_line, n_sample)
        Cosine and sine of the lines [-].
    gram : ndarray, shape (2 n_line, 2 n_line)
        Their products, summed [-].
    """

    part: int
    samples: slice
    basis: FloatArray
    gram: FloatArray


def _part_of(t: FloatArray, span: tuple[float, float] | None) -> NDArray[np.int64]:
    if span is None:
        return np.zeros(t.size, dtype=np.int64)
    start, stop = span
    return np.clip(((t - start) / (stop - start) * _PARTS).astype(np.int64), 0, _PARTS - 1)


class LineFit:
    r"""Least-squares fit of lines to an error and to the truth, from sums over 64 parts of the record.

    The fitted phasor c of the error is a Fourier coefficient of its noise, whose two quadratures each have the variance

    .. math:: \sigma_c^2 = 2 S(f) / T = \frac{2}{n^2} \left\langle |X(f + k/T)|^2 \right\rangle_k

    with S the two-sided density of the error at the line, estimated without any assumption on its colour from the
    discrete Fourier transform X of the residual (error without the lines) at k = +-1, 2, 3 periods of the record T from
    the line; offsets that meet zero frequency or another line are left out. With m of them the estimate has 2 m degrees
    of freedom, so the 95 % interval of a quadrature is c +- t(2 m) sigma_c (Student's t), and that of gain and phase
    its share of the truth's amplitude.

    Parameters
    ----------
    waves : Waves
        The lines.
    span : tuple of two floats, optional
        From when to when samples come [s]; without it no interval is known.

    References
    ----------
    M. B. Priestley (1981), Spectral Analysis and Time Series, section 6.1.3: harmonic analysis in coloured noise.
    """

    def __init__(self, waves: Waves, span: tuple[float, float] | None = None) -> None:
        self._waves, self.lines, self._span = waves, waves.lines, span
        self._n_parts = 1 if span is None else _PARTS
        n = 2 * len(self.lines)
        self._n = 0
        self._gram = np.zeros((self._n_parts, n, n))
        self._with_error = np.zeros((self._n_parts, n))
        self._with_truth = np.zeros(n)

    def add(self, t: FloatArray, error: FloatArray, truth: FloatArray) -> None:
        """Add samples.

        Parameters
        ----------
        t : ndarray, shape (n_time,)
            Time [s], increasing.
        error, truth : ndarray, shape (n_time,)
            Rates [rad/s].
        """
        if not self.lines:
            return
        self._n += t.size
        self._with_truth += self._waves.at(t) @ truth
        for piece in self._waves.pieces(t, self._span):
            self._gram[piece.part] += piece.gram
            self._with_error[piece.part] += piece.basis @ error[piece.samples]

    def result(self) -> list[Line]:
        """Return what became of each line."""
        if not self.lines:
            return []
        gram = self._gram.sum(axis=0)
        truth = _phasors(np.linalg.lstsq(gram, self._with_truth, rcond=None)[0])
        fit = np.linalg.lstsq(gram, self._with_error.sum(axis=0), rcond=None)[0]
        found = zip(truth, _phasors(fit), self._half_widths(fit), strict=True)
        return [
            Line(abs(c), 1.0 + e / c, None if half is None else half / abs(c))
            if abs(c) > _SMALLEST
            else Line(abs(c), None, None)
            for c, e, half in found
        ]

    def explained(self) -> float:
        """Return the sum of squares of the error that its fitted lines hold [rad^2/s^2]."""
        if not self.lines:
            return 0.0
        gram, projection = self._gram.sum(axis=0), self._with_error.sum(axis=0)
        fit = np.linalg.lstsq(gram, projection, rcond=None)[0]
        return float(2.0 * fit @ projection - fit @ gram @ fit)

    def _half_widths(self, fit: FloatArray) -> list[float | None]:
        """Return the half width of the 95 % interval of each phasor of the error [rad/s]."""
        if self._span is None or self._n <= 2 * fit.size:
            return [None] * len(self.lines)
        rest = self._with_error - self._gram @ fit
        phasors = rest[:, ::2] - 1j * rest[:, 1::2]
        return [self._half_width(line, phasors[:, i]) for i, line in enumerate(self.lines)]

    def _half_width(self, line: float, rest: FloatArray) -> float | None:
        assert self._span is not None
        length = self._span[1] - self._span[0]
        middle = (np.arange(_PARTS) + 0.5) / _PARTS
        powers = [
            # A part of the record is no instant: what its sum loses of an offset is known.
            abs(np.sum(rest * np.exp(-2j * np.pi * k * middle))) ** 2 / np.sinc(k / _PARTS) ** 2
            for k in _OFFSETS
            if self._is_free(line + k / length, line, length)
        ]
        if len(powers) < _LEAST_NEIGHBOURS:
            return None
        sigma = np.sqrt(2.0 * np.mean(powers)) / self._n
        return float(stdtrit(2 * len(powers), 0.975) * sigma)

    def _is_free(self, frequency: float, line: float, length: float) -> bool:
        """Return whether no other line, nor zero frequency, lies within a period of the record."""
        others = [0.0, *(other for other in self.lines if other != line)]
        return frequency > 0.0 and all(abs(frequency - other) * length >= 0.999 for other in others)


def _phasors(fit: FloatArray) -> list[complex]:
    """Return c = p - j q of each fitted p cos + q sin, so that the line is Re(c exp(j w t))."""
    return [complex(p, -q) for p, q in fit.reshape(-1, 2)]
