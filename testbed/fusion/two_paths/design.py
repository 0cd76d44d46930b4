r"""The design of two fixed paths from the belief: low-passes, inverses, and the crossover of least noise.

The fast path inverts the sensor that is quieter at high frequency, up to a bandwidth; the slow path takes the other one
over below a crossover. Both are low-passes of the form that the settled Kalman filter of a signal of order m has,

.. math:: L_m(s) = 1 - s^m / b_m(s / w)\,w^{-m},

b_m the Butterworth polynomial: they lag in the m-th derivative only.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from testbed.fusion.belief import SensorBelief

if TYPE_CHECKING:
    from collections.abc import Callable

    from testbed.fusion.realisation import Realisation
    from testbed.signals import ComplexArray, FloatArray

# Order of the band end: the rate through three integrators, as in the optimum of most signals.
BAND_ORDER = 3
# Where the two sensors are compared, and the crossover is looked for.
LOW_HZ, HIGH_HZ = 1e-5, 1e3


def low_pass(order: int, w: float, poles: int | None = None) -> tuple[FloatArray, FloatArray]:
    """Return numerator and denominator of L with 1 - L = O(s^order), highest power first.

    Parameters
    ----------
    order : int
        Power of s that 1 - L starts with [-].
    w : float
        Corner of the Butterworth poles [rad/s].
    poles : int, optional
        Their number [-]; `order` if not given, more make L fall faster.
    """
    from scipy.signal import buttap

    n = poles or order
    a = np.real(np.poly(buttap(n)[1])) * w ** np.arange(n + 1)
    return a[-order:], a


def at(fraction: tuple[FloatArray, FloatArray], freq_hz: float) -> complex:
    """Return numerator over denominator in s at a frequency [-].

    Parameters
    ----------
    fraction : tuple of ndarray, shapes (n_num,), (n_den,)
        Numerator and denominator, highest power first.
    freq_hz : float
        [Hz].
    """
    return complex(over(fraction, np.array([freq_hz]))[0])


def over(fraction: tuple[FloatArray, FloatArray], freq_hz: FloatArray) -> ComplexArray:
    """Return numerator over denominator in s at frequencies, shape (n_freq,) [-].

    Parameters
    ----------
    fraction : tuple of ndarray, shapes (n_num,), (n_den,)
        Numerator and denominator, highest power first.
    freq_hz : ndarray, shape (n_freq,)
        [Hz].
    """
    s = 2j * np.pi * freq_hz
    value: ComplexArray = np.polyval(fraction[0], s) / np.polyval(fraction[1], s)
    return value


def input_psd(sensor: SensorBelief) -> Callable[[FloatArray], FloatArray]:
    """Return the two-sided input-referred noise density of a belief, Hz -> rad^2/s.

    Parameters
    ----------
    sensor : SensorBelief
        Dynamics and noise.
    """
    realised = sensor.realisation()

    def psd(freq_hz: FloatArray) -> FloatArray:
        outer = sensor.output_noise**2 + sensor.outer_slow_density(freq_hz)
        inner = sensor.input_noise**2 + sensor.inner_slow_density(freq_hz)
        density: FloatArray = inner + outer / np.abs(realised.response(freq_hz)) ** 2
        return density

    return psd


def best_crossover(slow: SensorBelief, fast: SensorBelief, order: int, freq_hz: float = 1.0, lag: float = 0.0) -> float:
    r"""Return the corner w [rad/s] of L that leaves the least noise and lag.

    .. math:: \min_w 2 \int |L|^2 S_{slow} + |1 - L|^2 S_{fast}\, df + |L(f_0)|^2 \sigma^2

    by trapezoid in ln f from 1e-5 Hz to 1 kHz, 100 points per decade. For white noise N of the slow sensor and n (1 +
    (w_c / w)^2)^(1/2) of the fast one it is w_c n / N for order 1 and w_c n / N / sqrt(3) for order 2.

    Parameters
    ----------
    slow, fast : SensorBelief
        The sensor that is better at low frequency, and the other.
    order : int
        Order of L.
    freq_hz, lag : float, optional
        A sine [Hz], and how the slow path by itself errs there, in mean square [rad^2/s^2].
    """
    from scipy.optimize import minimize_scalar

    freq = np.logspace(math.log10(LOW_HZ), math.log10(HIGH_HZ), 801)
    s = 2j * np.pi * freq
    of_slow, of_fast = input_psd(slow)(freq), input_psd(fast)(freq)

    def noise(log_w: float) -> float:
        b, a = low_pass(order, math.exp(log_w))
        L = np.polyval(b, s) / np.polyval(a, s)
        density = np.abs(L) ** 2 * of_slow + np.abs(1.0 - L) ** 2 * of_fast
        return math.log(2.0 * np.trapezoid(density * freq, np.log(freq)) + lag * abs(at((b, a), freq_hz)) ** 2)

    bounds = math.log(2.0 * math.pi * LOW_HZ), math.log(2.0 * math.pi * HIGH_HZ)
    return math.exp(minimize_scalar(noise, bounds=bounds, method="bounded", options={"xatol": 1e-4}).x)


def band_end(slow: SensorBelief, fast: SensorBelief, bandwidth: float) -> tuple[FloatArray, FloatArray]:
    """Return numerator and denominator of the `low_pass` B that makes either sensor's inverse proper.

    Parameters
    ----------
    slow, fast : SensorBelief
        The sensors.
    bandwidth : float
        Corner of B [rad/s].
    """
    excess = max(len(one.denominator) - _numerator(one).size for one in (slow, fast))
    return low_pass(BAND_ORDER, bandwidth, BAND_ORDER + max(excess - 1, 0))


def _numerator(sensor: SensorBelief) -> FloatArray:
    return np.trim_zeros(np.array(sensor.numerator), "f")


def inverse(sensor: SensorBelief) -> tuple[FloatArray, FloatArray]:
    """Return numerator and denominator of the inverse of a sensor, zeros at s = 0 left out.

    Parameters
    ----------
    sensor : SensorBelief
        Its belief.

    Raises
    ------
    ValueError
        If the inverse is unstable.
    """
    b = np.trim_zeros(_numerator(sensor), "b")
    if np.any(np.roots(b).real >= 0.0):
        zeros = np.round(np.roots(b), 1).tolist()
        msg = f"belief: expected a sensor whose inverse is stable, got zeros at {zeros} rad/s; `kalman` takes any"
        raise ValueError(msg)
    return np.array(sensor.denominator), b


def realised(numerator: FloatArray, denominator: FloatArray) -> Realisation:
    """Return the modal realisation of a transfer function.

    Parameters
    ----------
    numerator, denominator : ndarray, shapes (n_num,), (n_den,)
        Coefficients in s, highest power first.
    """
    return SensorBelief(numerator=tuple(numerator), denominator=tuple(denominator)).realisation()


def without_far_zeros(sensor: SensorBelief, reach: float) -> SensorBelief:
    """Return a belief without its zeros beyond `reach`: constants up to there, but their inverse would be a jump.

    Parameters
    ----------
    sensor : SensorBelief
        Its belief.
    reach : float
        [rad/s].
    """
    b = _numerator(sensor)
    zeros = np.roots(b)
    far = np.abs(zeros) > reach
    if not far.any():
        return sensor
    near = np.atleast_1d(b[0] * np.prod(-zeros[far]) * np.poly(zeros[~far]))
    return sensor.model_copy(update={"numerator": tuple(np.real(near).tolist())})


def zeros_at_dc(sensor: SensorBelief) -> int:
    """Return how many zeros a sensor has at s = 0 [-].

    Parameters
    ----------
    sensor : SensorBelief
        Its belief.
    """
    b = np.array(sensor.numerator)
    return b.size - np.trim_zeros(b, "b").size


def inverted(sensor: SensorBelief, band: tuple[FloatArray, FloatArray]) -> Realisation:
    """Return B / G, the band-limited inverse of a sensor, an integrator for a zero at s = 0.

    Parameters
    ----------
    sensor : SensorBelief
        G.
    band : tuple of ndarray, shapes (n_num,), (n_den,)
        Numerator and denominator of B in s.

    Raises
    ------
    ValueError
        If the inverse is unstable.
    """
    a, b = inverse(sensor)
    denominator = np.polymul(band[1], np.append(b, np.zeros(zeros_at_dc(sensor))))
    return realised(np.asarray(np.polymul(band[0], a), float), np.asarray(denominator, float))
