"""What a filter believes about its sensors: dynamics, delay, bias and noise, apart from what the sensors are."""

from __future__ import annotations

import functools
import math
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import numpy as np
from pydantic import Field, model_validator

from testbed.fusion.realisation import Realisation, realise
from testbed.parts import Part, read_shipped
from testbed.signals import transfer
from testbed.units import DelayTime, Frequency, Range, Rate, RateDensity, RateRandomWalk, RateStd

if TYPE_CHECKING:
    from collections.abc import Iterable, Mapping

    import control

    from testbed.signals import ComplexArray, FloatArray

Coefficient = Annotated[float, Field(allow_inf_nan=False)]
Coefficients = Annotated[tuple[Coefficient, ...], Field(max_length=33)]

# Readings are rates in rad/s: beyond this, or its inverse, noise referred to the rate has no number.
_LEAST_GAIN, _HIGHEST_HZ = 1e-30, 1e4
# x^5 / 720, the error of a delay's phase x in its approximation, is a milliradian here.
_PHASE_HOLDS = 0.72**0.2


class SensorBelief(Part):
    r"""Transfer function from true to indicated rate, and noise before and behind it.

    .. math:: z(t) = (G \omega)(t - \tau) + b + \text{noise}, \quad
        e^{-\tau s} \approx \frac{1 - \tau s / 2 + (\tau s)^2 / 12}{1 + \tau s / 2 + (\tau s)^2 / 12}

    The filters know the delay by that Padé approximation, which keeps every gain and adds two states. Its phase errs by
    :math:`(2 \pi f \tau)^5 / 720` rad: `delay_holds_to` is where that is a milliradian.

    Parameters
    ----------
    numerator, denominator : tuple of float
        Coefficients in s [rad/s], highest power first; without a power in the denominator the sensor is static.
    delay : float
        Dead time behind the dynamics [s].
    bias : float
        Constant of the reading [rad/s]; filters take it off.
    input_noise : float
        Two-sided root density of the noise that passes the dynamics [rad/sqrt(s)].
    output_noise : float
        Two-sided root density of the noise on the reading [rad/sqrt(s)].
    noise_knee : float, optional
        Where 1/f noise on the reading equals its white noise [Hz].
    bias_instability : float
        B of 1/f noise that passes the dynamics [rad/s]; S = B^2 / (2 pi f).
    rate_random_walk : float
        K of a random walk that passes the dynamics [rad/s^1.5].
    turn_on_bias : float
        Standard deviation of a constant that passes the dynamics [rad/s].
    lowest_frequency : float
        Below this the 1/f densities are constant [Hz].
    range : float, optional
        Readings at or beyond this are no rate [rad/s].
    resolution : float, optional
        Step of the readings [rad/s].
    source : str
        Where it is from, as shown beside results: the name of a shipped belief, "exact" or "given". It changes nothing.
    """

    numerator: Coefficients
    denominator: Coefficients
    delay: DelayTime = 0.0
    bias: Rate = 0.0
    input_noise: RateDensity = 0.0
    output_noise: RateDensity = 0.0
    noise_knee: Frequency | None = None
    bias_instability: RateStd = 0.0
    rate_random_walk: RateRandomWalk = 0.0
    turn_on_bias: RateStd = 0.0
    lowest_frequency: Frequency = 1e-4
    range: Range | None = None
    resolution: Range | None = None
    source: str = "given"

    @model_validator(mode="after")
    def _check(self) -> SensorBelief:
        largest = self.largest_gain()
        if not _LEAST_GAIN <= largest <= 1.0 / _LEAST_GAIN:
            msg = (
                f"numerator: expected readings of the size of the rate, got a largest gain of {largest:g} between "
                f"{self.lowest_frequency:g} and {_HIGHEST_HZ:g} Hz; the reading is a rate in rad/s"
            )
            raise ValueError(msg)
        return self

    def largest_gain(self) -> float:
        """Return the largest |G| between the lowest frequency and 10 kHz [-]."""
        freq = np.geomspace(self.lowest_frequency, _HIGHEST_HZ, 81)
        return float(np.max(np.abs(self.realisation().response(freq))))

    @property
    def n_state(self) -> int:
        """Number of states of the realisation: one for each pole, and two for a delay."""
        return self.polynomials()[1].size - 1

    @property
    def delay_holds_to(self) -> float:
        """Up to here the phase of the delay's approximation errs by less than a milliradian [Hz]; inf without one."""
        return _PHASE_HOLDS / (2.0 * math.pi * self.delay) if self.delay > 0.0 else math.inf

    @property
    def reading_noise(self) -> float:
        """Two-sided root density of the white noise on the reading, with the input noise of a static sensor
        [rad/sqrt(s)].
        """
        gain = 0.0 if self.n_state else self.numerator[-1] / self.denominator[-1]
        return math.hypot(self.output_noise, gain * self.input_noise)

    @property
    def sees_constant(self) -> bool:
        """Whether a constant rate shows in the reading at all."""
        return self.numerator[-1] != 0.0

    @property
    def walks(self) -> bool:
        """Whether its rate random walk counts above the lowest frequency, so that it is a state of its own."""
        lowest = 2.0 * np.pi * self.lowest_frequency
        beside = self.input_noise**2 + self.bias_instability**2 / lowest
        return bool(self.rate_random_walk**2 > 0.03 * beside * lowest**2)

    def inner_slow_density(self, freq_hz: FloatArray) -> FloatArray:
        """Return the density of the 1/f noise that passes the dynamics [rad^2/s], at frequencies above zero [Hz]."""
        density: FloatArray = self.bias_instability**2 / (2.0 * np.pi * np.maximum(freq_hz, self.lowest_frequency))
        return density

    def outer_slow_density(self, freq_hz: FloatArray) -> FloatArray:
        """Return the density of the 1/f noise on the reading [rad^2/s], at frequencies above zero [Hz]."""
        knee = self.noise_knee or 0.0
        density: FloatArray = self.output_noise**2 * knee / np.maximum(freq_hz, self.lowest_frequency)
        return density

    def slow_density(self, freq_hz: FloatArray) -> FloatArray:
        """Return the density on the reading of all noise that is not white [rad^2/s], at frequencies above zero [Hz].

        The turn-on bias, which is constant, has none.
        """
        power = np.abs(self.realisation().response(freq_hz)) ** 2
        walk = (self.rate_random_walk / (2.0 * np.pi * freq_hz)) ** 2
        density: FloatArray = power * (self.inner_slow_density(freq_hz) + walk) + self.outer_slow_density(freq_hz)
        return density

    def polynomials(self) -> tuple[FloatArray, FloatArray]:
        """Return numerator and denominator with the approximation of the delay, highest power first, without leading
        zeros.
        """
        b, a = (np.trim_zeros(np.asarray(one), "f") for one in (self.numerator, self.denominator))
        if self.delay == 0.0:
            return b, a
        lag = np.array([self.delay**2 / 12.0, self.delay / 2.0, 1.0])
        return np.polymul(b, lag * [1.0, -1.0, 1.0]), np.polymul(a, lag)

    def response(self, freq_hz: FloatArray) -> ComplexArray:
        """Return the frequency response with the delay as it is [-], complex, shape (n_freq,), for frequencies [Hz] of
        that shape.
        """
        freq = np.asarray(freq_hz, float)
        value: ComplexArray = transfer(list(self.numerator), list(self.denominator), freq) * np.exp(
            -2j * np.pi * freq * self.delay
        )
        return value

    def transfer_function(self) -> control.TransferFunction:
        """Return the noise-free dynamics as a python-control transfer function."""
        import control

        return control.TransferFunction(*(one.tolist() for one in self.polynomials()))

    def realisation(self) -> Realisation:
        """Return the modal realisation of the dynamics and the delay's approximation.

        Returns
        -------
        Realisation
            A [1/s], B [1/s], C [-], D [-], shapes (n, n), (n,), (n,).

        Raises
        ------
        ValueError
            If the transfer function is improper or unstable.
        """
        return realise(*self.polynomials())


