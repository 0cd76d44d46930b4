"""An instrument of a plug-in under watch: tried before the run, and its readings checked in every block."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, NoReturn

import numpy as np

from testbed.errors import RunError, quoted
from testbed.inputs.plugins import PluginError, running

if TYPE_CHECKING:
    from collections.abc import Callable

    from testbed.sensors.base import Sensor
    from testbed.signals import FloatArray

    Sensed = tuple[FloatArray, Any]

_TRIED_HZ = np.logspace(-2.0, 3.0, 6)


def try_sensor(sensor: Sensor, input_rate_hz: float) -> None:
    """Ask an instrument of a plug-in for everything once.

    Parameters
    ----------
    sensor : Sensor
        The instrument.
    input_rate_hz : float
        Rate of the truth [Hz], a whole multiple of the readings'.

    Raises
    ------
    PluginError
        If it raises anything or gives something else than a `Sensor` does.
    """
    ratio = round(input_rate_hz / sensor.sample_rate)
    with running(f"sensor {type(sensor).__qualname__}"):
        _expect("full_scale", np.asarray(sensor.full_scale()), (), "f")
        _expect("response", np.asarray(sensor.response(_TRIED_HZ)), _TRIED_HZ.shape, "fc")
        _expect("input_noise_psd", np.asarray(sensor.input_noise_psd(_TRIED_HZ)), _TRIED_HZ.shape, "f")
        for quantity, value in sensor.datasheet():
            _expect("datasheet", np.asarray(f"{quantity}{value}"), (), "U")
        readings = sensor.start(input_rate_hz, 0, "tried").process(np.zeros(ratio + 1))
        _expect("process", np.asarray(readings), (2,), "f")


def _expect(what: str, value: Any, shape: tuple[int, ...], kinds: str) -> None:
    if value.shape != shape or value.dtype.kind not in kinds:
        msg = f"{what}: expected {'complex' if 'c' in kinds else 'real'} values of shape {shape}, got {quoted(value)}"
        raise TypeError(msg)


class CheckedSensor:
    """Runs the instrument of a plug-in over a block.

    Parameters
    ----------
    name : str
        Of the sensor, for messages.
    ratio : int
        Samples of the truth per reading.
    """

    def __init__(self, name: str, ratio: int) -> None:
        self._name, self._ratio, self._block, self._done = name, ratio, 0, 0

    def sense(self, feed: Callable[[FloatArray], Sensed], rate: FloatArray) -> Sensed:
        """Return what `feed` gives for a rate that it cannot change, its readings checked.

        Parameters
        ----------
        feed : callable
            From the rate of the block [rad/s] to the readings [rad/s] and a profile or None.
        rate : ndarray, shape (n_time,)
            What the axis feels [rad/s].

        Raises
        ------
        RunError
            If the plug-in raises anything, or gives not one real value per reading that is due.
        """
        self._block += 1
        view = rate.view()
        view.flags.writeable = False
        try:
            with running("raised"):
                readings, profile = feed(view)
        except PluginError as error:
            self._refuse(str(error), error)
        due = len(range(-self._done % self._ratio, rate.size, self._ratio))
        self._done += rate.size
        if np.shape(readings) != (due,) or np.asarray(readings).dtype.kind != "f":
            self._refuse(f"expected {due} real readings, got {quoted(readings)}")
        return np.array(readings, dtype=np.float64), profile

    def _refuse(self, what: str, cause: Exception | None = None) -> NoReturn:
        msg = f"sensor {self._name}, block {self._block} (from base step {self._done}): {what}"
        raise RunError(msg) from cause
