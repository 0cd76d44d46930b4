"""What a recording shows of a rate: a number in the unit of the run, not in SI."""

from __future__ import annotations

from typing import TYPE_CHECKING

from testbed.units import PER_RATE

if TYPE_CHECKING:
    from testbed.signals import FloatArray
    from testbed.units import RateUnit


class ShownRate:
    """The unit in which every rate of a recording is shown.

    Parameters
    ----------
    unit : {"deg/s", "deg/h"}
        As `testbed.units.rate_unit` decides it.
    """

    def __init__(self, unit: RateUnit) -> None:
        self.unit = unit
        self._factors = {"rad/s": PER_RATE[unit], "rad^2/s^2": PER_RATE[unit] ** 2}

    def of(self, values: FloatArray, si: str = "rad/s") -> FloatArray:
        """Return values as they are shown: those of a rate or its variance in the unit, all others as they are.

        Parameters
        ----------
        values : ndarray, shape (n_time, ...)
            What run.nc holds.
        si : str, optional
            Their unit there.
        """
        factor = self._factors.get(si)
        return values if factor is None else factor * values
