"""The MHD channel: liquid metal between two walls in a magnetic field, equation (2) of Su et al. 2024.

`u = v_fluid - v_wall`, zero at the walls h = 0 and l; `v` is the wall velocity, `<>` the mean over h,
`a = sigma B^2/rho`, `nu = mu/rho`.
All three closures are `u_t = nu u_hh - delta u - kappa <u> - v_t`:

=============== ======================================================== ======= ==============
closure         Lorentz braking                                          delta   kappa
=============== ======================================================== ======= ==============
`local`         by the slip at every h                                   a       0
`radial_field`  radial B, axial current uniform in h                     0       beta a
`axial_field`   axial B, radial current, Hartmann layers                 a       -(1 - beta) a
=============== ======================================================== ======= ==============

beta = R_i/(R_i + Z) is the load fraction: 1 short circuit, 0 open.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Annotated, Literal

import numpy as np
from pydantic import Field, field_validator

from testbed.models.mhd_channel.chebyshev import chebyshev_points
from testbed.models.mhd_channel.fluids import NamedFluid
from testbed.models.mhd_channel.modes import ChannelModes, ChannelStage, channel_modes
from testbed.models.mhd_channel.similarity import SimilarityStage, radial_basis
from testbed.models.mhd_channel.thermal_drift import drift
from testbed.parts import Part
from testbed.units import Length, MagneticField, RatioPerKelvin

if TYPE_CHECKING:
    from numpy.typing import ArrayLike
    from pydantic import ValidationInfo

    from testbed.signals import ComplexArray, FloatArray

MIN_NODES = 8
# Rounding grows as nodes^4 (about 1e-12 of the response at 512), and nothing measured needs more.
MAX_NODES = 512
HALF_POWER = np.sqrt(0.5)


class MhdChannel(Part):
    r"""A channel of height l whose output is minus the mean slip: `response` H = -<u>/v applied to the wall's rate.

    .. math:: H = \frac{s F}{s + \delta + \kappa F}, \; F = 1 - \frac{\tanh z}{z},
        \; z = \frac{l}{2}\sqrt{(s + \delta)/\nu}

    That is the `linear` flow. Large, slow swings drive a secondary flow, which `similarity` adds
    (`testbed.models.mhd_channel.similarity`); its response to small ones is the same.

    Parameters
    ----------
    fluid : Fluid
        Or the name of one in `FLUIDS`.
    height : float
        l [m].
    field : float
        Magnetic flux density B at 20 degC [T].
    field_drift : float
        Relative change of B per kelvin at 20 degC, that of the magnet's remanence [1/K].
    closure : {"local", "radial_field", "axial_field"}
        How the current closes; see the module's table.
    load_fraction : float
        beta, 0 to 1 [-]; only 1 with `local`.
    nodes : int
        Chebyshev intervals of the grid over h, even, 8 to 512 [-].
    flow : {"linear", "similarity"}
        Without or with the secondary flow.

    References
    ----------
    Su et al., IEEE Trans. Instrum. Meas. 2024, doi 10.1109/TIM.2024.3375962, equation (2).

    Examples
    --------
    >>> channel = MhdChannel(fluid="mercury", height=15e-3, field=0.448)
    >>> abs(channel.response([0.01, 1.0, 100.0])).round(3)
    array([0.004, 0.373, 0.998])
    """

    fluid: NamedFluid
    height: Length
    field: MagneticField
    field_drift: RatioPerKelvin = 0.0
    closure: Literal["local", "radial_field", "axial_field"] = "local"
    load_fraction: Annotated[float, Field(strict=True, ge=0.0, le=1.0, allow_inf_nan=False)] = 1.0
    nodes: Annotated[int, Field(strict=True)] = 160
    flow: Literal["linear", "similarity"] = "linear"

    @field_validator("load_fraction")
    @classmethod
    def _load_fits_closure(cls, value: float, info: ValidationInfo) -> float:
        if info.data.get("closure") == "local" and value != 1.0:
            msg = f"expected 1 with closure 'local' (which has no load), got {value:g}"
            raise ValueError(msg)
        return value

    @field_validator("nodes")
    @classmethod
    def _grid_is_even(cls, value: int) -> int:
        if value % 2 or not MIN_NODES <= value <= MAX_NODES:
            msg = f"expected an even number from {MIN_NODES} to {MAX_NODES}, got {value}"
            raise ValueError(msg)
        return value

    def at(self, temperature: float) -> MhdChannel:
        """Return the channel as it is at `temperature` [K], of constant properties; walls do not expand."""
        field = self.field * drift(self.field_drift, temperature)
        return self.model_copy(update={"fluid": self.fluid.at(temperature), "field": field, "field_drift": 0.0})

    @property
    def braking_rate(self) -> float:
        """Lorentz braking rate a = sigma B^2/rho [1/s]."""
        return self.fluid.conductivity * self.field**2 / self.fluid.density

    @property
    def radial_braking_rate(self) -> float:
        """Braking rate b of radial flow [1/s]: a where the field is axial and so crosses it, else 0."""
        return self.braking_rate if self.closure == "axial_field" else 0.0

    @property
    def hartmann_number(self) -> float:
        """Hartmann number on half the height, Ha = B (l/2) sqrt(sigma/mu) [-]."""
        return float(0.5 * self.field * self.height * np.sqrt(self.fluid.conductivity / self.fluid.viscosity))

    @property
    def heights(self) -> FloatArray:
        """Points of the grid, ascending from wall to wall, shape (nodes + 1,) [m]."""
        return self.height * chebyshev_points(self.nodes)

    @property
    def corner_freq_hz(self) -> float:
        """Frequency where the closed form has fallen to 1/sqrt(2) [Hz]."""
        from scipy.optimize import brentq

        def excess(log_freq: float) -> float:
            return float(np.abs(self.response(np.exp(log_freq))) - HALF_POWER)

        # |H| rises from 0 to 1, so walking by decades from the one-mode corner brackets the crossing.
        low = high = np.log(_one_mode_rate(self) / (2 * np.pi))
        decade = np.log(10.0)
        while excess(low) > 0.0:
            low -= decade
        while excess(high) <= 0.0:
            high += decade
        return float(np.exp(brentq(excess, low, high, xtol=1e-13)))

    def response(self, freq_hz: ArrayLike) -> ComplexArray:
        """Return the closed form of the response H = -<u>/v, safe for any height, field and frequency.

        Parameters
        ----------
        freq_hz : array_like, shape (n_freq,)
            Frequency [Hz]; 0 gives 0.

        Returns
        -------
        ndarray of complex, shape (n_freq,)
            H [-].

        Raises
        ------
        ValueError
            If a frequency is not finite.
        """
        s = _laplace(freq_hz)
        delta, kappa = self._braking()
        # With F = z^2 G the common factor s + delta of numerator and denominator cancels: no 0/0 at f = 0 or B = 0.
        viscous_time = 0.25 * self.height**2 / self.fluid.kinematic_viscosity
        G = _slip_factor(viscous_time * (s + delta))
        response: ComplexArray = s * viscous_time * G / (1.0 + kappa * viscous_time * G)
        return response

    def discrete_response(self, freq_hz: ArrayLike) -> ComplexArray:
        """Return the response of the grid with `nodes` intervals, continuous in time.

        Parameters
        ----------
        freq_hz : array_like, shape (n_freq,)
            Frequency [Hz].

        Returns
        -------
        ndarray of complex, shape (n_freq,)
            H [-]; tends to 1 - 1/(nodes^2 - 1) far above the grid's resolution.

        Raises
        ------
        ValueError
            If a frequency is not finite.
        """
        return self._modes().response(_laplace(freq_hz))

    def start(self, sample_rate_hz: float) -> ChannelStage:
        """Return the channel in time, at rest, for samples at `sample_rate_hz` [Hz] that arrive block by block."""
        if self.flow == "linear":
            return ChannelStage(self._modes(), sample_rate_hz)
        return SimilarityStage(
            self._modes(), sample_rate_hz, radial_basis(self.nodes, self._diffusion(), self.radial_braking_rate)
        )

    def simulate(self, wall_rate: FloatArray, sample_rate_hz: float) -> FloatArray:
        """Solve the fluid equation in time from rest.

        Parameters
        ----------
        wall_rate : ndarray, shape (n_time,)
            Wall velocity or rate, any unit, rad/s with the flow `similarity`; linear between samples.
        sample_rate_hz : float
            Rate of the samples [Hz].

        Returns
        -------
        ndarray, shape (n_time,)
            Minus the mean slip, unit of `wall_rate`.

        Raises
        ------
        ValueError
            If a sample is NaN or infinite, or the sample rate is not positive.
        """
        return self.start(sample_rate_hz).process(wall_rate)

    def _braking(self) -> tuple[float, float]:
        """Return delta and kappa [1/s] of the module's table."""
        a, beta = self.braking_rate, self.load_fraction
        return {"local": (a, 0.0), "radial_field": (0.0, beta * a), "axial_field": (a, -(1.0 - beta) * a)}[self.closure]

    def _modes(self) -> ChannelModes:
        return channel_modes(self.nodes, self._diffusion(), *self._braking())

    def _diffusion(self) -> float:
        """Return nu/l^2 [1/s]."""
        return self.fluid.kinematic_viscosity / self.height**2


