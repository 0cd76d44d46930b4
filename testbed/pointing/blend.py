r"""How an optical tracker and an integrated rate share the line of sight: the sensitivity, its gains and its margins.

The tracker measures the residual e = u - c, u the error of the feed-forward; c is its correction:

.. math:: \dot c = b + k_1 (e + n), \quad \dot b = k_2 (e + n)

so that e = S u - T n with S = s^2 / (s^2 + k_1 s + k_2), T = 1 - S, and the loop is L = (k_1 s + k_2) / s^2.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from testbed.signals import transfer

if TYPE_CHECKING:
    from collections.abc import Callable

    from testbed.signals import ComplexArray, FloatArray

# Where the rate's error is looked at, as parts of the tracker's bandwidth; 40 points per decade.
_BELOW, _ABOVE, _POINTS = 1e-5, 1e3, 321
# The gains of a blend lie down to this part of the tracker's own.
_LEAST = 1e-4


class Gains(NamedTuple):
    """Gains of the tracker's correction.

    Parameters
    ----------
    angle : float
        k_1 [1/s].
    rate : float
        k_2 [1/s^2].
    """

    angle: float
    rate: float

    def sensitivity(self, freq_hz: FloatArray) -> ComplexArray:
        """Return S [-] at frequencies [Hz], complex, shape (n_freq,)."""
        return transfer([1.0, 0.0, 0.0], [1.0, self.angle, self.rate], freq_hz)

    @property
    def noise_bandwidth_hz(self) -> float:
        r"""Two-sided bandwidth :math:`\int |T|^2 df = (k_1^2 + k_2) / (2 k_1)` [Hz]: times r^2 it is the variance that
        the tracker's noise leaves.
        """
        return (self.angle**2 + self.rate) / (2.0 * self.angle)


def butterworth_gains(bandwidth_hz: float) -> Gains:
    """Return the gains whose S is the second-order Butterworth high-pass: k_1 = sqrt(2) w, k_2 = w^2.

    Parameters
    ----------
    bandwidth_hz : float
        w / (2 pi), where |S| is 0.707 [Hz].
    """
    w = 2.0 * math.pi * bandwidth_hz
    return Gains(math.sqrt(2.0) * w, w**2)


def best_gains(rate_psd: Callable[[FloatArray], FloatArray], noise: float, bandwidth_hz: float) -> Gains:
    r"""Return the gains that leave the least error of rate and tracker together, within the tracker's bandwidth.

    .. math:: \min_{k_1 \le \sqrt{2} w,\ k_2 \le w^2}
        \int |S|^2 \frac{S_\omega}{(2 \pi f)^2} df + r^2 \frac{k_1^2 + k_2}{2 k_1}

    For white noise N and random walk K of the rate it is the settled Kalman filter, k_2 = K / r and k_1^2 = N^2 / r^2 +
    2 k_2; without noise of the tracker the Butterworth high-pass of its bandwidth.

    Parameters
    ----------
    rate_psd : callable
        Two-sided density of the error of the rate, Hz -> rad^2/s.
    noise : float
        r, two-sided root density of the tracker's noise [rad/sqrt(Hz)].
    bandwidth_hz : float
        w / (2 pi) of the tracker [Hz].

    Returns
    -------
    Gains
        k_1 and k_2.
    """
    most = butterworth_gains(bandwidth_hz)
    if noise == 0.0:
        return most
    from scipy.optimize import minimize

    freq = bandwidth_hz * np.logspace(math.log10(_BELOW), math.log10(_ABOVE), _POINTS)
    angle_psd = rate_psd(freq) / (2.0 * np.pi * freq) ** 2

    def cost(place: FloatArray) -> float:
        gains = Gains(most.angle * math.exp(place[0]), most.rate * math.exp(place[1]))
        left = np.abs(gains.sensitivity(freq)) ** 2 * angle_psd
        whole = 2.0 * np.trapezoid(left * freq, np.log(freq)) + noise**2 * gains.noise_bandwidth_hz
        return math.log(whole)

    bounds = [(math.log(_LEAST), 0.0), (2.0 * math.log(_LEAST), 0.0)]
    tried = [minimize(cost, start, bounds=bounds, tol=1e-14) for start in ((-0.1, -0.2), (-3.0, -6.0), (-6.0, -12.0))]
    place = min(tried, key=lambda one: float(one.fun)).x
    return Gains(most.angle * math.exp(place[0]), most.rate * math.exp(place[1]))


class Margins(NamedTuple):
    """How far the tracker's loop is from its edge.

    Parameters
    ----------
    gain_db, phase_deg : float
        Margins; infinite where the phase, or the gain, never crosses.
    crossover_hz : float
        Where |L| = 1 [Hz].
    stable : bool
        Whether both are positive.
    """

    gain_db: float
    phase_deg: float
    crossover_hz: float
    stable: bool


def loop_margins(gains: Gains, mirror: Callable[[FloatArray], ComplexArray], delay: float) -> Margins:
    r"""Return the margins of the loop :math:`L(s) = (k_1 s + k_2) / s^2 \cdot M(s)\, e^{-s \tau}`.

    Parameters
    ----------
    gains : Gains
        Of the tracker.
    mirror : callable
        M, Hz -> complex [-].
    delay : float
        tau, of tracker, computation and holds [s].

    Returns
    -------
    Margins
        The smallest of all crossings, by `control.stability_margins` over the frequency response.
    """
    import control

    unit = math.sqrt(gains.rate) / (2.0 * math.pi)
    freq = unit * np.logspace(-2.0, 5.0, 561)
    s = 2j * np.pi * freq
    response = (gains.angle * s + gains.rate) / s**2 * mirror(freq) * np.exp(-s * delay)
    # Beyond these the response has no part in a crossing, and its phase would outrun the grid.
    seen = (np.abs(response) > 1e-3) & (freq * delay < 3.0)
    magnitude, phase = np.abs(response[seen]), np.rad2deg(np.unwrap(np.angle(response[seen])))
    # At the low end the double integrator alone is left: -180 deg.
    phase -= 360.0 * np.round((phase[0] + 180.0) / 360.0)
    crossings = (magnitude, phase, 2.0 * np.pi * freq[seen])
    gains_there, phases, _, _, crossed, _ = control.stability_margins(crossings, returnall=True)
    gain_db = 20.0 * math.log10(min(gains_there, default=math.inf))
    at = int(np.argmin(phases)) if len(phases) else 0
    margin = float(phases[at]) if len(phases) else math.inf
    crossover = float(crossed[at]) / (2.0 * math.pi) if len(phases) else 0.0
    return Margins(gain_db, margin, crossover, gain_db > 0.0 and margin > 0.0)
