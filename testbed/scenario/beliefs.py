"""What a filter may believe of a simulated sensor: the closest rational model and white noise."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from testbed.fusion.analysis.identify import identify

if TYPE_CHECKING:
    from collections.abc import Callable

    from testbed.fusion.belief import SensorBelief
    from testbed.sensors.base import Sensor
    from testbed.signals import FloatArray

_FIT_HZ = np.logspace(-2.0, 3.0, 121)
_FIT_MISFIT = 1e-3
# (real poles, pairs) in the order in which they are tried.
_FORMS = ((1, 0), (2, 0), (0, 1), (3, 0), (1, 1), (4, 0), (2, 1))
# An output noise this much below the input noise keeps R positive and changes nothing.
_LEAST_OUTPUT = 3e-4


def believed(sensor: Sensor) -> SensorBelief | None:
    """Return the rational model and white noise that come closest to what a sensor is, None if none is within 0.1 %.

    The response is fitted from 0.01 Hz to 1 kHz by the fewest poles that do; the noise is an input and an output level,
    fitted to the input-referred density from 1 Hz up (relative, non-negative): what rises below 1 Hz (1/f) is not in
    it.

    Parameters
    ----------
    sensor : Sensor
        The instrument.
    """
    from scipy.optimize import nnls

    response = sensor.response(_FIT_HZ)
    blind = bool(abs(sensor.response(_FIT_HZ[:1] / 10.0)[0]) < 0.5 * abs(response[0]))
    band = _FIT_HZ >= 1.0
    density = sensor.input_noise_psd(_FIT_HZ[band])
    terms = np.stack([np.ones(density.size), 1.0 / np.abs(response[band]) ** 2], axis=1)
    size = np.linalg.norm(terms / density[:, None], axis=0)
    level, _ = nnls(terms / density[:, None] / size, np.ones(density.size))
    inner, outer = np.sqrt(level / size)
    for real, pairs in _FORMS:
        fit = identify(_FIT_HZ, response, real_poles=real, pole_pairs=pairs, blind_at_dc=blind)
        if fit.worst < _FIT_MISFIT:
            return fit.belief(input_noise=float(inner), output_noise=float(max(outer, _LEAST_OUTPUT * inner)))
    return None


def excess_density(sensor: Sensor, belief: SensorBelief) -> Callable[[FloatArray], FloatArray]:
    """Return the density of the reading beyond the belief's white noise, Hz -> rad^2/s."""

    def density(freq_hz: FloatArray) -> FloatArray:
        power = np.abs(sensor.response(freq_hz)) ** 2
        beyond = sensor.input_noise_psd(freq_hz) * power - belief.input_noise**2 * power - belief.output_noise**2
        # Below 2 % it is the misfit of the white level.
        kept: FloatArray = np.where(
            beyond > 0.02 * (belief.input_noise**2 * power + belief.output_noise**2), beyond, 0.0
        )
        return kept

    return density