def one_mode_response(channel: MhdChannel, freq_hz: ArrayLike) -> ComplexArray:
    r"""Return the one-mode form of Su et al. (4), :math:`s/(s + a_1)`, :math:`a_1 = \pi^2 \nu/l^2 + \sigma B^2/\rho`.

    An approximation kept under its own name, because papers use it. What is wrong with it: the paper's gain
    8 k/(nu pi^2) is dimensionally wrong (1 here); the first mode carries only 8/pi^2 = 0.81 of the output, and the
    modes n = 3, 5, ... that carry the rest decay faster, so the channel falls short of it by the Stokes-layer tail
    (2/l) sqrt(nu/w), which falls as 1/sqrt(f) only. It is off by up to 9 % (mercury, 10 mm, 0.036 T) and 2.5 %
    (4 mm, 0.45 T), and knows the `local` closure alone.

    Parameters
    ----------
    channel : MhdChannel
        Fluid, height and field are used.
    freq_hz : array_like, shape (n_freq,)
        Frequency [Hz].

    Returns
    -------
    ndarray of complex, shape (n_freq,)
        Approximate H [-].

    Raises
    ------
    ValueError
        If a frequency is not finite.

    References
    ----------
    Su et al., IEEE Trans. Instrum. Meas. 2024, equation (4).

    Examples
    --------
    >>> channel = MhdChannel(fluid="mercury", height=15e-3, field=0.448)
    >>> abs(one_mode_response(channel, [1.0])).round(3)
    array([0.377])
    """
    s = _laplace(freq_hz)
    response: ComplexArray = s / (s + _one_mode_rate(channel))
    return response


