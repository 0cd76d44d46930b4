"""Vibration of the floor below the isolators: lines and bands of given spectral density, per axis."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING, Annotated, Literal, get_args

import numpy as np
from pydantic import model_validator

from testbed.models.motion import ramp
from testbed.models.turntable.realisation import grid, periodic_spline
from testbed.parts import Part
from testbed.units import Angle, AngularAcceleration, Duration, Frequency, Position, Quantity

if TYPE_CHECKING:
    from typing import Self

    from testbed.signals import FloatArray

Axis = Literal["x", "y", "z", "rx", "ry", "rz"]
AXES: tuple[Axis, ...] = get_args(Axis)
Stream = Callable[..., np.random.Generator]

LinearAcceleration = Annotated[float, Quantity("m/s^2", "1 mm/s^2")]
AccelerationPsd = Annotated[float, Quantity("m^2/s^3", "1e-8 (m/s^2)^2/Hz", at_least=0.0, cycle_is_number=True)]
AngularPsd = Annotated[float, Quantity("rad^2/s^3", "1e-8 (rad/s^2)^2/Hz", at_least=0.0, cycle_is_number=True)]


class FloorLine(Part):
    r"""One sine of the floor; the quantity that is given follows sin(2 pi f t + phase).

    Parameters
    ----------
    axis : {"x", "y", "z", "rx", "ry", "rz"}
        Along or (r) about that axis.
    frequency : float
        Frequency f [Hz].
    displacement, acceleration : float, optional
        Amplitude along x, y or z [m], [m/s^2]; exactly one of the two for such an axis.
    angle, angular_acceleration : float, optional
        Amplitude about x, y or z [rad], [rad/s^2]; exactly one of the two for such an axis.
    phase : float, optional
        Phase at t = 0 [rad].

    Raises
    ------
    ValueError
        If none, several, or an amplitude of the wrong kind is given.
    """

    axis: Axis
    frequency: Frequency
    displacement: Position | None = None
    acceleration: LinearAcceleration | None = None
    angle: Angle | None = None
    angular_acceleration: AngularAcceleration | None = None
    phase: Angle = 0.0

    @model_validator(mode="after")
    def _one_amplitude(self) -> Self:
        _expect_one(self, ("angle", "angular_acceleration") if "r" in self.axis else ("displacement", "acceleration"))
        return self

    @property
    def amplitude(self) -> float:
        """Signed amplitude of the displacement [m] or angle [rad] on sin(2 pi f t + phase)."""
        given = self.displacement if self.displacement is not None else self.angle
        if given is not None:
            return given
        return -(self.acceleration or self.angular_acceleration or 0.0) / (2 * np.pi * self.frequency) ** 2


class FloorBand(Part):
    """Gaussian vibration of the floor with a constant two-sided density of its acceleration for low <= |f| <= high.

    Parameters
    ----------
    axis : {"x", "y", "z", "rx", "ry", "rz"}
        Along or (r) about that axis.
    low, high : float
        Edges of the band [Hz].
    acceleration_psd : float, optional
        Two-sided density along x, y or z [m^2/s^3 = (m/s^2)^2/Hz].
    angular_acceleration_psd : float, optional
        Two-sided density about x, y or z [rad^2/s^3 = (rad/s^2)^2/Hz].

    Raises
    ------
    ValueError
        If `high` is not above `low`, or the density is not that of the axis.
    """

    axis: Axis
    low: Frequency
    high: Frequency
    acceleration_psd: AccelerationPsd | None = None
    angular_acceleration_psd: AngularPsd | None = None

    @model_validator(mode="after")
    def _consistent(self) -> Self:
        if self.high <= self.low:
            msg = f"expected high above low, got {self.low} Hz ... {self.high} Hz"
            raise ValueError(msg)
        _expect_one(self, ("angular_acceleration_psd",) if "r" in self.axis else ("acceleration_psd",))
        return self

    @property
    def psd(self) -> float:
        """Two-sided density of the acceleration [m^2/s^3] or [rad^2/s^3]."""
        return self.acceleration_psd or self.angular_acceleration_psd or 0.0


class Floor(Part):
    """The floor's vibration: the sum of its lines and bands, which the mounts of the platform pass on.

    Parameters
    ----------
    lines : tuple of FloorLine
        Sines; empty for none.
    bands : tuple of FloorBand
        Gaussian bands; empty for none.
    ramp_in : float
        Length of the smooth onset [s], so that the platform is not kicked.
    """

    lines: tuple[FloorLine, ...] = ()
    bands: tuple[FloorBand, ...] = ()
    ramp_in: Duration = 0.5

    def top_frequency(self) -> float:
        """Return the highest frequency [Hz] that it contains; 0 for a still floor."""
        return max((*(line.frequency for line in self.lines), *(band.high for band in self.bands)), default=0.0)

    def start(self, duration: float, stream: Stream) -> FloorMotion:
        """Return the floor in time.

        Parameters
        ----------
        duration : float
            Length of the run [s].
        stream : callable
            Names to numpy.random.Generator: band i of an axis draws from stream(axis, str(i)), so that another axis
            or line leaves it as it was.
        """
        return FloorMotion(self, duration, stream)


class FloorMotion:
    """One realisation of the floor: a pure function of time, so that any division into blocks gives the same bits.

    Parameters
    ----------
    floor : Floor
        Its lines and bands.
    duration : float
        Length of the run [s].
    stream : callable
        Names to numpy.random.Generator.
    """

    def __init__(self, floor: Floor, duration: float, stream: Stream) -> None:
        self._ramp_in = floor.ramp_in
        self._terms: dict[Axis, list[Callable[[FloatArray, int], FloatArray]]] = {}
        for line in floor.lines:
            self._terms.setdefault(line.axis, []).append(_sine(line))
        for axis in AXES:
            for i, band in enumerate(band for band in floor.bands if band.axis == axis):
                self._terms.setdefault(axis, []).append(_noise(band, duration, stream(axis, str(i))))

    def inputs(self, t: FloatArray) -> dict[Axis, tuple[FloatArray, FloatArray]]:
        """Return displacement [m] or angle [rad] and its rate [1/s of it] of every axis that moves.

        Parameters
        ----------
        t : ndarray, shape (n_time,)
            Time [s].

        Returns
        -------
        dict of str to tuple of ndarray, shapes (n_time,), (n_time,)
            By axis.
        """
        factor = ramp(t, self._ramp_in)
        x = np.clip(t / self._ramp_in, 0.0, 1.0) if self._ramp_in else np.ones_like(t)
        slope = 30.0 * x**2 * (1.0 - x) ** 2 / (self._ramp_in or 1.0)
        moved = {}
        for axis, terms in self._terms.items():
            place, speed = (sum((term(t, order) for term in terms), np.zeros_like(t)) for order in (0, 1))
            moved[axis] = factor * place, factor * speed + slope * place
        return moved


def _expect_one(part: FloorLine | FloorBand, wanted: tuple[str, ...]) -> None:
    amplitudes = ("displacement", "acceleration", "angle", "angular_acceleration")
    densities = ("acceleration_psd", "angular_acceleration_psd")
    given = [name for name in (*amplitudes, *densities) if getattr(part, name, None) is not None]
    if len(given) != 1 or given[0] not in wanted:
        got = " and ".join(given) or "none"
        msg = f"expected {' or '.join(wanted)} for axis {part.axis}, got {got}"
        raise ValueError(msg)


def _sine(line: FloorLine) -> Callable[[FloatArray, int], FloatArray]:
    corner, amplitude = 2 * np.pi * line.frequency, line.amplitude

    def term(t: FloatArray, order: int) -> FloatArray:
        value: FloatArray = amplitude * corner**order * np.sin(corner * t + (line.phase + order * np.pi / 2))
        return value

    return term


def _noise(band: FloorBand, duration: float, rng: np.random.Generator) -> Callable[[FloatArray, int], FloatArray]:
    """Return a periodic realisation, longer than the run, as a quintic spline over 16 points per period of `high`."""
    period, n = grid((band.low, band.high), duration)
    k = np.arange(int(np.ceil(band.low * period)), int(np.floor(band.high * period)) + 1)
    # One line carries the two-sided power 2 S / P of the acceleration, 1 / (2 pi f)^4 of it in displacement.
    size = 0.5 * n * np.sqrt(2.0 * band.psd / period) / (2 * np.pi * k / period) ** 2
    lines = np.zeros(n // 2 + 1, dtype=complex)
    lines[k] = size * (rng.standard_normal(k.size) - 1j * rng.standard_normal(k.size))
    spline = periodic_spline(lines, n, period)
    derivatives = (spline, spline.derivative())

    def term(t: FloatArray, order: int) -> FloatArray:
        value: FloatArray = derivatives[order](t)
        return value

    return term
