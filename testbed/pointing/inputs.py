"""What goes into a filter beside the truth: the noise of each sensor, and what its belief does not know of it."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from testbed.signals import LinearFilter

if TYPE_CHECKING:
    from collections.abc import Mapping

    from testbed.fusion.belief import SensorBelief
    from testbed.signals import FloatArray

# Prefixes of the inputs' names; behind them the sensor.
TRUTH, NOISE, UNKNOWN = "truth", "noise:", "unknown:"


class BelievedSensor:
    """The noise-free readings that a belief makes of a rate, at the sensor's clock.

    Parameters
    ----------
    belief : SensorBelief
        Dynamics, delay and bias.
    base_rate_hz : float
        Base clock [Hz].
    ratio : int
        Base samples from one reading to the next.
    """

    def __init__(self, belief: SensorBelief, base_rate_hz: float, ratio: int) -> None:
        self._response = LinearFilter(*belief.polynomials(), base_rate_hz)
        self._bias, self._ratio, self._done = belief.bias, ratio, 0

    def process(self, rate: FloatArray) -> FloatArray:
        """Return the readings that fall due in a block of the rate [rad/s], shape (n_reading,)."""
        if not self._done and rate.size:
            self._response.settle(float(rate[0]))
        readings: FloatArray = self._response.process(rate)[-self._done % self._ratio :: self._ratio]
        self._done += rate.size
        return readings + self._bias


def input_parts(
    readings: Mapping[str, FloatArray], clean: Mapping[str, FloatArray], believed: Mapping[str, FloatArray]
) -> dict[str, FloatArray]:
    """Return the parts of the readings that the truth, as a filter believes it to be read, does not have [rad/s].

    Parameters
    ----------
    readings : mapping of str to ndarray, shape (n_reading,)
        Of each sensor [rad/s]; a lost one has no noise.
    clean : mapping of str to ndarray, shape (n_reading,)
        Without noise, of the sensors of which that is known; of the others it is what is believed.
    believed : mapping of str to ndarray, shape (n_reading,)
        By the belief.

    Returns
    -------
    dict of str to ndarray, shape (n_reading,)
        ``noise:<sensor>`` and ``unknown:<sensor>``.
    """
    known = {**believed, **clean}
    noise = {f"{NOISE}{name}": np.nan_to_num(values - known[name]) for name, values in readings.items()}
    return noise | {f"{UNKNOWN}{name}": known[name] - believed[name] for name in readings}
