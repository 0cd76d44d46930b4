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

from testbed.identification.local import LocalFit, fit_local
from testbed.identification.matching import OutputClock, common_grid
from testbed.identification.response import NoiseFloor, chance_limit
from testbed.identification.spectrum import Series, spectrum
from testbed.identification.windows import spectrum_parts

if TYPE_CHECKING:
    from testbed.signals import FloatArray

# An output noise this much below the input noise keeps R positive and changes nothing.
_LEAST_OUTPUT = 3e-4
_ROUNDS = 50
# Values whose middle one is about the density there, to begin with.
_NEIGHBOURS = 9


class Heard(NamedTuple):
    """An output, its clock, and the delay that is taken off before the fits [s]."""

    series: Series
    clock: OutputClock
    lag: float


class ThreeFloors(NamedTuple):
    """Noise of a reference and of two outputs [rad^2/s], and how many standard deviations each is above zero."""

    reference: NoiseFloor
    first: NoiseFloor
    second: NoiseFloor
    evidence: tuple[float, float, float]


def three_floors(reference: Series, first: Heard, second: Heard) -> ThreeFloors:
    r"""Return the noise of the reference and of both outputs, each its own.

    Parameters
    ----------
    reference : Series
        The channel that both outputs follow.
    first, second : Heard
        The outputs.

    Returns
    -------
    ThreeFloors
        Estimates may fall below zero where a noise is much the smallest. The evidence takes the standard deviation that
        they have where that noise is none, :math:`|G_i|^2 / |G_1 G_2| \sqrt{\langle |r_1|^2 \rangle \langle |r_2|^2
        \rangle / 2 \nu}`, nu the degrees of freedom and G of the reference 1.
    """
    grid = common_grid(reference, [(one.series, one.clock.error) for one in (first, second)])
    freq, X = grid.freq_hz, spectrum(reference, grid)[0]
    parts = spectrum_parts(np.abs(X) ** 2)
    both = []
    for one in (first, second):
        Y, Z = (np.exp(2j * np.pi * freq * one.lag) * part for part in spectrum(one.series, grid, one.clock.error))
        both.append([fit_local(part, freq, X, Y, Z) for part in parts])
    limit = chance_limit(len(parts))
    pairs = [(one, other) for one, other in zip(*both, strict=True) if max(one.chance, other.chance) < limit]
    told = np.array([_told(*pair) for pair in pairs]).reshape(-1, 2, 3)
    freq_hz, freedom = np.array([(one.noise_hz, one.freedom) for one, _ in pairs], dtype=float).reshape(-1, 2).T
    own, of_first, of_second = (NoiseFloor(freq_hz, level / grid.length, freedom) for level in told[:, 0].T)
    sure = told[:, 1].sum(axis=0) / np.sqrt(max(len(pairs), 1))
    return ThreeFloors(own, of_first, of_second, (float(sure[0]), float(sure[1]), float(sure[2])))


def _told(first: LocalFit, second: LocalFit) -> tuple[FloatArray, FloatArray]:
    """Return what a part says of the noise of reference, first and second, and over its standard deviation, shapes
    (3,), (3,).
    """
    gains = first.response * np.conj(second.response)
    powers = np.array([1.0, abs(first.response) ** 2, abs(second.response) ** 2])
    common = float((np.vdot(second.rest, first.rest) / first.freedom / gains).real)
    level = powers * common * [1.0, -1.0, -1.0] + [0.0, first.noise, second.noise]
    return level, level * abs(gains) / powers / np.sqrt(first.noise * second.noise / (2.0 * first.freedom))


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
        Of the reading. Densities below zero, as one of three sensors may have, count like all others: without them
        what is left would be too loud.
    gain : ndarray, shape (n_freq,)
        |G| at its frequencies [-].
    slow_before : bool
        Whether the 1/f noise passes the dynamics, as a bias does: |G|^2 c / f.
    """
    freq, power = floor.freq_hz, gain**2
    terms = np.stack([power, np.ones(freq.size), (power if slow_before else 1.0) / freq], axis=1)
    a, b, c = _likeliest(terms, floor.density, floor.freedom)
    if slow_before:
        outer = max(float(np.sqrt(b)), _LEAST_OUTPUT * float(np.sqrt(max(a, c / float(freq.max())))))
        return NoiseFit(float(np.sqrt(a)), outer, None, float(np.sqrt(2.0 * np.pi * c)))
    # A knee stands on white noise; without any that is put where the band ends.
    outer = max(float(np.sqrt(b if b > 0.0 else c / float(freq.max()))), _LEAST_OUTPUT * float(np.sqrt(a)))
    return NoiseFit(float(np.sqrt(a)), outer, float(c / outer**2) if c > 0.0 else None, 0.0)


def _likeliest(terms: FloatArray, density: FloatArray, freedom: FloatArray) -> FloatArray:
    """Return the levels of the terms, shape (n_term,), none below zero, that make densities the likeliest."""
    from scipy.ndimage import median_filter
    from scipy.optimize import nnls

    believed, level = median_filter(np.abs(density), _NEIGHBOURS, mode="nearest"), np.zeros(terms.shape[1])
    # Outputs that repeat each other have densities of zero, which no weight can be made of.
    least = 1e-12 * float(believed.max())
    if least == 0.0:
        return level
    for _ in range(_ROUNDS):
        weight = np.sqrt(freedom) / np.maximum(believed, least)
        rows = terms * weight[:, None]
        size = np.linalg.norm(rows, axis=0)
        before, level = level, nnls(rows / size, weight * density)[0] / size
        believed = terms @ level
        if not level.any() or np.allclose(level, before, rtol=1e-6, atol=0.0):
            break
    return level
