r"""The noise of sensors that feel the same motion: of two it is that of both, of three it is each one's own.

What an output has beside what follows a reference is :math:`r_i = n_i - G_i n_x`, its own noise and the reference's.
With one output nothing tells them apart: beside a reference that is as noisy as the sensor the estimate is twice too
large. With two,

.. math:: S_x = \mathrm{Re} \frac{\langle r_1 r_2^* \rangle}{G_1 G_2^*}, \quad
    S_i = \langle |r_i|^2 \rangle - |G_i|^2 S_x

as long as the three noises have nothing to do with each other.

References
----------
R. Sleeman, A. van Wettum, J. Trampert (2006), Bull. Seismol. Soc. Am. 96(1):258-271.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from testbed.identification.local import fit_local
from testbed.identification.matching import OutputClock, common_grid
from testbed.identification.response import NoiseFloor
from testbed.identification.spectrum import Series, spectrum
from testbed.identification.windows import spectrum_parts

if TYPE_CHECKING:
    from testbed.signals import FloatArray

# An output noise this much below the input noise keeps R positive and changes nothing.
_LEAST_OUTPUT = 3e-4
_ROUNDS = 50


class Heard(NamedTuple):
    """An output, its clock, and the delay that is taken off before the fits [s]."""

    series: Series
    clock: OutputClock
    lag: float


class ThreeFloors(NamedTuple):
    """Noise of a reference and of two outputs [rad^2/s], and how many standard deviations the reference's is above
    zero.
    """

    reference: NoiseFloor
    first: NoiseFloor
    second: NoiseFloor
    evidence: float


def three_floors(reference: Series, first: Heard, second: Heard) -> ThreeFloors:
    """Return the noise of the reference and of both outputs, each its own.

    Parameters
    ----------
    reference : Series
        The channel that both outputs follow.
    first, second : Heard
        The outputs.

    Returns
    -------
    ThreeFloors
        Estimates may fall below zero where a noise is much the smallest.
    """
    grid = common_grid(reference, [(one.series, one.clock.error) for one in (first, second)])
    freq, X = grid.freq_hz, spectrum(reference, grid)[0]
    parts = spectrum_parts(np.abs(X) ** 2)
    both = []
    for one in (first, second):
        Y, Z = (np.exp(2j * np.pi * freq * one.lag) * part for part in spectrum(one.series, grid, one.clock.error))
        both.append([fit_local(part, freq, X, Y, Z) for part in parts])
    levels, evidence = [], []
    for a, b in zip(*both, strict=True):
        gains = a.response * np.conj(b.response)
        of_reference = float((np.vdot(b.rest, a.rest) / a.freedom / gains).real)
        levels.append([of_reference, *(one.noise - abs(one.response) ** 2 * of_reference for one in (a, b))])
        evidence.append(of_reference * abs(gains) / np.sqrt(a.noise * b.noise / (2.0 * a.freedom)))
    middle, freedom = (
        np.array([getattr(one, name) for one in both[0]], dtype=float) for name in ("noise_hz", "freedom")
    )
    own, a_floor, b_floor = (NoiseFloor(middle, row / grid.length, freedom) for row in np.array(levels).T)
    return ThreeFloors(own, a_floor, b_floor, float(np.sum(evidence) / np.sqrt(len(evidence))))


class NoiseFit(NamedTuple):
    """Noise as a belief names it: root densities before and behind the dynamics [rad/sqrt(s)], the knee of 1/f noise
    behind them [Hz], and the coefficient of 1/f noise before them [rad/s].
    """

    inner: float
    outer: float
    knee: float | None
    instability: float

    def density(self, freq_hz: FloatArray, gain: FloatArray) -> FloatArray:
        """Return the density on the reading [rad^2/s], shape (n_freq,), at frequencies [Hz] and the gains there [-]."""
        behind = self.outer**2 * (1.0 + (self.knee or 0.0) / freq_hz)
        value: FloatArray = behind + gain**2 * (self.inner**2 + self.instability**2 / (2.0 * np.pi * freq_hz))
        return value


def fit_noise(floor: NoiseFloor, gain: FloatArray, *, slow_before: bool) -> NoiseFit:
    r"""Return white noise before and behind the dynamics and 1/f noise that fit a floor.

    .. math:: S(f) = |G|^2 a + b + c / f, \quad a, b, c \ge 0

    by maximum likelihood, each density a sum of squares of its degrees of freedom, :math:`\max -\sum_k \nu_k (D_k / S_k
    + \ln S_k)`: non-negative least squares of :math:`(D_k - S_k) / S_k` with the last S below the line until it
    settles. With D below it a value that is low by chance would count for more.

    Parameters
    ----------
    floor : NoiseFloor
        Of the reading; densities at or below zero are left out.
    gain : ndarray, shape (n_freq,)
        |G| at its frequencies [-].
    slow_before : bool
        Whether the 1/f noise passes the dynamics, as a bias does: |G|^2 c / f.
    """
    known = floor.density > 0.0
    freq, density, power = floor.freq_hz[known], floor.density[known], gain[known] ** 2
    terms = np.stack([power, np.ones(density.size), (power if slow_before else 1.0) / freq], axis=1)
    a, b, c = _likeliest(terms, density, floor.freedom[known])
    if slow_before:
        outer = max(float(np.sqrt(b)), _LEAST_OUTPUT * float(np.sqrt(max(a, c / float(freq.max())))))
        return NoiseFit(float(np.sqrt(a)), outer, None, float(np.sqrt(2.0 * np.pi * c)))
    # A knee stands on white noise; without any that is put where the band ends.
    outer = max(float(np.sqrt(b if b > 0.0 else c / float(freq.max()))), _LEAST_OUTPUT * float(np.sqrt(a)))
    return NoiseFit(float(np.sqrt(a)), outer, float(c / outer**2) if c > 0.0 else None, 0.0)


def _likeliest(terms: FloatArray, density: FloatArray, freedom: FloatArray) -> FloatArray:
    """Return the levels of the terms, shape (n_term,), none below zero, that make densities the likeliest."""
    from scipy.optimize import nnls

    believed, level = density, np.zeros(terms.shape[1])
    for _ in range(_ROUNDS):
        weight = np.sqrt(freedom) / believed
        rows = terms * weight[:, None]
        size = np.linalg.norm(rows, axis=0)
        before, level = level, nnls(rows / size, weight * density)[0] / size
        believed = terms @ level
        if np.allclose(level, before, rtol=1e-6, atol=0.0):
            break
    return level
