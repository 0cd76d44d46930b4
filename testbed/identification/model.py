r"""The structure that a measured response asks for, among the transfer functions fitted to it."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from testbed.identification.fitting import fit_dynamic, fit_static

if TYPE_CHECKING:
    from collections.abc import Sequence

    from testbed.identification.response import FrequencyResponse
    from testbed.identification.sensor_model import SensorModel

_MOST_POLES = 6
# Numbers of poles that were tried in vain before the search ends.
_IN_VAIN = 2
# The phase that the dead time may leave open at the highest frequency [rad].
_UNSURE = 0.1
# And the least that it turns there to be one [rad].
_NEGLIGIBLE = 1e-3
# Structures that are less likely than the best one by more than a factor of 10 are not counted.
_ALLOWED = 2.0 * np.log(10.0)
_QUANTILE = 1.96


def fit_model(found: FrequencyResponse) -> SensorModel:
    r"""Return the transfer function that a response asks for.

    .. math:: \min \sum_k |G(2 \pi i f_k) e^{-2 \pi i f_k \tau} - H_k - \delta H_{e,k}|^2 / (\sigma_k^2 / 2)
        + \delta^2 / \sigma_e^2

    over none to six poles, with and without a zero at s = 0, with and without a dead time, beside all other zeros or
    none, by `testbed.fusion.analysis.identify`; delta is the error of the clock, which turns all frequencies together.
    The one with the least of Bayes' criterion (Schwarz 1978) is taken, its data the bins of the spectrum that the
    response is from. A sensor that is early or has a zero on the right is held to be one in 10 000: few frequencies do
    not tell such a zero from a dead time.

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
    highest = float(found.freq_hz[-1])
    tried = list(fit_static(found))
    best, vain = _best(tried), 0
    for n_pole in range(1, _MOST_POLES + 1):
        if found.freq_hz.size < 2 * n_pole or vain == _IN_VAIN:
            break
        tried += [one for one in fit_dynamic(found, n_pole, best.delay) if _tells(one, highest)]
        before, best = best, _best(tried)
        vain = 0 if best is not before else vain + 1
    return replace(best, delay_span=_delay_span(tried, best.criterion))


def _best(tried: Sequence[SensorModel]) -> SensorModel:
    return min(tried, key=lambda one: one.criterion)


def _tells(model: SensorModel, highest_hz: float) -> bool:
    """Return whether a model without dead time, or one that knows it and has any: a pole far beyond the band would
    take its place.
    """
    turn = 2.0 * np.pi * highest_hz
    return not model.delayed or (turn * model.delay_std < _UNSURE and turn * abs(model.delay) > _NEGLIGIBLE)


def _delay_span(tried: Sequence[SensorModel], least: float) -> tuple[float, float]:
    """Return the dead times of all structures that are nearly as likely as the best one [s]."""
    allowed = [one for one in tried if one.criterion < least + _ALLOWED]
    low = min(one.delay - _QUANTILE * one.delay_std for one in allowed)
    return float(low), float(max(one.delay + _QUANTILE * one.delay_std for one in allowed))
