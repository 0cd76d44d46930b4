"""The noise of an instrument term by term, as densities at its input."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

if TYPE_CHECKING:
    from collections.abc import Callable

    from testbed.sensors.base import Sensor
    from testbed.signals import FloatArray

# Parameter that is taken away, what it then is, and the name of what goes with it; in this order, since the 1/f part of
# an amplifier is given relative to its white noise.
_TERMS: tuple[tuple[str, Any, str], ...] = (
    ("noise_knee", None, "flicker"),
    ("noise_density", 0.0, "white"),
    ("ring", None, "johnson"),
    ("quantization", 0.0, "quantization"),
    ("angle_random_walk", 0.0, "angle_random_walk"),
    ("bias_instability", 0.0, "bias_instability"),
    ("rate_random_walk", 0.0, "rate_random_walk"),
    ("markov_bias", 0.0, "markov_bias"),
)
ROUNDING = "rounding"


def noise_terms(sensor: Sensor) -> dict[str, Callable[[FloatArray], FloatArray]]:
    """Return the density of each term of an instrument's noise, which add up to `input_noise_psd`; nothing without
    noise.

    What is left when all terms are taken away is the rounding.

    Parameters
    ----------
    sensor : Sensor
        The instrument.

    Returns
    -------
    dict of str to callable
        Two-sided density at the input by term, Hz -> rad^2/s.
    """
    if not sensor.noise:
        return {}
    found: dict[str, Callable[[FloatArray], FloatArray]] = {}
    left = sensor
    for field, nothing, name in _TERMS:
        if getattr(left, field, nothing) in (nothing, None):
            continue
        less = left.model_copy(update={field: nothing})
        found[name] = _difference(left, less)
        left = less
    return {**found, ROUNDING: left.input_noise_psd}


def _difference(more: Sensor, less: Sensor) -> Callable[[FloatArray], FloatArray]:
    def density(freq_hz: FloatArray) -> FloatArray:
        with np.errstate(invalid="ignore"):
            difference: FloatArray = more.input_noise_psd(freq_hz) - less.input_noise_psd(freq_hz)
        return np.maximum(difference, 0.0)

    return density
