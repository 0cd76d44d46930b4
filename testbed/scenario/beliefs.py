"""What a filter may believe of a simulated sensor: what its preset's data sheet supports, or what it exactly is."""

from __future__ import annotations

import functools
from typing import TYPE_CHECKING, Any

import numpy as np

from testbed.fusion.analysis.identify import identify
from testbed.fusion.belief import SensorBelief, load_belief
from testbed.parts import preset
from testbed.sensors import load_preset

if TYPE_CHECKING:
    from testbed.sensors.base import Sensor
    from testbed.signals import FloatArray

# The word for the simulator's own response and noise, and that for what a preset itself says.
EXACT = "exact"
DATA_SHEET = "data_sheet"

_LOWEST_HZ, _POINTS = 1e-2, 121
_FIT_MISFIT = 1e-3
# (real poles, pairs) in the order in which they are tried. A pair may become two real poles, and its search ends in
# fewer local minima than one for two real poles does.
_FORMS = tuple((n % 2, n // 2) for n in range(1, 9))
# The noise is fitted from here up [Hz]: what rises below (1/f) is not in it.
_WHITE_FROM_HZ = 1.0
# What a belief and a sensor call by the same name.
_SLOW = (
    "noise_knee",
    "bias_instability",
    "rate_random_walk",
    "turn_on_bias",
    "lowest_frequency",
    "resolution",
)
# An output noise this much below the input noise keeps R positive and changes nothing.
_LEAST_OUTPUT = 3e-4


def belief_of(name: str, *, exact: bool = False) -> SensorBelief:
    """Return what a filter may believe of a shipped instrument.

    Parameters
    ----------
    name : str
        Preset, such as ``sx300``.
    exact : bool, optional
        The simulator's own response and noise, instead of what the preset's data sheet supports.

    Returns
    -------
    SensorBelief
        Transfer function and white noise.

    Raises
    ------
    UnknownNameError
        If there is no such preset.
    ValueError
        If its data sheet supports no belief, or no rational model comes close to it.

    Examples
    --------
    >>> belief_of("sx300").source
    'eq39'
    >>> belief_of("sx300", exact=True).source
    'exact'
    """
    if exact:
        return exact_belief(load_preset(name))
    found = preset_belief(name)
    if found is None:
        msg = f"{name}: its data sheet supports no belief; take exact=True, the simulator's own response and noise"
        raise ValueError(msg)
    return found


def preset_belief(name: str) -> SensorBelief | None:
    """Return what the data sheet of a shipped instrument supports, None if that is nothing.

    Parameters
    ----------
    name : str
        Preset; the shipped belief that it names has an entry for its type.

    Raises
    ------
    UnknownNameError
        If there is no such preset.
    """
    content = preset("testbed.sensors", name)
    if content.get("belief") == DATA_SHEET:
        return sheet_belief(load_preset(name))
    return load_belief(content["belief"])[content["type"]] if "belief" in content else None


def sheet_belief(sensor: Sensor) -> SensorBelief:
    """Return what the data sheet of an instrument says of it.

    Parameters
    ----------
    sensor : Sensor
        The instrument, given in the words of its data sheet.

    Returns
    -------
    SensorBelief
        With `source` "data_sheet".

    Raises
    ------
    ValueError
        If it is of a kind whose data sheet says too little.
    """
    return SensorBelief(**sensor.sheet_belief(), source=DATA_SHEET)


def exact_belief(sensor: Sensor) -> SensorBelief:
    """Return the simulator's own response and white noise of an instrument.

    Parameters
    ----------
    sensor : Sensor
        The instrument.

    Returns
    -------
    SensorBelief
        As `believed`, with `source` "exact".

    Raises
    ------
    ValueError
        If no rational model comes close to it.
    """
    found = believed(sensor)
    if found is None:
        msg = (
            f"expected a response that a few poles meet within {_FIT_MISFIT:g}, which this sensor's is not; "
            "give numerator and denominator of your own"
        )
        raise ValueError(msg)
    return found


def believed(sensor: Sensor) -> SensorBelief | None:
    """Return the rational model and white noise that come closest to what a sensor is, None if none is within 0.1 %.

    The response is fitted from 0.01 Hz to half the sensor's sample rate by the fewest poles that do; the noise is an
    input and an output level, fitted to the input-referred density from 1 Hz up (relative, non-negative); the
    coefficients of the slow noise, the range and the step of the readings are the sensor's own.

    Parameters
    ----------
    sensor : Sensor
        The instrument.
    """
    try:
        hash(sensor)
    except TypeError:  # a field of someone's own that cannot be a key
        return _search(sensor)
    return _remembered(sensor)


@functools.lru_cache(maxsize=64)
def _remembered(sensor: Sensor) -> SensorBelief | None:
    # The search takes up to seconds, and one run asks several times.
    return _search(sensor)


def _search(sensor: Sensor) -> SensorBelief | None:
    nyquist = sensor.sample_rate / 2.0
    freq = np.logspace(np.log10(min(_LOWEST_HZ, 1e-3 * nyquist)), np.log10(nyquist), _POINTS)
    response = sensor.response(freq)
    blind = bool(abs(sensor.response(freq[:1] / 10.0)[0]) < 0.5 * abs(response[0]))
    inner, outer = _white_noise(sensor, freq[freq >= min(_WHITE_FROM_HZ, 0.1 * nyquist)])
    for real, pairs in _FORMS:
        fit = identify(freq, response, real_poles=real, pole_pairs=pairs, blind_at_dc=blind)
        if fit.worst < _FIT_MISFIT:
            try:
                found = fit.belief(input_noise=inner, output_noise=max(outer, _LEAST_OUTPUT * inner))
            except ValueError:  # a band so slow that it reads nothing
                return None
            return found.model_copy(update={"source": EXACT, **_slow_and_ends(sensor)})
    return None


def _white_noise(sensor: Sensor, freq: FloatArray) -> tuple[float, float]:
    """Return the root densities [rad/sqrt(s)] before and behind the dynamics that fit a sensor's noise best."""
    from scipy.optimize import nnls

    density = sensor.input_noise_psd(freq)
    if not density.any():
        return 0.0, 0.0
    terms = np.stack([np.ones(density.size), 1.0 / np.abs(sensor.response(freq)) ** 2], axis=1)
    size = np.linalg.norm(terms / density[:, None], axis=0)
    level, _ = nnls(terms / density[:, None] / size, np.ones(density.size))
    inner, outer = np.sqrt(level / size)
    return float(inner), float(outer)


def _slow_and_ends(sensor: Sensor) -> dict[str, Any]:
    """Return the coefficients of a sensor's slow noise, its range and the step of its readings, as a belief names them.

    Without noise there is no rounding either, so that a sensor at rest rightly repeats itself.
    """
    ends = {"range": sensor.full_scale()}
    if not sensor.noise:
        return ends
    return ends | {name: value for name in _SLOW if (value := getattr(sensor, name, None)) is not None}
