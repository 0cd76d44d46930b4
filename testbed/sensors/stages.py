"""What an instrument is in time, and what reaches it: the forms that a stage may have."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Protocol, runtime_checkable

if TYPE_CHECKING:
    from testbed.signals import FloatArray


class SensorStage(Protocol):
    """An instrument in time; state is kept, so any division into blocks gives the same bits."""

    def process(self, true_rate: FloatArray) -> FloatArray:
        """Return the readings [rad/s] that fall into a block of the rate that the axis feels [rad/s]."""


@dataclass(frozen=True)
class Surroundings:
    """What reaches an instrument over a block besides the rate about its axis; None: level, still, at its reference.

    Parameters
    ----------
    cross_rate : ndarray, shape (n_time, 2), optional
        True inertial rates about the housing's x and y axes, the sensing axis being z [rad/s].
    specific_force : ndarray, shape (n_time, 3), optional
        Acceleration minus gravity at the mounting, along the housing's axes [m/s^2].
    temperature : ndarray, shape (n_time,), optional
        Temperature of the instrument [K].
    """

    cross_rate: FloatArray | None = None
    specific_force: FloatArray | None = None
    temperature: FloatArray | None = None

    def part(self, start: int, stop: int) -> Surroundings:
        """Return the samples from `start` to before `stop`."""
        rows = slice(start, stop)
        return Surroundings(
            *(None if x is None else x[rows] for x in (self.cross_rate, self.specific_force, self.temperature))
        )


@runtime_checkable
class ExposedStage(SensorStage, Protocol):
    """An instrument whose readings depend on its surroundings too, such as the temperature."""

    def process_in(self, true_rate: FloatArray, surroundings: Surroundings) -> FloatArray:
        """Return the readings [rad/s] that fall into a block of the rate that the axis feels [rad/s]."""


@runtime_checkable
class SplitStage(SensorStage, Protocol):
    """An instrument whose noise comes behind all that the truth goes through: its readings of a block are
    ``finish(clean(true_rate, surroundings))``, and `clean` is the same for every seed where it is `separable`.
    """

    separable: bool

    def clean(self, true_rate: FloatArray, surroundings: Surroundings) -> FloatArray:
        """Return what it would read of a block without noise, word and losses [rad/s], at the clock of the readings."""

    def finish(self, clean: FloatArray) -> FloatArray:
        """Return the readings [rad/s] that become of what `clean` gave."""


@runtime_checkable
class ProfiledStage(SensorStage, Protocol):
    """An instrument with a fluid inside, whose velocity profile can be looked at."""

    heights: FloatArray

    def profile(self) -> FloatArray:
        """Return the slip at `heights` [m] as of the last sample that went in [rad/s], shape (n_height,)."""


@runtime_checkable
class ThermalStage(SensorStage, Protocol):
    """An instrument with a thermometer inside, whose bias follows the temperature; both are of the last block.

    `temperature` holds the thermometer's readings [K], one per reading of the rate; `drift` the true thermal bias
    [rad/s], one value per sample of the input, which no user of the instrument knows.
    """

    temperature: FloatArray
    drift: FloatArray
