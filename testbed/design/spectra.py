r"""What a chain leaves of a disturbance, frequency by frequency, without playing it.

.. math:: P_e = |S|^2 \left[ \left| \frac{1 - M e^{-s \tau} (1 + t_{lead} s) T}{s} \right|^2 P_\omega
    + \left| \frac{M (1 + t_{lead} s)}{s} \right|^2 \sum_i |H_i|^2 S_i \right] + |1 - S|^2 r^2

with the rate's spectrum P of one realisation of the disturbance and the densities S of the readings' noise.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from testbed.pointing.windows import Periodogram, mpe_weight, rpe_weight, weighted_rms

if TYPE_CHECKING:
    from collections.abc import Mapping

    from testbed.design.response import FilterResponse
    from testbed.pointing.blend import Gains
    from testbed.pointing.parameters import Mirror
    from testbed.scenario.model import Scenario
    from testbed.sensors.base import Sensor
    from testbed.signals import ComplexArray, FloatArray

_URAD = 1e6


@dataclass(frozen=True)
class Disturbance:
    """A rate's spectrum.

    Parameters
    ----------
    freq_hz, power : ndarray, shape (n_freq,)
        Frequencies above zero [Hz] and the share of the mean square at each [rad^2/s^2].
    """

    freq_hz: FloatArray
    power: FloatArray

    @property
    def step_hz(self) -> float:
        """From one frequency to the next [Hz]."""
        return float(self.freq_hz[0])


def disturbance(scenario: Scenario) -> Disturbance:
    """Return the spectrum of the motion that a scenario commands, after settle.

    Parameters
    ----------
    scenario : Scenario
        Of which the table is ideal: the truth is the command.
    """
    base, profile = scenario.base_rate_hz, scenario.profile()
    first = round(scenario.frame.settle * base)
    spectrum = Periodogram(base, scenario.n_time - first, longest=scenario.n_time)
    spectrum.process(profile.rate(np.arange(first, scenario.n_time) / base))
    return Disturbance(spectrum.freq_hz[1:], spectrum.power[1:])


def reading_noise(sensors: Mapping[str, Sensor], freq_hz: FloatArray) -> dict[str, FloatArray]:
    """Return the two-sided density of the noise of each sensor's readings [rad^2/s], shape (n_freq,).

    Parameters
    ----------
    sensors : mapping of str to Sensor
        The instruments.
    freq_hz : ndarray, shape (n_freq,)
        Where, rising [Hz].
    """
    coarse = np.geomspace(freq_hz[0], freq_hz[-1], 400)
    found = {}
    for name, sensor in sensors.items():
        gain = np.abs(sensor.response(coarse)) ** 2
        seen = gain > 0.0
        density = np.where(seen, sensor.input_noise_psd(coarse) * gain, 0.0) if sensor.noise else np.zeros(coarse.size)
        found[name] = np.interp(freq_hz, coarse, np.where(np.isfinite(density), density, 0.0))
    return found


def mean_squares(
    shake: Disturbance,
    response: FilterResponse,
    noise: Mapping[str, FloatArray],
    mirror: Mirror,
    gains: Gains,
    tracker_noise: float,
) -> tuple[FloatArray, FloatArray]:
    """Return the shares of the mean squares of the residual and of the mirror's deflection, the true angle without the
    residual, at each frequency of the disturbance [rad^2], each of shape (n_freq,): of a mirror without ends.

    Parameters
    ----------
    shake : Disturbance
        The true rate.
    response : FilterResponse
        Of the filter.
    noise : mapping of str to ndarray, shape (n_freq,)
        Two-sided density of the readings of each sensor [rad^2/s].
    mirror : Mirror
        The way of the command.
    gains : Gains
        Of the tracker.
    tracker_noise : float
        r [rad/sqrt(Hz)].
    """
    s, left = _left(shake.freq_hz, response, mirror, gains)
    drawn = _drawn(shake, response, noise, mirror, gains, tracker_noise)
    error: FloatArray = np.abs(left / s) ** 2 * shake.power + drawn
    deflection: FloatArray = np.abs((1.0 - left) / s) ** 2 * shake.power + drawn
    return error, deflection


def _passed(freq: FloatArray, mirror: Mirror) -> ComplexArray:
    """Return the deflection over the estimated angle."""
    s = 2j * np.pi * freq
    passed: ComplexArray = (
        mirror.dynamics.response(freq) * np.exp(-s * mirror.latency) * (1.0 + sum(mirror.lead_times) * s)
    )
    if mirror.rate is not None:
        passed = passed * np.sinc(freq / mirror.rate) * np.exp(-0.5 * s / mirror.rate)
    return passed


def _left(
    freq: FloatArray, response: FilterResponse, mirror: Mirror, gains: Gains
) -> tuple[ComplexArray, ComplexArray]:
    """Return s [rad/s], and the residual over the true angle."""
    T = 1.0 + response.at(response.error, freq)
    left: ComplexArray = gains.sensitivity(freq) * (1.0 - _passed(freq, mirror) * T)
    s = np.asarray(2j * np.pi * freq, dtype=np.complex128)
    return s, left


def _drawn(
    shake: Disturbance,
    response: FilterResponse,
    noise: Mapping[str, FloatArray],
    mirror: Mirror,
    gains: Gains,
    tracker_noise: float,
) -> FloatArray:
    """Return the share of noise of sensors and tracker in the mean square, of residual and deflection alike [rad^2]."""
    freq = shake.freq_hz
    S = gains.sensitivity(freq)
    density = np.sum(
        [np.abs(response.at(response.noise[name], freq)) ** 2 * one for name, one in noise.items()], axis=0
    )
    through = np.abs(S * _passed(freq, mirror) / (2j * np.pi * freq)) ** 2
    drawn: FloatArray = 2.0 * shake.step_hz * (through * density + np.abs(1.0 - S) ** 2 * tracker_noise**2)
    return drawn


def doubts_of(deflection: FloatArray, shake: Disturbance, mirror: Mirror) -> tuple[str, ...]:
    """Return where three times the rms of the deflection or of its rate does not stay within the mirror's ends.

    Parameters
    ----------
    deflection : ndarray, shape (n_freq,)
        As `mean_squares` has it [rad^2].
    shake : Disturbance
        Of that frequencies.
    mirror : Mirror
        With its ends.
    """
    speed = deflection * (2.0 * np.pi * shake.freq_hz) ** 2
    ends = (("deflection", deflection, mirror.stroke, "urad", _URAD), ("rate", speed, mirror.rate_limit, "rad/s", 1.0))
    found = []
    for what, power, end, unit, scale in ends:
        reach = 3.0 * weighted_rms(power)
        if end is not None and reach > end:
            found.append(
                f"3 sigma of the mirror's {what} is {scale * reach:.3g} {unit}, beyond its end at {scale * end:.3g} "
                f"{unit}, which spectra do not know: judge it by --prove"
            )
    return tuple(found)


def errors_of(power: FloatArray, shake: Disturbance, metric: str) -> float:
    """Return a metric of pointing from the residual's spectrum [urad].

    Parameters
    ----------
    power : ndarray, shape (n_freq,)
        As `mean_squares` has it [rad^2].
    shake : Disturbance
        Of that frequencies.
    metric : str
        ``residual_rms_urad``, or ``rpe_urad`` and ``mpe_urad`` with the window's length behind a dot.
    """
    name, _, window = metric.partition(".")
    weight = {"rpe_urad": rpe_weight, "mpe_urad": mpe_weight}.get(name)
    return _URAD * (
        weighted_rms(power) if weight is None else weighted_rms(power, weight(shake.freq_hz, float(window)))
    )
