r"""The loop that holds the fast path to the slow one, and the shape of it that comes closest to the two-sensor bound.

.. math:: \dot u = k e + c, \quad \dot c = q e - z c, \quad
    1 - L = \frac{s (s + z)}{s^2 + (z + k) s + z k + q}

With q = 0 this is the low-pass of order 1, with z = 0 and :math:`k^2 = 2 q` the Butterworth one of order 2.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from collections.abc import Callable

    from testbed.signals import FloatArray

# Where the fused density is held to the bound [Hz]; points of the search.
SHAPED_FROM_HZ, SHAPED_TO_HZ, _POINTS = 1e-5, 1e3, 241
# The search starts from the best first-order loop, with a weak slope that is left at a few times its crossover.
_LEAK, _SLOPE = 3.0, 0.5
# The slowest leak, the fastest loop [rad/s], and the least slope over k z [-].
_SLOWEST, _FASTEST, _LEAST_SLOPE = 0.2 * math.pi * SHAPED_FROM_HZ, 0.2 * math.pi * SHAPED_TO_HZ, 1e-3
_WHOLE = (np.ones(1), np.ones(1))
_SEARCH = {"xatol": 1e-4, "fatol": 1e-5, "maxiter": 600}


@dataclass(frozen=True)
class Loop:
    """Gains of the loop.

    Parameters
    ----------
    gain : float
        k [rad/s].
    slope_gain : float
        q [rad^2/s^2].
    leak : float
        z [rad/s].
    crossover : float
        The loop of order 1 that stands for it while it starts, which lets as much white noise of the slow path through
        [rad/s].
    """

    gain: float
    slope_gain: float
    leak: float
    crossover: float

    def low_pass(self) -> tuple[FloatArray, FloatArray]:
        """Return numerator and denominator of L in s, highest power first."""
        if not self.slope_gain:
            return np.array([self.gain]), np.array([1.0, self.gain])
        last = self.leak * self.gain + self.slope_gain
        return np.array([self.gain, last]), np.array([1.0, self.leak + self.gain, last])


def butterworth_loop(order: int, w: float) -> Loop:
    """Return the loop whose L has Butterworth poles at w [rad/s], of order 1 or 2."""
    return Loop(gain=math.sqrt(order) * w, slope_gain=w**2 if order == 2 else 0.0, leak=0.0, crossover=w)


def shaped_loop(
    slow_psd: Callable[[FloatArray], FloatArray],
    fast_psd: Callable[[FloatArray], FloatArray],
    band: tuple[FloatArray, FloatArray] = _WHOLE,
    lag: Callable[[FloatArray], FloatArray] = np.zeros_like,
) -> Loop:
    r"""Return the loop of two poles whose fused density exceeds the two-sensor bound least, where it does so most.

    .. math:: \min_{k, z, q} \max_f \frac{|B L|^2 S_{slow} + |1 - L|^2 S_{fast}}{1 / (1 / S_{slow} + 1 / S_{fast})}

    over 10 uHz ... 1 kHz. The mean square of all of it counts like one frequency more, over the bound's, and in it what
    comes through L of the sine that the slow path gets wrong most.

    Parameters
    ----------
    slow_psd, fast_psd : callable
        Input-referred two-sided noise densities of the sensor that is better at low frequency, and of the other, Hz ->
        rad^2/s.
    band : tuple of ndarray, shapes (n_num,), (n_den,), optional
        Numerator and denominator in s of B, the band end of the slow path by itself; none if not given.
    lag : callable, optional
        How the slow path by itself errs for a sine, in mean square, Hz -> rad^2/s^2.

    References
    ----------
    Dehaeze, Verma, Collette, "Complementary filters shaping using H-infinity synthesis", Int. Conf. Control,
    Mechatronics and Automation (2019) (the same norm, over filters of any order: `examples/shaped_blends.py`).
    """
    from scipy.optimize import minimize, minimize_scalar

    freq = np.geomspace(SHAPED_FROM_HZ, SHAPED_TO_HZ, _POINTS)
    s = 2j * np.pi * freq
    of_slow, of_fast, late = slow_psd(freq), fast_psd(freq), lag(freq)
    ended = np.abs(np.polyval(band[0], s) / np.polyval(band[1], s)) ** 2 * of_slow
    bound = 1.0 / (1.0 / of_slow + 1.0 / of_fast)
    least = float(2.0 * np.trapezoid(bound * freq, np.log(freq)))

    def excess(loop: Loop) -> float:
        fraction = loop.low_pass()
        L = np.polyval(fraction[0], s) / np.polyval(fraction[1], s)
        density = np.abs(L) ** 2 * ended + np.abs(1.0 - L) ** 2 * of_fast
        whole = 2.0 * np.trapezoid(density * freq, np.log(freq)) + np.max(np.abs(L) ** 2 * late)
        return math.log(max(np.max(density / bound), whole / least))

    bounds = math.log(2.0 * math.pi * SHAPED_FROM_HZ), math.log(2.0 * math.pi * SHAPED_TO_HZ)
    first = float(minimize_scalar(lambda log_k: excess(_loop([log_k])), bounds=bounds, method="bounded").x)
    logs = [first, first + math.log(_LEAK), 2.0 * first + math.log(_SLOPE)]
    for _ in range(2):  # a simplex that has collapsed on an edge of the maximum starts anew from there
        found = minimize(lambda x: excess(_loop(x)), logs, method="Nelder-Mead", options=_SEARCH)  # type: ignore[call-overload]
        logs = found.x.tolist()
    return _loop(logs)


def _loop(logs: FloatArray | list[float]) -> Loop:
    """Return the loop of ln k, and with them ln z and ln q.

    A leak below the band is as good as none, and would settle as slowly; a slope that does next to nothing is left out;
    a slow sensor that is the better one up to the end of the band is followed up to a tenth of that.
    """
    k, z, q = (*np.exp(logs).tolist(), 0.0, 0.0)[:3]
    k, z, q = min(k, _FASTEST), max(z, _SLOWEST), min(q, _FASTEST**2)
    if q < _LEAST_SLOPE * k * z:
        return butterworth_loop(1, k)
    # A low-pass of order 1 at w lets w N^2/2 of white noise through.
    return Loop(gain=k, slope_gain=q, leak=z, crossover=k + q / (k + z))
