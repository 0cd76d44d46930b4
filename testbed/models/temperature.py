"""The temperature of a run: constant or a ramp."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
from pydantic import model_serializer, model_validator

from testbed.parts import Part
from testbed.units import PositiveDuration, Temperature

if TYPE_CHECKING:
    from pydantic import GetJsonSchemaHandler, SerializerFunctionWrapHandler
    from pydantic_core import CoreSchema

    from testbed.signals import FloatArray


class TemperatureProfile(Part):
    """Temperature that all instruments share: ``25 degC``, or a straight line from `start` to `stop`, held from then on.

    Parameters
    ----------
    start, stop : float
        At t = 0 and from t = `over` on [K].
    over : float
        Time that the change takes [s].
    """

    start: Temperature
    stop: Temperature
    over: PositiveDuration

    @model_validator(mode="before")
    @classmethod
    def _constant(cls, value: Any) -> Any:
        return value if isinstance(value, dict | cls) else {"start": value, "stop": value, "over": "1 s"}

    @model_serializer(mode="wrap")
    def _write(self, handler: SerializerFunctionWrapHandler) -> Any:
        values = handler(self)
        return values["start"] if self.start == self.stop else values

    @classmethod
    def __get_pydantic_json_schema__(cls, core: CoreSchema, handler: GetJsonSchemaHandler) -> dict[str, Any]:
        constant = {"type": "string", "description": "quantity in K", "examples": ["25 degC"]}
        return {"anyOf": [constant, handler(core)]}

    def at(self, start: int, n_time: int, sample_rate_hz: float) -> FloatArray:
        """Return the temperature at t = k / fs, k = start ... start + n_time - 1.

        Parameters
        ----------
        start, n_time : int
            First sample and number of samples.
        sample_rate_hz : float
            Their rate [Hz].

        Returns
        -------
        ndarray, shape (n_time,)
            Temperature [K].
        """
        share = np.minimum(np.arange(start, start + n_time) / (sample_rate_hz * self.over), 1.0)
        temperature: FloatArray = self.start + (self.stop - self.start) * share
        return temperature


ROOM = TemperatureProfile(start=298.15, stop=298.15, over=1.0)