def _one_mode_rate(channel: MhdChannel) -> float:
    return np.pi**2 * channel.fluid.kinematic_viscosity / channel.height**2 + channel.braking_rate


def _slip_factor(z2: ComplexArray) -> ComplexArray:
    """Return G = (1 - tanh(z)/z)/z^2 from z^2, without cancellation near 0 (G = 1/3) and without overflow far out."""
    small = np.abs(z2) < 1.0
    # tanh(z)/z = 1/(1 + z^2/(3 + z^2/(5 + ...))); ten levels leave less than 1e-20 for |z| < 1.
    inner = np.where(small, z2, 0.0)
    fraction = np.full_like(inner, 21.0)
    for odd in range(19, 1, -2):
        fraction = odd + inner / fraction
    near = 1.0 / (fraction + inner)
    outer = np.where(small, 1.0, z2)
    z = np.sqrt(outer)
    decayed = np.exp(-2.0 * z)
    far = (1.0 - (1.0 - decayed) / ((1.0 + decayed) * z)) / outer
    factor: ComplexArray = np.where(small, near, far)
    return factor


def _laplace(freq_hz: ArrayLike) -> ComplexArray:
    """Return s = 2 pi j f [rad/s]; ValueError if a frequency is not finite."""
    freq = np.asarray(freq_hz, dtype=np.float64)
    if not np.isfinite(freq).all():
        msg = f"freq_hz: expected finite frequencies in Hz, got {freq[~np.isfinite(freq)].flat[0]}"
        raise ValueError(msg)
    return np.asarray(2j * np.pi * freq, dtype=np.complex128)
