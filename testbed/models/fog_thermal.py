"""The bias of a fibre-optic gyro that follows temperature: statics, Shupe effect, coil gradient, hysteresis, lags.

Heat and mechanics, no readings; random only where coefficients scatter between cycles, by the generator that is handed
in. The numbers are the instrument's, see the sensor's preset.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Annotated

import numpy as np
from numba import njit

from testbed.parts import Part
from testbed.units import PositiveDuration, Quantity, RatePerKelvin, Temperature

if TYPE_CHECKING:
    from testbed.signals import FloatArray

RatePerKelvin2 = Annotated[float, Quantity("rad/s/K^2", "1e-5 deg/h/K^2")]
RatePerKelvin3 = Annotated[float, Quantity("rad/s/K^3", "1e-7 deg/h/K^3")]
ShupeCoefficient = Annotated[float, Quantity("rad/K", "0.45 deg/h/(K/min)")]
ShupePerKelvin = Annotated[float, Quantity("rad/K^2", "0.002 deg/h/(K/min)/K")]
# A step of temperature: the bound catches one written in degC, which is read as absolute.
HalfWidth = Annotated[float, Quantity("K", "5 K", at_least=0.0, at_most=100.0)]
# Beyond 1 a coefficient has no sign of its own.
Scatter = Annotated[float, Quantity("", "10 %", at_least=0.0, at_most=1.0)]
# What scatters; lags and widths are geometry.
COEFFICIENTS = ("linear", "quadratic", "cubic", "shupe", "shupe_temperature", "gradient", "hysteresis")


@njit(cache=True)
def advance_thermal(u, keep, rise, width, state, behind, play):  # type: ignore[no-untyped-def] # pragma: no cover
    """Advance lags and play operators over the ambient temperatures `u`; see `FogThermalStage` for the equations.

    state = [last u, e_coil, e_spool, e_core, p_1, p_2], kept; behind, shape (3, n), gets e; play, shape (2, n), gets p.
    """
    for k in range(u.size):
        step = u[k] - state[0]
        state[0] = u[k]
        for i in range(3):
            state[1 + i] = keep[i] * state[1 + i] + rise[i] * step
            behind[i, k] = state[1 + i]
        core = u[k] - state[3]
        for i in range(2):
            state[4 + i] = min(max(state[4 + i], core - width[i]), core + width[i])
            play[i, k] = state[4 + i]


class FogThermal(Part):
    r"""Bias of a fibre-optic gyro by temperature.

    The ambient temperature :math:`T_a` reaches three places, each with a lag of its own: the coil, the spool inside it
    and the core of the instrument (optics on their mount),

    .. math:: \tau_i \dot T_i = T_a - T_i, \quad i = c, s, o.

    With :math:`\vartheta = T_c - T_0` and play operators :math:`p_j = P_{r_j}[T_o]`,

    .. math:: b = c_1 \vartheta + c_2 \vartheta^2 + c_3 \vartheta^3 + (S + S_T \vartheta) \dot T_c + g (T_c - T_s)
        + \sum_j h_j (p_j - T_o), \qquad
        p_j(t) = \min(\max(p_j(t^-), T_o - r_j), T_o + r_j).

    A play operator stays behind its input by up to its half-width :math:`r_j`: it depends on the turning points and not
    on the speed. At the start everything is in equilibrium with the first temperature: no gradient, no rate, p_j = T_o.

    Parameters
    ----------
    reference_temperature : float
        T_0, where the bias at rest is zero [K].
    linear, quadratic, cubic : float
        c_1 [rad/s/K], c_2 [rad/s/K^2], c_3 [rad/s/K^3].
    shupe : float
        S, bias per rate of temperature of the coil [rad/K].
    shupe_temperature : float
        S_T, its change with temperature [rad/K^2].
    gradient : float
        g, bias per difference of temperature across the coil [rad/s/K].
    hysteresis : tuple of 2 float
        h_1, h_2, bias per kelvin that a play operator is behind [rad/s/K].
    half_width : tuple of 2 float
        r_1, r_2 of the play operators [K].
    coil_lag, spool_lag, core_lag : float
        tau_c, tau_s, tau_o [s].
    scatter : float
        Standard deviation, between one switch-on and the next, of each coefficient over itself [-]; see `drawn`.

    References
    ----------
    D. M. Shupe, Appl. Opt. 19 (1980) 654, for the term in the rate of temperature; M. Brokate, J. Sprekels,
    "Hysteresis and Phase Transitions" (1996), section 2.3, for the play operator. The structure is ours: paper 3
    (doi 10.3390/mi14091712) gives none.
    """

    reference_temperature: Temperature = 293.15
    linear: RatePerKelvin = 0.0
    quadratic: RatePerKelvin2 = 0.0
    cubic: RatePerKelvin3 = 0.0
    shupe: ShupeCoefficient = 0.0
    shupe_temperature: ShupePerKelvin = 0.0
    gradient: RatePerKelvin = 0.0
    hysteresis: tuple[RatePerKelvin, RatePerKelvin] = (0.0, 0.0)
    half_width: tuple[HalfWidth, HalfWidth] = (0.0, 0.0)
    coil_lag: PositiveDuration = 900.0
    spool_lag: PositiveDuration = 1500.0
    core_lag: PositiveDuration = 2400.0
    scatter: Scatter = 0.0

    def drawn(self, rng: np.random.Generator) -> FogThermal:
        r"""Return the instrument of one cycle, :math:`c (1 + s \epsilon)` with a normal epsilon per coefficient.

        What is no temperature and does not come back from cycle to cycle: stress that relaxes, moisture, glue. A model
        trained on other cycles cannot know it. Lags and half-widths stay.

        Parameters
        ----------
        rng : Generator
            Of this cycle.

        Returns
        -------
        FogThermal
            Without scatter; itself if it has none.
        """
        if not self.scatter:
            return self
        n_play = len(self.hysteresis)
        factors = 1.0 + self.scatter * rng.standard_normal(len(COEFFICIENTS) - 1 + n_play)
        single = {name: getattr(self, name) * factor for name, factor in zip(COEFFICIENTS[:-1], factors, strict=False)}
        hysteresis = tuple(h * factor for h, factor in zip(self.hysteresis, factors[-n_play:], strict=True))
        return self.model_copy(update={**single, "hysteresis": hysteresis, "scatter": 0.0})

    def start(self, sample_rate_hz: float, temperature: float | None = None) -> FogThermalStage:
        """Return the instrument's temperatures in equilibrium.

        Parameters
        ----------
        sample_rate_hz : float
            Rate of the samples [Hz].
        temperature : float, optional
            Ambient temperature of the equilibrium [K]; that of the first sample if not given.

        Returns
        -------
        FogThermalStage
            ``process(temperature)`` gives the bias [rad/s].
        """
        return FogThermalStage(self, sample_rate_hz, temperature)

    def bias(self, temperature: FloatArray, sample_rate_hz: float) -> FloatArray:
        """Return the bias over a whole record that starts in equilibrium.

        Parameters
        ----------
        temperature : ndarray, shape (n_time,)
            Ambient temperature [K].
        sample_rate_hz : float
            Its sample rate [Hz].

        Returns
        -------
        ndarray, shape (n_time,)
            Bias b [rad/s].
        """
        return self.start(sample_rate_hz).process(np.asarray(temperature, dtype=np.float64))


class FogThermalStage:
    r"""The temperatures inside a fibre-optic gyro in time; any division into blocks gives the same bits.

    A place is :math:`e_i = T_a - T_i` behind the ambient temperature, :math:`\dot e_i = \dot T_a - e_i / \tau_i`; with
    T_a straight between samples exactly :math:`e_i^+ = a e_i + \frac{1 - a}{h} (T_a^+ - T_a)`, a = e^-h, h = T/tau_i.
    Kept instead of T_i, e_i loses no digits at a fast clock and is the rate of temperature, :math:`\dot T_i = e_i /
    \tau_i`.

    Parameters
    ----------
    model : FogThermal
        Parameters.
    sample_rate_hz : float
        Rate of the samples [Hz].
    temperature : float, optional
        Ambient temperature of the equilibrium at the start [K]; that of the first sample if not given.
    """

    def __init__(self, model: FogThermal, sample_rate_hz: float, temperature: float | None = None) -> None:
        self._model, self._reference = model, model.reference_temperature
        lags = (model.coil_lag, model.spool_lag, model.core_lag)
        h = np.array([1.0 / (lag * sample_rate_hz) for lag in lags])
        self._keep, self._rise = np.exp(-h), -np.expm1(-h) / h
        self._width = np.array(model.half_width)
        self._state = np.full(6, math.nan)
        self.coil_temperature: FloatArray = np.empty(0)
        if temperature is not None:
            self._settle(temperature)

    def _settle(self, temperature: float) -> None:
        heat = temperature - self._reference
        self._state[:] = (heat, 0.0, 0.0, 0.0, heat, heat)

    def process(self, temperature: FloatArray) -> FloatArray:
        """Return the bias over the next samples; `coil_temperature` [K] then holds that of the coil.

        Parameters
        ----------
        temperature : ndarray, shape (n_time,)
            Ambient temperature [K].

        Returns
        -------
        ndarray, shape (n_time,)
            Bias b [rad/s].

        Raises
        ------
        ValueError
            If a temperature is not finite: it would stay in the state for good.
        """
        if not np.isfinite(temperature).all():
            msg = f"temperature: expected finite values, got {temperature[~np.isfinite(temperature)][0]}"
            raise ValueError(msg)
        if temperature.size and math.isnan(self._state[0]):
            self._settle(float(temperature[0]))
        u = temperature - self._reference
        behind, play = np.empty((3, u.size)), np.empty((2, u.size))
        advance_thermal(u, self._keep, self._rise, self._width, self._state, behind, play)
        self.coil_temperature = temperature - behind[0]
        return self._bias(u, behind, play)

    def _bias(self, u: FloatArray, behind: FloatArray, play: FloatArray) -> FloatArray:
        m, heat, core = self._model, u - behind[0], u - behind[2]
        bias: FloatArray = heat * (m.linear + heat * (m.quadratic + heat * m.cubic))
        bias += (m.shupe + m.shupe_temperature * heat) * (behind[0] / m.coil_lag)
        bias += m.gradient * (behind[1] - behind[0])
        for h, p in zip(m.hysteresis, play, strict=True):
            bias += h * (p - core)
        return bias
