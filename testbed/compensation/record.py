"""What a compensator is trained on and applied to: rate and thermometer on one clock."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from numpy.typing import ArrayLike

    from testbed.signals import FloatArray

_SHORTEST = 16


def checked(name: str, values: ArrayLike) -> FloatArray:
    """Return `values` as a vector of finite floats.

    Parameters
    ----------
    name : str
        For the message.
    values : array_like, shape (n_time,)
        Samples, any unit.

    Returns
    -------
    ndarray, shape (n_time,)
        The same values.

    Raises
    ------
    ValueError
        If it is no vector or a sample is NaN or infinite; names the first one.
    """
    vector: FloatArray = np.asarray(values, dtype=np.float64)
    if vector.ndim != 1:
        msg = f"{name}: expected a vector, got shape {vector.shape}"
        raise ValueError(msg)
    finite = np.isfinite(vector)
    if not finite.all():
        first = int(np.argmin(finite))
        msg = f"{name}: expected finite samples, got {vector[first]} at sample {first}"
        raise ValueError(msg)
    return vector


def checked_rate(sample_rate_hz: float) -> float:
    """Return the sample rate [Hz]; ValueError unless it is positive and finite."""
    if not (sample_rate_hz > 0.0 and math.isfinite(sample_rate_hz)):
        msg = f"sample_rate_hz: expected a positive number, got {sample_rate_hz}"
        raise ValueError(msg)
    return float(sample_rate_hz)


@dataclass(frozen=True)
class GyroRecord:
    """A thermal record of a gyro, such as one cycle in a chamber.

    Parameters
    ----------
    rate : ndarray, shape (n_time,)
        Gyro readings [rad/s].
    temperature : ndarray, shape (n_time,)
        Thermometer readings at the same instants [K].
    sample_rate_hz : float
        Their rate [Hz].

    Raises
    ------
    ValueError
        If the vectors differ in length, have fewer than 16 samples or one that is not finite, or a temperature is not
        above 0 K.
    """

    rate: FloatArray
    temperature: FloatArray
    sample_rate_hz: float

    def __post_init__(self) -> None:
        for name in ("rate", "temperature"):
            object.__setattr__(self, name, checked(name, getattr(self, name)))
        checked_rate(self.sample_rate_hz)
        if self.rate.size != self.temperature.size or self.rate.size < _SHORTEST:
            msg = (
                f"record: expected rate and temperature of one length, at least {_SHORTEST} samples, "
                f"got {self.rate.size} and {self.temperature.size}"
            )
            raise ValueError(msg)
        if self.temperature.min() <= 0.0:
            msg = f"temperature: expected kelvin, above 0, got {self.temperature.min()}"
            raise ValueError(msg)

    @property
    def duration(self) -> float:
        """Length of the record [s]."""
        return self.rate.size / self.sample_rate_hz
