"""The air-bearing turntable in numbers: every parameter of the plant, with the defaults of the preset `air_bearing`."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Annotated, Any, Literal

import numpy as np
from pydantic import Field, field_validator, model_validator

from testbed.models.turntable.earth import EarthRate
from testbed.models.turntable.floor import Floor
from testbed.parts import Part
from testbed.signals import BASE_RATE_HZ
from testbed.units import Angle, AngularDrag, Frequency, Inertia, Length, Mass, Position, Quantity, Torque

if TYPE_CHECKING:
    from typing import Self

    from pydantic import ValidationInfo


@dataclass(frozen=True)
class AutoQuantity(Quantity):
    """A quantity, or the word auto."""

    def validate(self, value: Any, info: ValidationInfo) -> Any:
        """Return the SI float of `value`, or auto."""
        return value if value == "auto" else super().validate(value, info)

    def _write(self, value: Any, info: Any) -> Any:
        return value if value == "auto" else super()._write(value, info)


# From 500 steps in one of the base clock to 200 of its in one.
Step = Annotated[float | Literal["auto"], AutoQuantity("s", "50 us", at_least=1e-7, at_most=1e-2)]
PositiveTorque = Annotated[float, Quantity("N*m", "6 N*m", above=0.0)]
Acceleration = Annotated[float, Quantity("m/s^2", "9.80665 m/s^2", at_least=0.0)]
DampingRatio = Annotated[float, Field(gt=0.0, lt=1.0, allow_inf_nan=False)]
Windage = Annotated[float, Quantity("N*m*s^2/rad^2", "0.1 mN*m*s^2/rad^2", at_least=0.0)]
Share = Annotated[float, Field(ge=0.0, lt=1.0, allow_inf_nan=False)]
RelativeError = Annotated[float, Field(gt=-1.0, lt=10.0, allow_inf_nan=False)]
Vector = tuple[Position, Position, Position]
Inertias = tuple[Inertia, Inertia, Inertia]
SixFrequencies = tuple[Frequency, Frequency, Frequency, Frequency, Frequency, Frequency]


class Mounting(Part):
    """Where a sensor sits on the table and how far its axis is off the vertical.

    The sensing axis is Rx(a) Ry(b) e_z = (sin b, -sin a cos b, cos a cos b) for the misalignment (a, b).

    Parameters
    ----------
    position : tuple of 3 float
        From the nominal mounting point in the centre of the table top [m].
    misalignment : tuple of 2 float
        Tilt (a, b) of the sensing axis about the table's x and y [rad].
    """

    position: Vector = (0.0, 0.0, 0.0)
    misalignment: tuple[Angle, Angle] = (0.0, 0.0)


class Cogging(Part):
    """One harmonic of the motor's cogging torque, A sin(n angle + phase).

    Parameters
    ----------
    torque : float
        Amplitude A [N m].
    periods : int
        Periods n per revolution.
    phase : float
        Phase [rad].
    """

    torque: Torque
    periods: Annotated[int, Field(ge=1)]
    phase: Angle = 0.0


class Wobble(Part):
    """One harmonic of the bearing's synchronous tilt error motion: the tilt it enforces is A sin(n angle + phase).

    Parameters
    ----------
    axis : {"rx", "ry"}
        Tilt of the spin axis about the stator's x or y.
    angle : float
        Amplitude A [rad].
    periods : int
        Periods n per revolution.
    phase : float
        Phase [rad].
    """

    axis: Literal["rx", "ry"]
    angle: Angle
    periods: Annotated[int, Field(ge=1)]
    phase: Angle = 0.0


class Ripple(Part):
    """One harmonic of the motor's torque over current: torque = command (1 + r sin(n angle + phase)).

    Parameters
    ----------
    relative : float
        Amplitude r, relative to the mean [-].
    periods : int
        Periods n per revolution.
    phase : float
        Phase [rad].
    """

    relative: Share
    periods: Annotated[int, Field(ge=1)]
    phase: Angle = 0.0


class Digital(Part):
    """What the servo of mode `digital` has beyond that of mode `servo`.

    Parameters
    ----------
    encoder_bits : int
        The encoder gives 2^bits counts per revolution.
    controller_rate : float
        Ticks of the controller per second [Hz]; the base clock is a whole multiple. The torque is held between them.
    velocity_filter : float
        Corner of the first-order filter on the differences of the encoder, and of the reference [Hz].
    ripple : tuple of Ripple
        Harmonics of the motor's torque, proportional to its current; empty for none.

    Raises
    ------
    pydantic.ValidationError
        If the ripple could turn the motor's torque around.
    """

    encoder_bits: Annotated[int, Field(ge=8, le=40)] = 24
    controller_rate: Frequency = BASE_RATE_HZ
    velocity_filter: Frequency = 600.0
    ripple: tuple[Ripple, ...] = (Ripple(relative=0.005, periods=12),)

    @field_validator("ripple")
    @classmethod
    def _keeps_sign(cls, ripple: tuple[Ripple, ...]) -> tuple[Ripple, ...]:
        total = sum(one.relative for one in ripple)
        if total >= 1.0:
            msg = f"expected amplitudes of less than 1 in sum, got {total:g}"
            raise ValueError(msg)
        return ripple

    @property
    def resolution(self) -> float:
        """One count of the encoder [rad]."""
        return float(2 * np.pi / 2**self.encoder_bits)

    @property
    def filter_gain(self) -> float:
        """Gain 1 - exp(-2 pi f T) of the filter per tick."""
        return float(-np.expm1(-2 * np.pi * self.velocity_filter / self.controller_rate))


class TurntableParameters(Part):
    """The turntable: isolated platform, air-bearing rotor, motor and servo.

    Axes: x, y horizontal, z up. Frequencies are those of one body alone, of the platform on its mounts and of the rotor
    in its bearing on a held platform: k = m (2 pi f)^2, c = 2 zeta (2 pi f) m. What the whole table does is told by
    `testbed.models.turntable.modes.coupled_modes`.

    Parameters
    ----------
    mode : {"servo", "digital", "ideal", "fixed"}
        `servo`: the full plant follows the command as its analogue servo can. `digital`: the same under a sampled
        controller that reads a quantised encoder. `ideal`: a single hinge under the exact inverse torque. `fixed`: no
        plant, the truth is the command.
    step : float or "auto"
        Integration step [s]; a whole part or multiple of the 50 us over which references are held, or `auto`: as long
        as the true rate stays within 1e-6 of its largest value, see `testbed.scenario.step_choice.choose_step`.
    engine : {"mujoco", "modal", "auto"}
        What plays the plant: MuJoCo's steps; the modes of its linearisation, exact over each hold (modes `servo` and
        `ideal`, `testbed.models.turntable.modal`); or the modes where excerpts played by both agree to 1e-6 of the
        largest rate, and MuJoCo elsewhere.
    gravity : float
        Acceleration of gravity [m/s^2].
    platform_mass : float
        Mass of the platform [kg].
    platform_inertia : tuple of 3 float
        Principal inertias about its centre of mass, axes x, y, z [kg m^2].
    platform_com_height : float
        Its centre of mass above the plane of the mounts [m].
    isolation_frequency : tuple of 6 float
        Of the platform alone on its mounts: x, y, z, about x, about y, about z [Hz].
    isolation_damping : float
        Damping ratio of these six [-].
    bearing_height : float
        Centre of the bearing above the plane of the mounts [m].
    rotor_mass : float
        Mass of the rotor with its sensors [kg].
    rotor_inertia : tuple of 3 float
        Principal inertias about its centre of mass [kg m^2].
    rotor_com : tuple of 3 float
        Its centre of mass from the centre of the bearing [m]; x, y are the imbalance.
    mounting_height : float
        Nominal mounting point, on top of the rotor, above the centre of the bearing [m].
    radial_frequency, axial_frequency, tilt_frequency : float
        Of the rotor alone in its bearing [Hz].
    bearing_damping : float
        Damping ratio of these [-].
    spindle_drag : float
        Viscous drag of the spindle [N m s/rad].
    spindle_windage : float
        Quadratic drag b of the spindle [N m s^2/rad^2]: torque b rate |rate|.
    torque_limit : float
        Largest torque of the motor [N m].
    cogging : tuple of Cogging
        Harmonics of its cogging torque; empty for none.
    rate_bandwidth : float
        Corner of the servo's rate loop [Hz]: kv = I 2 pi f.
    position_bandwidth : float
        Corner of its position loop [Hz]: kp = kv 2 pi f.
    feedforward_inertia_error, feedforward_drag_error : float
        Relative error of the inertia and the drag (both kinds) that the feed-forward believes in [-].
    digital : Digital
        Encoder, controller and ripple of mode `digital`.
    floor : Floor
        Vibration of the floor below the mounts; modes `servo` and `digital`.
    wobble : tuple of Wobble
        Harmonics of the bearing's tilt error motion; empty for none; modes `servo` and `digital`.
    earth_rate : EarthRate or None
        Site and heading of the table: adds the Earth's rotation to the truth, in every mode.

    Raises
    ------
    pydantic.ValidationError
        If a value is not finite, not positive, if inertias violate the triangle inequality, or if floor or wobble are
        asked of a mode that has neither platform nor bearing.
    """

    mode: Literal["servo", "digital", "ideal", "fixed"] = "servo"
    step: Step = 5e-5
    engine: Literal["mujoco", "modal", "auto"] = "mujoco"
    gravity: Acceleration = 9.80665
    platform_mass: Mass = 400.0
    platform_inertia: Inertias = (24.0, 24.0, 45.0)
    platform_com_height: Position = 0.05
    isolation_frequency: SixFrequencies = (1.5, 1.5, 2.5, 2.0, 2.0, 1.8)
    isolation_damping: DampingRatio = 0.06
    bearing_height: Length = 0.25
    rotor_mass: Mass = 20.0
    rotor_inertia: Inertias = (0.07, 0.07, 0.05)
    rotor_com: Vector = (0.0, 0.0, 0.05)
    mounting_height: Length = 0.13
    radial_frequency: Frequency = 400.0
    axial_frequency: Frequency = 500.0
    tilt_frequency: Frequency = 300.0
    bearing_damping: DampingRatio = 0.03
    spindle_drag: AngularDrag = 5e-4
    spindle_windage: Windage = 0.0
    torque_limit: PositiveTorque = 6.0
    cogging: tuple[Cogging, ...] = (Cogging(torque=2e-3, periods=24, phase=0.3),)
    rate_bandwidth: Frequency = 150.0
    position_bandwidth: Frequency = 15.0
    feedforward_inertia_error: RelativeError = 0.0
    feedforward_drag_error: RelativeError = 0.0
    digital: Digital = Digital()
    floor: Floor = Floor()
    wobble: tuple[Wobble, ...] = ()
    earth_rate: EarthRate | None = None

    @field_validator("platform_inertia", "rotor_inertia")
    @classmethod
    def _obeys_triangle(cls, inertia: Inertias) -> Inertias:
        low, middle, high = sorted(inertia)
        if low + middle < high:
            msg = f"expected principal inertias of a body, none above the sum of the others, got {inertia} kg*m^2"
            raise ValueError(msg)
        return inertia

    @model_validator(mode="after")
    def _disturbs_a_plant(self) -> Self:
        if (self.floor.top_frequency() or self.wobble) and not self.has_plant:
            name = "wobble" if self.wobble else "floor"
            msg = f"{name}: expected mode 'servo' or 'digital', which have platform and bearing, got mode {self.mode!r}"
            raise ValueError(msg)
        return self

    @property
    def has_plant(self) -> bool:
        """Whether the mode has the full plant with platform, bearing and servo."""
        return self.mode in {"servo", "digital"}

    @property
    def spindle_inertia(self) -> float:
        """Inertia of the rotor about the spindle axis [kg m^2]: Izz + m (x^2 + y^2)."""
        x, y, _ = self.rotor_com
        return self.rotor_inertia[2] + self.rotor_mass * (x**2 + y**2)
