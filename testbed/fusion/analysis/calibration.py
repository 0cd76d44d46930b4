r"""Gain and delay of one sensor against another from the readings alone, second after second.

.. math:: a = G_2 z_1, \quad c = G_1 z_2, \quad A(f) = \kappa e^{-j 2 \pi f \tau} C(f) + N(f)

a is the path of the noisy sensor, c that of the clean one (`testbed.fusion.analysis.paths`). What all spectra so far
say is kept by frequency: the sums of :math:`A C^*` and :math:`|C|^2`, weighted by the believed density of N. Their
least squares with a prior (:math:`\kappa` one to 1 %, :math:`\tau` zero to 0.5 ms) are gain, delay and covariance: a
motion too small to tell leaves the prior as it is.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from scipy.fft import rfft, rfftfreq

from testbed.signals import LinearFilter

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from testbed.fusion.belief import SensorBelief
    from testbed.signals import ComplexArray, FloatArray

# Spectra are of the last two blocks, which are a second each.
WINDOW = 2
# Where the two are compared [Hz]: below, what the window leaks of a drift; above a tenth of the rate, holds differ.
_LOWEST_HZ, _HIGHEST_HZ, _HIGHEST_SHARE = 0.4, 200.0, 0.1
_STEPS, _SHRINK = 4, 2.0
# What is missing of a second without harm: so long at a time [s], a straight line there, and such a share of it.
_SHORT_GAP, _MOST_MISSING = 0.01, 0.01


class Calibrated(NamedTuple):
    """Gain and delay of the noisy sensor against the clean one.

    Parameters
    ----------
    gain, delay : float
        kappa [-] and tau [s].
    gain_std, delay_std : float
        Their standard deviations, prior included [-], [s].
    """

    gain: float
    delay: float
    gain_std: float
    delay_std: float

    def applied(self) -> tuple[float, float]:
        r"""Return the gain [-] and the delay [s] to correct by: what stands out of its own uncertainty.

        .. math:: \hat\theta \max\left(0, 1 - (2 \sigma / \hat\theta)^2\right)

        (positive-part shrinkage), so that what is right already is left alone and what is sure is taken whole.
        """
        return 1.0 + _standing(self.gain - 1.0, self.gain_std), _standing(self.delay, self.delay_std)


def _standing(value: float, std: float) -> float:
    return value * max(0.0, 1.0 - (_SHRINK * std / value) ** 2) if value else 0.0


class Calibration:
    """Compares two sensors block after block, at the rate of the slower one.

    Parameters
    ----------
    noisy, clean : SensorBelief
        What is believed of the sensors.
    sample_rate_hz : float
        Of the readings of both as they are given [Hz].
    means : tuple of int
        Of how many readings, from that instant on, each of the noisy and of the clean sensor's is the mean.
    gain_std, delay_std : float
        Of the prior [-], [s].
    at_rest : bool
        Whether the sensors were at rest before the first reading. If not, and after readings that are missing, seconds
        are left out until the dynamics, which begin at rest, have settled.
    """

    def __init__(
        self,
        noisy: SensorBelief,
        clean: SensorBelief,
        sample_rate_hz: float,
        means: tuple[int, int],
        gain_std: float,
        delay_std: float,
        at_rest: bool,
    ) -> None:
        self._through = tuple(
            LinearFilter(*other.polynomials(), sample_rate_hz=sample_rate_hz) for other in (clean, noisy)
        )
        self._block = round(sample_rate_hz)
        n = WINDOW * self._block
        freq = rfftfreq(n, 1.0 / sample_rate_hz)
        self._used = (freq >= _LOWEST_HZ) & (freq <= min(_HIGHEST_HZ, _HIGHEST_SHARE * sample_rate_hz))
        self._freq = freq[self._used]
        self._window = np.hanning(n + 2)[1:-1]
        a, c = (
            np.abs(by.response(self._freq)) ** 2 * _noise(one, self._freq)
            for one, by in ((noisy, clean), (clean, noisy))
        )
        # Each line of a one-sided spectrum stands for two, and overlapping windows count for half.
        self._weight = 2.0 / WINDOW / ((a + c) * sample_rate_hz * float(np.sum(self._window**2)))
        self._own = c * sample_rate_hz * float(np.sum(self._window**2))
        self._taken = np.array([_of_mean(many, self._freq / sample_rate_hz) for many in means])
        self._prior = np.array([gain_std**-2, delay_std**-2])
        self._last = np.full((2, self._block), np.nan)
        # How many blocks the dynamics take to settle, and how many of each path are left of that.
        self._settling = _settling(noisy, clean)
        self._left = [0 if at_rest else self._settling] * 2
        self._cross, self._power = np.zeros(self._freq.size, complex), np.zeros(self._freq.size)
        self._theta = np.array([1.0, 0.0])

    def add(self, noisy: FloatArray, clean: FloatArray) -> Calibrated:
        """Take the readings of the next second and return what is known then.

        Parameters
        ----------
        noisy, clean : ndarray, shape (n_block,)
            Readings of both sensors at the same instants [rad/s], NaN where there is none: of 1 % of them, and of 10 ms
            at a time, a straight line takes the place; with more the second is left out.
        """
        paths = np.array([self._path(i, one) for i, one in enumerate((noisy, clean))])
        both = np.concatenate([self._last, paths], axis=1)
        self._last = paths
        if np.isfinite(both).all():
            level = both.mean(axis=1, keepdims=True)
            A, C = rfft((both - level) * self._window, axis=1)[:, self._used] / self._taken
            self._cross += self._weight * A * C.conj()
            self._power += self._weight * (np.abs(C) ** 2 - self._own)
        return self._solved()

    def _path(self, which: int, z: FloatArray) -> FloatArray:
        """Return a block of one path, missing whole where too much is, and after it until the dynamics have settled."""
        good = np.isfinite(z)
        if not good.all():
            at = np.arange(z.size)
            z = np.interp(at, at[good], z[good]) if good.any() else np.zeros(z.size)
            if not self._bridged(good):
                self._left[which] = self._settling + 1
        path = self._through[which].process(z)
        if self._left[which] == 0:
            return path
        self._left[which] -= 1
        return np.full(path.size, math.nan)

    def _bridged(self, good: NDArray[np.bool_]) -> bool:
        """Return whether so little of a block is missing that a straight line stands for it."""
        there = np.concatenate([[-1], np.flatnonzero(good), [good.size]])
        longest = (np.diff(there).max() - 1) / self._block
        return bool(longest <= _SHORT_GAP and 1.0 - good.mean() <= _MOST_MISSING)

    def _solved(self) -> Calibrated:
        """Return the least squares of the sums and the prior by Gauss-Newton steps."""
        omega = 2.0 * math.pi * self._freq
        normal = np.diag(self._prior)
        for _ in range(_STEPS):
            gain, delay = self._theta
            turned = self._cross * np.exp(1j * omega * delay)
            # Of A - kappa e^(-j w tau) C against its derivatives by kappa and tau.
            right = np.array(
                [
                    float(np.sum(turned.real - gain * self._power)),
                    float(np.sum(-omega * gain * turned.imag)),
                ]
            )
            information = np.array([float(self._power.sum()), gain**2 * float(np.sum(omega**2 * self._power))])
            normal = np.diag(np.maximum(information, 0.0) + self._prior)
            step = np.linalg.solve(normal, right - self._prior * (self._theta - [1.0, 0.0]))
            self._theta = self._theta + step
        std = np.sqrt(1.0 / np.diag(normal))
        return Calibrated(*map(float, (*self._theta, *std)))


def _settling(*beliefs: SensorBelief) -> int:
    """Return after how many seconds a thousandth is left of what dynamics start with, slower ones than compared aside.

    What is slower than the lowest frequency is smooth, and the window keeps it out.
    """
    poles = np.concatenate([np.roots(one.polynomials()[1]) for one in beliefs])
    seen = -poles.real[-poles.real > 2.0 * math.pi * _LOWEST_HZ]
    return math.ceil(math.log(1e3) / seen.min()) if seen.size else 1


def _noise(one: SensorBelief, freq_hz: FloatArray) -> FloatArray:
    """Return the believed density of the readings' noise [rad^2/s]."""
    power = np.abs(one.response(freq_hz)) ** 2
    density: FloatArray = power * one.input_noise**2 + one.output_noise**2 + one.slow_density(freq_hz)
    return density


def _of_mean(many: int, turns: FloatArray) -> ComplexArray:
    """Return the response of a mean of so many readings over a step that is so many turns long, from its begin on."""
    value: ComplexArray = np.exp(2j * math.pi * np.outer(turns, np.arange(many) / many)).mean(axis=1)
    return value
