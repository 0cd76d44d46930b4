"""Transfer functions of every structure fitted to a measured response, by least squares with its covariance."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from scipy.optimize import least_squares

from testbed.fusion.analysis.identify import identify
from testbed.fusion.analysis.whitening import parts, whitened
from testbed.identification.sensor_model import SURE, SensorModel

if TYPE_CHECKING:
    from collections.abc import Iterator

    from testbed.identification.response import FrequencyResponse
    from testbed.signals import FloatArray

_FALLS = 0.5
# Of the misfit, in relation to it: what is left is a thousandth of a standard deviation.
_TOLERANCE = 1e-8


def fit_static(found: FrequencyResponse) -> Iterator[SensorModel]:
    """Yield a factor without and with a dead time."""
    weight, common = _errors(found)
    slope = -np.polyfit(found.freq_hz, np.unwrap(found.phase), 1)[0] / (2.0 * np.pi)
    unit = 1.0 / float(found.freq_hz[-1])

    def residual(place: FloatArray) -> FloatArray:
        turn = np.exp(-2j * np.pi * found.freq_hz * place[1:].sum() * unit)
        return whitened(parts(weight * (place[0] * turn - found.response)), common)

    for start in ([found.gain.mean()], [found.gain.mean(), slope / unit]):
        place = least_squares(residual, start, method="lm").x
        yield _judged(found, place[:1], np.ones(1), float(place[1:].sum() * unit), blind=False, delayed=place.size > 1)


def fit_dynamic(found: FrequencyResponse, n_pole: int, delay: float) -> Iterator[SensorModel]:
    """Yield fits with so many poles: with and without a zero at s = 0, and without a dead time or with one, which is
    sought from one on, beside as many other zeros as there may be or none.
    """
    weight, shared = found.gain * np.sqrt(2.0 / found.variance), found.slope * found.clock.std
    # What is blind below the band falls towards its lower end; elsewhere a zero at s = 0 would only save a coefficient.
    may_be_blind = n_pole > 1 and bool(found.gain[0] < _FALLS * found.gain.max())
    for blind, n_zero, start in _structures(n_pole, delay, may_be_blind=may_be_blind):
        fit = identify(
            found.freq_hz,
            found.response,
            real_poles=n_pole % 2,
            pole_pairs=n_pole // 2,
            blind_at_dc=blind,
            n_zero=n_zero,
            weight=weight,
            shared=shared,
            delay=start,
            tolerance=_TOLERANCE,
        )
        model = _judged(found, fit.numerator, fit.denominator, fit.delay, blind=blind, delayed=start is not None)
        if blind or not may_be_blind or _sees_constant(model):
            yield model


def _structures(n_pole: int, delay: float, *, may_be_blind: bool) -> Iterator[tuple[bool, int, float | None]]:
    """Yield whether there is a zero at s = 0, the number of zeros, and where the dead time begins if there is one."""
    for blind in (False, True)[: 1 + may_be_blind]:
        yield blind, n_pole - 1, None
        # A zero far off beside a dead time and a pole leaves all three open; poles alone would take its place.
        for n_zero in dict.fromkeys((n_pole - 1, int(blind))):
            yield blind, n_zero, delay


def _errors(found: FrequencyResponse) -> tuple[FloatArray, FloatArray]:
    """Return the inverse standard deviation of either part of each value, and what that of the clock adds in these."""
    weight = np.sqrt(2.0 / found.variance)
    return weight, parts(weight * found.slope * found.clock.std)


def _sees_constant(model: SensorModel) -> bool:
    """Return whether the constant term of the numerator is more than chance: what sees a constant rate is another
    sensor, to filters and to the noise fitted to it, however little it sees.
    """
    place = model.free - 1
    return bool(abs(model.numerator[place]) > SURE * np.sqrt(model.covariance[place, place]))


def _judged(
    found: FrequencyResponse,
    numerator: FloatArray,
    denominator: FloatArray,
    delay: float,
    *,
    blind: bool,
    delayed: bool,
) -> SensorModel:
    """Return a fit with its likelihood and covariance."""
    weight, common = _errors(found)
    s = 2j * np.pi * found.freq_hz
    late, D = np.exp(-s * delay), np.polyval(denominator, s)
    G = np.polyval(numerator, s) / D * late
    free = numerator.size - blind
    powers = s[:, None] ** np.arange(denominator.size - 1, -1, -1)
    columns = [powers[:, powers.shape[1] - numerator.size :][:, :free] * (late / D)[:, None]]
    columns += [-(G / D)[:, None] * powers[:, 1:]]
    columns += [(-s * G)[:, None]] if delayed else []
    rows = whitened(parts(weight[:, None] * np.concatenate(columns, axis=1)), common)
    size = np.linalg.norm(rows, axis=0)
    size[size == 0.0] = 1.0
    inverse = np.linalg.pinv(rows / size) / size[:, None]
    return SensorModel(
        numerator,
        denominator,
        delay,
        inverse @ inverse.T,
        free,
        delayed,
        _misfit(weight * (G - found.response), common, found.freedom),
        2 * s.size - size.size,
        int(np.sum(2.0 * (found.freedom + 1.0))),
        float(np.max(np.abs(G / found.response - 1.0))),
        zeros_on_the_right(numerator, s, found.gain * weight),
    )


def _misfit(error: np.ndarray, common: FloatArray, freedom: FloatArray) -> float:
    r"""Return :math:`\delta^2 + \sum_k 2 (\nu_k + 1) \ln(1 + |e_k|^2 / (2 \nu_k))`, with e the errors left by the most
    likely error of the clock, delta in its standard deviations: the noise of each frequency is an estimate itself, of
    nu degrees of freedom, so that errors follow Student's law.
    """
    delta = float(common @ parts(error)) / (1.0 + float(common @ common))
    left = parts(error) - common * delta
    square = left[: error.size] ** 2 + left[error.size :] ** 2
    return delta**2 + float(np.sum(2.0 * (freedom + 1.0) * np.log1p(square / (2.0 * freedom))))


def zeros_on_the_right(numerator: FloatArray, s: np.ndarray, weight: FloatArray) -> float:
    """Return by how many standard deviations zeros on the right turn the phase beyond what they would on the left, and
    beyond a sign.
    """
    zeros = np.roots(numerator)
    right = zeros[zeros.real > 0.0]
    turn = np.abs(np.angle((s[:, None] + np.conj(right)) / (s[:, None] - right)))
    both = [np.max(weight[:, None] * one, axis=0) for one in (turn, np.pi - turn)]
    return float(np.sum(np.minimum(*both)))
