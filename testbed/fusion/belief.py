"""What a filter believes about its sensors: a transfer function and white noise, apart from what the sensors are."""

from __future__ import annotations

import functools
from dataclasses import dataclass
from importlib import resources
from typing import TYPE_CHECKING, Annotated, Any

import numpy as np
from pydantic import Field, model_validator

from testbed.errors import UnknownNameError
from testbed.parts import Part
from testbed.units import Frequency, Range, RateDensity, RateRandomWalk, RateStd

if TYPE_CHECKING:
    from collections.abc import Iterable, Mapping

    import control

    from testbed.signals import ComplexArray, FloatArray

Coefficient = Annotated[float, Field(allow_inf_nan=False)]
Coefficients = Annotated[tuple[Coefficient, ...], Field(max_length=33)]

_CLOSEST_POLES = 1e-3
# Readings are rates in rad/s: beyond this, or its inverse, noise referred to the rate has no number.
_LEAST_GAIN, _HIGHEST_HZ = 1e-30, 1e4


@dataclass(frozen=True)
class Realisation:
    """State matrices of one sensor: x' = A x + B u, y = C x + D u; A block diagonal, C of ones and zeros.

    Parameters
    ----------
    A, B, C : ndarray, shapes (n_state, n_state), (n_state,), (n_state,)
        Dynamics [1/s], input [1/s] and output [-].
    D : float
        Feed-through [-].
    """

    A: FloatArray
    B: FloatArray
    C: FloatArray
    D: float

    def response(self, freq_hz: FloatArray) -> ComplexArray:
        """Return C (s I - A)^-1 B + D [-] at s = 2 pi j f, complex, shape (n_freq,), for frequencies [Hz] of that
        shape.
        """
        s = 2j * np.pi * np.asarray(freq_hz, float)[:, None, None]
        state = np.linalg.solve(
            s * np.eye(self.B.size) - self.A, np.broadcast_to(self.B[:, None], (s.size, self.B.size, 1))
        )
        value: ComplexArray = (state[..., 0] @ self.C) + self.D
        return value


class SensorBelief(Part):
    """Transfer function from true to indicated rate, and white noise before and behind it.

    Parameters
    ----------
    numerator, denominator : tuple of float
        Coefficients in s [rad/s], highest power first.
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
    def n_pole(self) -> int:
        """Number of poles, and of states of the realisation."""
        return np.trim_zeros(np.asarray(self.denominator), "f").size - 1

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

    def transfer_function(self) -> control.TransferFunction:
        """Return the noise-free dynamics as a python-control transfer function."""
        import control

        return control.TransferFunction(list(self.numerator), list(self.denominator))

    def realisation(self) -> Realisation:
        r"""Return the modal realisation whose states are the parts of the reading, so that all are of the size of the
        rate.

        .. math:: G(s) = D + \sum_i r_i / (s - p_i)

        A real pole is the state x' = p x + r u; a pair is a rotation. The output is the sum of the states (first ones
        of pairs).

        Returns
        -------
        Realisation
            A [1/s], B [1/s], C [-], D [-], shapes (n, n), (n,), (n,).

        Raises
        ------
        ValueError
            If the transfer function is improper, static or unstable, or poles coincide.
        """
        a, b = _monic(np.asarray(self.denominator), np.asarray(self.numerator))
        poles = np.roots(a).astype(complex)
        _check_poles(poles)
        D = float(b[0])
        residues = (np.polyval(b - D * a, poles) / np.polyval(np.polyder(a), poles)).astype(complex)
        return _modal(poles, residues, D)


def _monic(a: FloatArray, b: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return denominator and numerator of equal length, divided by the leading coefficient of the denominator."""
    a, b = np.trim_zeros(a, "f"), np.trim_zeros(b, "f")
    if a.size < 2:
        msg = f"denominator: expected at least one pole, got coefficients {a.tolist()}"
        raise ValueError(msg)
    if b.size > a.size:
        msg = f"numerator: expected a degree of at most {a.size - 1} (the denominator's), got {b.size - 1}"
        raise ValueError(msg)
    return a / a[0], np.concatenate([np.zeros(a.size - b.size), b]) / a[0]


def _check_poles(poles: ComplexArray) -> None:
    if np.any(poles.real > 0.0):
        msg = f"denominator: expected a stable sensor, got the poles {np.round(poles, 6).tolist()} rad/s"
        raise ValueError(msg)
    distance = np.abs(poles[:, None] - poles[None, :]) + np.diag(np.full(poles.size, np.inf))
    if np.any(distance < _CLOSEST_POLES * np.abs(poles)):
        msg = (
            f"denominator: expected distinct poles, got {np.round(poles, 6).tolist()} rad/s; the modal form needs them "
            "apart: move one of the coinciding poles by 1 %"
        )
        raise ValueError(msg)


def _modal(poles: ComplexArray, residues: ComplexArray, D: float) -> Realisation:
    """Return the block-diagonal realisation of poles [rad/s] and residues [1/s], slowest pole first."""
    upper = np.flatnonzero(poles.imag >= 0.0)
    order = upper[np.argsort(np.abs(poles[upper]))]
    n = poles.size
    A, B, C = np.zeros((n, n)), np.zeros(n), np.zeros(n)
    i = 0
    for pole, residue in zip(poles[order], residues[order], strict=True):
        C[i] = 1.0
        A[i, i], B[i] = pole.real, residue.real
        if pole.imag > 0.0:
            A[i : i + 2, i : i + 2] = [[pole.real, pole.imag], [-pole.imag, pole.real]]
            B[i : i + 2] = 2.0 * residue.real, -2.0 * residue.imag
            i += 1
        i += 1
    return Realisation(A, B, C, D)


@functools.cache
def _shipped(name: str) -> dict[str, SensorBelief]:
    from ruamel.yaml import YAML

    folder = resources.files("testbed.fusion") / "beliefs"
    names = [entry.name.removesuffix(".yaml") for entry in folder.iterdir() if entry.name.endswith(".yaml")]
    if name not in names:
        kind = "belief"
        raise UnknownNameError(kind, name, names)
    content = YAML(typ="safe", pure=True).load((folder / f"{name}.yaml").read_text(encoding="utf-8"))
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
        Name of a shipped belief, or sensor name -> `SensorBelief` or its fields (SI floats or strings with units).

    Returns
    -------
    dict of str to SensorBelief
        One entry per sensor.

    Raises
    ------
    UnknownNameError
        If no belief of that name is shipped.
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
    if source == "exact":
        msg = (
            "belief: 'exact' is known of simulated instruments only, not of arrays; say of which, such as "
            "belief={'mhd_ars': testbed.belief_of('sx300', exact=True)}"
        )
        raise ValueError(msg)
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