@functools.cache
def _shipped(name: str) -> dict[str, SensorBelief]:
    content = read_shipped("belief", "testbed.fusion", "beliefs", name)
    return {
        key: SensorBelief.model_validate({**value, "source": name}, context={"border": True})
        for key, value in content.items()
    }


def check_belief(belief: Mapping[str, SensorBelief], sensors: Iterable[str]) -> None:
    """Raise ValueError if there is no sensor, or one of which nothing is believed."""
    names = list(sensors)
    if not names or any(name not in belief for name in names):
        msg = f"belief: expected one for each of {names}, got {list(belief)}"
        raise ValueError(msg)


def load_belief(source: str | Mapping[str, Any]) -> dict[str, SensorBelief]:
    """Return the belief of each sensor.

    Parameters
    ----------
    source : str or mapping
        Name of a shipped belief, a YAML file of one (a name that ends in ``.yaml``), or sensor name -> `SensorBelief`
        or its fields (SI floats or strings with units).

    Returns
    -------
    dict of str to SensorBelief
        One entry per sensor.

    Raises
    ------
    UnknownNameError
        If no belief of that name is shipped.
    ScenarioError
        If a file cannot be read, or something in it is wrong, with the line.
    ValueError
        If a transfer function or a noise is not acceptable, or the exact belief is asked for: only who knows the
        simulated sensors has that.

    Examples
    --------
    >>> sorted(load_belief("eq39"))
    ['mems_gyro', 'mhd_ars']
    >>> own = {"gyro": {"numerator": [1.0], "denominator": [0.01, 1.0], "output_noise": "0.3 deg/sqrt(h)"}}
    >>> load_belief(own)["gyro"].denominator
    (0.01, 1.0)
    """
    from testbed.fusion.belief_file import is_belief_file, read_belief

    if source == "exact":
        msg = (
            "belief: 'exact' is known of simulated instruments only, not of arrays; say of which, such as "
            "belief={'mhd_ars': testbed.belief_of('sx300', exact=True)}"
        )
        raise ValueError(msg)
    if isinstance(source, str) and is_belief_file(source):
        return read_belief(Path(source))
    if isinstance(source, str):
        return dict(_shipped(source))
    return {name: SensorBelief.model_validate(value) for name, value in source.items()}


def declared(belief: Mapping[str, SensorBelief]) -> str:
    """Return in words where a belief is from: one source, or that of each sensor.

    Parameters
    ----------
    belief : mapping of str to SensorBelief
        Of each sensor.
    """
    sources = {one.source for one in belief.values()}
    if len(sources) == 1:
        return sources.pop()
    return ", ".join(f"{name}: {one.source}" for name, one in belief.items())


def default_belief() -> dict[str, SensorBelief]:
    """Return equation (39) of paper 1 (doi 10.1109/TIM.2024.3375962) with the noise of the presets."""
    return load_belief("eq39")
