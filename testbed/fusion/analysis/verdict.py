"""What stands against a record before anything is estimated from it."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from testbed.fusion.analysis.finding import Verdict
from testbed.fusion.belief import check_belief

if TYPE_CHECKING:
    from collections.abc import Mapping

    from numpy.typing import ArrayLike, NDArray

    from testbed.fusion.belief import SensorBelief


def verdict(
    readings: Mapping[str, ArrayLike], time_ns: Mapping[str, NDArray[np.int64]], belief: Mapping[str, SensorBelief]
) -> Verdict:
    """Return what the readings contradict: each other, and what is believed of the sensors.

    Parameters
    ----------
    readings : mapping of str to array_like, shape (n_sensor_samples,)
        Readings of each sensor [rad/s]; not finite means no reading.
    time_ns : mapping of str to ndarray of int64, shape (n_sensor_samples,)
        Their stamps on whatever clocks [ns], in order.
    belief : mapping of str to SensorBelief
        Dynamics and noise of each sensor.

    Returns
    -------
    Verdict
        Findings, and what this record cannot decide.

    Raises
    ------
    ValueError
        If a sensor has no belief, or not as many stamps as readings.
    """
    check_belief(belief, readings)
    for name, values in readings.items():
        if name not in time_ns or np.shape(values) != np.shape(time_ns[name]):
            got = np.shape(time_ns[name]) if name in time_ns else "none"
            msg = f"time_ns: expected the stamps of the {np.size(values)} readings of {name!r}, got {got}"
            raise ValueError(msg)
    return Verdict()
