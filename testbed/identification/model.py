r"""A transfer function and a dead time fitted to a measured response, with the covariance of the coefficients."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from scipy.optimize import least_squares

from testbed.fusion.analysis.identify import identify

if TYPE_CHECKING:
    from collections.abc import Iterator

    from testbed.identification.response import FrequencyResponse
    from testbed.signals import ComplexArray, FloatArray

_MOST_POLES = 6
# Numbers of poles that were tried in vain before the search ends.
_IN_VAIN = 2
_FALLS = 0.5
# The phase that the dead time may leave open at the highest frequency [rad].
_UNSURE = 0.1
# And the least that it turns there to be one [rad].
_NEGLIGIBLE = 1e-3
# Standard deviations from which on a value is no chance.
_SURE = 4.0


@dataclass(frozen=True)
class SensorModel:
    """A transfer function with dead time, and how well it is known.

    Parameters
    ----------
    numerator, denominator : ndarray, shapes (n_num,), (n_den,)
        Coefficients in s, highest power first; the denominator starts with 1.
    delay : float
        Dead time [s]; below zero the output is early, as it is where the clocks did not begin together.
    covariance : ndarray, shape (n_parameter, n_parameter)
        Of the numerator without its zeros by form, of the denominator without its 1, and of the delay if `delayed`.
    free : int
        Number of coefficients of the numerator that were fitted, the first ones.
    delayed : bool
        Whether a dead time was fitted.
    misfit : float
        Sum of the squared misfits over their variances [-].
    freedom : int
        Its degrees of freedom.
    worst : float
        Largest |fit / measured - 1| [-].
    """

    numerator: FloatArray
    denominator: FloatArray
    delay: float
    covariance: FloatArray
    free: int
    delayed: bool
    misfit: float
    freedom: int
    worst: float

    def response(self, freq_hz: FloatArray) -> ComplexArray:
        """Return the response at frequencies [Hz], complex, shape (n_freq,) [-]."""
        s = 2j * np.pi * np.asarray(freq_hz)
        value: ComplexArray = np.polyval(self.numerator, s) / np.polyval(self.denominator, s) * np.exp(-s * self.delay)
        return value

    @property
    def delay_std(self) -> float:
        """Standard deviation of the dead time [s], 0 where there is none by form."""
        return float(np.sqrt(self.covariance[-1, -1])) if self.delayed else 0.0

    @property
    def criterion(self) -> float:
        """Bayes' criterion: of two models the one with less is the more likely [-]."""
        n = len(self.covariance)
        return self.misfit + n * float(np.log(self.freedom + n))


def fit_model(found: FrequencyResponse) -> SensorModel:
    r"""Return the transfer function that a response asks for.

    .. math:: \min \sum_k |G(2 \pi i f_k) e^{-2 \pi i f_k \tau} - H_k|^2 / (\sigma_k^2 / 2)

    over none to six poles, with and without a zero at s = 0 and a dead time, by `testbed.fusion.analysis.identify`; the
    one with the least of Bayes' criterion (Schwarz 1978) is taken. The covariance is that of the noise at each
    frequency and of the clock, which turns all of them together.

    Parameters
    ----------
    found : FrequencyResponse
        At two frequencies or more.

    Raises
    ------
    ValueError
        If there are fewer.
    """
    if found.freq_hz.size < 2:
        msg = f"expected a response at two frequencies or more, got {found.freq_hz.size}"
        raise ValueError(msg)
    best = min(_static(found), key=lambda one: one.criterion)
    vain = 0
    for n_pole in range(1, _MOST_POLES + 1):
        if found.freq_hz.size < 2 * n_pole:
            break
        known = [one for one in _dynamic(found, n_pole, best.delay) if _tells(one, float(found.freq_hz[-1]))]
        better = min([best, *known], key=lambda one: one.criterion)
        vain = 0 if better.criterion < best.criterion else vain + 1
        best = min(best, better, key=lambda one: one.criterion)
        if vain == _IN_VAIN:
            break
    return best


