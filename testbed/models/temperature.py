"""The temperature of a run: constant, a ramp, or the holds and ramps of a thermal chamber."""

from __future__ import annotations

from typing import TYPE_CHECKING, Annotated, Any

import numpy as np
from pydantic import model_serializer, model_validator

from testbed.parts import Part
from testbed.units import PositiveDuration, Quantity, Temperature

if TYPE_CHECKING:
    from collections.abc import Iterator
    from typing import Self

    from pydantic import GetJsonSchemaHandler, SerializerFunctionWrapHandler
    from pydantic_core import CoreSchema

    from testbed.signals import FloatArray

RampRate = Annotated[float, Quantity("K/s", "0.1 K/min", above=0.0)]


class ChamberStep(Part):
    """One step of a thermal chamber: ``{hold: 2 h}``, ``{ramp: 60 degC, rate: 0.1 K/min}`` or ``{ramp: 60 degC, over: 1
    h}``.

    Parameters
    ----------
    hold : float, optional
        The temperature stays for this long [s].
    ramp : float, optional
        It changes in a straight line to this [K].
    rate : float, optional
        At this speed, up or down [K/s].
    over : float, optional
        Or in this time [s].
    """

    hold: PositiveDuration | None = None
    ramp: Temperature | None = None
    rate: RampRate | None = None
    over: PositiveDuration | None = None

    @model_validator(mode="after")
    def _one_step(self) -> Self:
        given = tuple(name for name in ("hold", "ramp", "rate", "over") if getattr(self, name) is not None)
        if given not in {("hold",), ("ramp", "rate"), ("ramp", "over")}:
            msg = f"expected hold, or ramp with either rate or over, got {' and '.join(given) or 'nothing'}"
            raise ValueError(msg)
        return self

    @model_serializer(mode="wrap")
    def _write(self, handler: SerializerFunctionWrapHandler) -> dict[str, Any]:
        return _given(handler(self))

    def follow(self, start: float) -> tuple[float, float]:
        """Return temperature at the end [K] and length [s] of the step from the temperature `start` [K]."""
        if self.ramp is None:
            return start, self.hold or 0.0
        return self.ramp, self.over or abs(self.ramp - start) / (self.rate or 1.0)


class TemperatureProfile(Part):
    """Temperature around all instruments, one of three.

    ``25 degC``: constant; ``{start, stop, over}``: a straight line; ``{start, steps: [{hold: 2 h}, {ramp: 60 degC,
    rate: 0.1 K/min}]}``: the programme of a thermal chamber. The last temperature is held.

    Parameters
    ----------
    start : float
        At t = 0 [K].
    stop : float, optional
        From t = `over` on [K].
    over : float, optional
        Time that the change takes [s].
    steps : tuple of ChamberStep, optional
        Holds and ramps, one after the other.
    """

    start: Temperature
    stop: Temperature | None = None
    over: PositiveDuration | None = None
    steps: tuple[ChamberStep, ...] = ()

    @model_validator(mode="before")
    @classmethod
    def _constant(cls, value: Any) -> Any:
        return value if isinstance(value, dict | cls) else {"start": value, "stop": value, "over": "1 s"}

    @model_validator(mode="after")
    def _line_or_steps(self) -> Self:
        given = tuple(name for name in ("stop", "over", "steps") if getattr(self, name) not in (None, ()))
        if given not in {("stop", "over"), ("steps",)}:
            msg = f"expected start with either stop and over or steps, got start{''.join(f' and {g}' for g in given)}"
            raise ValueError(msg)
        return self

    @model_serializer(mode="wrap")
    def _write(self, handler: SerializerFunctionWrapHandler) -> Any:
        values = _given(handler(self))
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
        index = np.arange(start, start + n_time)
        temperature: FloatArray = np.full(n_time, self.start)
        for begin, length, change in self._ramps():
            temperature += change * np.clip((index - sample_rate_hz * begin) / (sample_rate_hz * length), 0.0, 1.0)
        return temperature

    def _ramps(self) -> Iterator[tuple[float, float, float]]:
        """Yield begin [s], length [s] and change [K] of every ramp."""
        steps = self.steps or (ChamberStep(ramp=self.stop, over=self.over),)
        now, temperature = 0.0, self.start
        for step in steps:
            target, length = step.follow(temperature)
            if target != temperature:
                yield now, length, target - temperature
            now, temperature = now + length, target


def _given(values: dict[str, Any]) -> dict[str, Any]:
    return {key: value for key, value in values.items() if value not in (None, (), [])}


ROOM = TemperatureProfile(start=298.15, stop=298.15, over=1.0)