def _tells(model: SensorModel, highest_hz: float) -> bool:
    """Return whether a model without dead time, or one that knows it and has any: a pole far beyond the band would
    take its place.
    """
    turn = 2.0 * np.pi * highest_hz
    return not model.delayed or (turn * model.delay_std < _UNSURE and turn * abs(model.delay) > _NEGLIGIBLE)


def _static(found: FrequencyResponse) -> Iterator[SensorModel]:
    """Yield a factor without and with a dead time."""
    weight = np.sqrt(2.0 / found.variance)
    slope = -np.polyfit(found.freq_hz, np.unwrap(found.phase), 1)[0] / (2.0 * np.pi)
    unit = 1.0 / float(found.freq_hz[-1])

    def residual(place: FloatArray) -> FloatArray:
        turn = np.exp(-2j * np.pi * found.freq_hz * place[1:].sum() * unit)
        error = weight * (place[0] * turn - found.response)
        return np.concatenate([error.real, error.imag])

    for start in ([found.gain.mean()], [found.gain.mean(), slope / unit]):
        place = least_squares(residual, start, method="lm").x
        yield _judged(found, place[:1], np.ones(1), float(place[1:].sum() * unit), blind=False, delayed=place.size > 1)


def _dynamic(found: FrequencyResponse, n_pole: int, delay: float) -> Iterator[SensorModel]:
    """Yield fits with so many poles, with and without a zero at s = 0 and a dead time."""
    weight = found.gain * np.sqrt(2.0 / found.variance)
    # What is blind below the band falls towards its lower end; elsewhere a zero at s = 0 would only save a coefficient.
    may_be_blind = n_pole > 1 and bool(found.gain[0] < _FALLS * found.gain.max())
    for blind in (False, True)[: 1 + may_be_blind]:
        for start in (None, delay):
            fit = identify(
                found.freq_hz,
                found.response,
                real_poles=n_pole % 2,
                pole_pairs=n_pole // 2,
                blind_at_dc=blind,
                weight=weight,
                delay=start,
            )
            model = _judged(found, fit.numerator, fit.denominator, fit.delay, blind=blind, delayed=start is not None)
            if blind or not may_be_blind or _sees_constant(model):
                yield model


def _sees_constant(model: SensorModel) -> bool:
    """Return whether the constant term of the numerator is more than chance: what sees a constant rate is another
    sensor, to filters and to the noise fitted to it, however little it sees.
    """
    place = model.free - 1
    return bool(abs(model.numerator[place]) > _SURE * np.sqrt(model.covariance[place, place]))


def _judged(
    found: FrequencyResponse,
    numerator: FloatArray,
    denominator: FloatArray,
    delay: float,
    *,
    blind: bool,
    delayed: bool,
) -> SensorModel:
    """Return a fit with its misfit and covariance."""
    weight = np.sqrt(2.0 / found.variance)
    s = 2j * np.pi * found.freq_hz
    late, D = np.exp(-s * delay), np.polyval(denominator, s)
    G = np.polyval(numerator, s) / D * late
    free = numerator.size - blind
    powers = s[:, None] ** np.arange(denominator.size - 1, -1, -1)
    columns = [powers[:, powers.shape[1] - numerator.size :][:, :free] * (late / D)[:, None]]
    columns += [-(G / D)[:, None] * powers[:, 1:]]
    columns += [(-s * G)[:, None]] if delayed else []
    jacobian = weight[:, None] * np.concatenate(columns, axis=1)
    rows = np.concatenate([jacobian.real, jacobian.imag])
    size = np.linalg.norm(rows, axis=0)
    size[size == 0.0] = 1.0
    inverse = np.linalg.pinv(rows / size) / size[:, None]
    turn = weight * found.slope
    shared = inverse @ np.concatenate([turn.real, turn.imag]) * found.clock.std
    error = weight * (G - found.response)
    return SensorModel(
        numerator,
        denominator,
        delay,
        inverse @ inverse.T + np.outer(shared, shared),
        free,
        delayed,
        float(np.vdot(error, error).real),
        2 * s.size - size.size,
        float(np.max(np.abs(G / found.response - 1.0))),
    )
