"""The `pointing` part of a scenario: what holds the line of sight, and what is asked of it."""

from __future__ import annotations

import math
import re
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Self

from pydantic import BeforeValidator, Field, ValidationInfo, model_validator

from testbed.inputs.files import beside_scenario
from testbed.parts import Part
from testbed.pointing.actuator import Dynamics, butterworth_mirror, measured_mirror
from testbed.pointing.blend import Margins, butterworth_gains, loop_margins
from testbed.units import DelayTime, Duration, Frequency, PositiveDuration, Quantity

if TYPE_CHECKING:
    from pydantic import GetJsonSchemaHandler
    from pydantic_core import core_schema

    from testbed.pointing.blend import Gains

PositiveAngle = Annotated[float, Quantity("rad", "20 urad", above=0.0)]
AngleDensity = Annotated[float, Quantity("rad*s^0.5", "5 nrad/sqrt(Hz)", at_least=0.0, cycle_is_number=True)]
AngleRate = Annotated[float, Quantity("rad/s", "1 rad/s", above=0.0)]
Switch = Annotated[bool, Field(json_schema_extra={"type": ["boolean", "string"], "enum": [True, False, "on", "off"]})]
Coefficients = Annotated[tuple[Annotated[float, Field(allow_inf_nan=False)], ...], Field(min_length=1, max_length=33)]

_DECIBEL = re.compile(r"\s*([-+]?(?:\d+\.?\d*|\.\d+))\s*dB\s*")


def _level(value: Any) -> Any:
    """Return a level such as "-3 dB" as a ratio of powers."""
    match = _DECIBEL.fullmatch(value) if isinstance(value, str) else None
    return 10.0 ** (float(match[1]) / 10.0) if match else value


Level = Annotated[
    float,
    BeforeValidator(_level),
    Field(gt=0.0, lt=1.0, json_schema_extra={"type": ["string", "number"], "examples": ["-3 dB"]}),
]


class Fade(Part):
    """A time in which the tracker has no light.

    Parameters
    ----------
    at, length : float
        When it begins, and how long it lasts [s].
    """

    at: Duration
    length: PositiveDuration


class Tracker(Part):
    """The optical tracker that keeps the integrated rate from drifting away.

    Parameters
    ----------
    bandwidth : float
        Without noise the sensitivity is the second-order Butterworth high-pass of this corner; with noise no blend
        trusts the tracker above it [Hz].
    noise : float
        Noise-equivalent angle, two-sided root density [rad/sqrt(Hz)]; it makes the blend the optimal one.
    rate : float, optional
        Rate of its readings, which are held: counts for the margins of the loop [Hz].
    latency : float
        Of a reading: counts for the margins of the loop [s].
    fades : tuple of Fade
        When it has no light.
    """

    bandwidth: Frequency = 10.0
    noise: AngleDensity = 0.0
    rate: Frequency | None = None
    latency: DelayTime = 0.0
    fades: tuple[Fade, ...] = ()


class Mirror(Part):
    """The fast steering mirror and the way of a command to it.

    Parameters
    ----------
    bandwidth : float
        Corner of a second-order Butterworth low-pass, unless the dynamics are given otherwise [Hz].
    response : Path, optional
        File of a measured response: frequency [Hz], gain, phase [deg], met by a rational function; relative to the
        scenario.
    numerator, denominator : tuple of float, optional
        The dynamics in s [rad/s], highest power first: what a run keeps of a measured response.
    rate : float, optional
        Rate of the commands, which are held; a whole part of the base clock [Hz]. Without it the command is linear
        between the samples of the base clock.
    latency : float
        From the last reading to the command [s].
    lead : bool
        Add to the commanded angle the rate times the group delay of the mirror, half a hold and `assumed_latency`.
    assumed_latency : float, optional
        What `lead` takes for the latency; the true one if not given [s].
    stroke : float, optional
        The deflection is at most plus and minus this [rad].
    rate_limit : float, optional
        And its rate this [rad/s].
    """

    bandwidth: Frequency = 1000.0
    response: Path | None = None
    numerator: Coefficients | None = None
    denominator: Coefficients | None = None
    rate: Frequency | None = None
    latency: DelayTime = 0.0
    lead: Switch = False
    assumed_latency: DelayTime | None = None
    stroke: PositiveAngle | None = None
    rate_limit: AngleRate | None = None

    @model_validator(mode="before")
    @classmethod
    def _measured(cls, data: Any, info: ValidationInfo) -> Any:
        """Put the function that meets a measured response in its place: a run needs no file beside it."""
        if not isinstance(data, dict) or data.get("response") is None:
            return data
        if {"numerator", "denominator", "bandwidth"} & data.keys():
            msg = "expected one of response, bandwidth, numerator with denominator"
            raise ValueError(msg)
        found = measured_mirror(beside_scenario(Path(str(data["response"])), info.context or {}))
        given = {key: value for key, value in data.items() if key != "response"}
        return {**given, "numerator": found.numerator, "denominator": found.denominator}

    @model_validator(mode="after")
    def _one_kind(self) -> Self:
        if (self.numerator is None) != (self.denominator is None):
            msg = "expected numerator and denominator, or neither"
            raise ValueError(msg)
        if self.denominator is not None and self.numerator is not None:
            import numpy as np

            ends = self.denominator[0], self.denominator[-1], self.numerator[-1]
            if not all(ends) or len(self.numerator) >= len(self.denominator):
                msg = "numerator: expected a lower degree than the denominator's, and a gain at zero frequency"
                raise ValueError(msg)
            if np.any(np.roots(self.denominator).real >= 0.0):
                msg = "denominator: expected roots with negative real parts, got an unstable mirror"
                raise ValueError(msg)
        if self.assumed_latency is not None and not self.lead:
            msg = "assumed_latency: only lead takes it; add 'lead: on', or leave it out"
            raise ValueError(msg)
        return self

    @property
    def dynamics(self) -> Dynamics:
        """Deflection over command, without latency and hold."""
        if self.numerator is not None and self.denominator is not None:
            return Dynamics(self.numerator, self.denominator)
        return butterworth_mirror(self.bandwidth)

    @property
    def own_delay(self) -> float:
        """Group delay of the mirror, and half a hold [s]."""
        return self.dynamics.group_delay + (0.0 if self.rate is None else 0.5 / self.rate)

    @property
    def lead_times(self) -> tuple[float, float]:
        """What the lead gains for the mirror, and for the latency [s]; zeros without lead."""
        if not self.lead:
            return 0.0, 0.0
        return self.own_delay, self.latency if self.assumed_latency is None else self.assumed_latency


class Window(Part):
    """A window of time over which the error is judged.

    Parameters
    ----------
    length : float
        T [s].
    separation : float, optional
        Ts, from the start of one window to that of the next, for drift and reproducibility; at least T [s].
    """

    length: PositiveDuration
    separation: PositiveDuration | None = None

    @classmethod
    def __get_pydantic_json_schema__(
        cls, schema: core_schema.CoreSchema, handler: GetJsonSchemaHandler
    ) -> dict[str, Any]:
        return {"anyOf": [{"type": "string", "description": "length", "examples": ["100 ms"]}, handler(schema)]}

    @model_validator(mode="before")
    @classmethod
    def _short(cls, data: Any) -> Any:
        return {"length": data} if isinstance(data, str | float) else data

    @model_validator(mode="after")
    def _apart(self) -> Self:
        if self.separation is not None and self.separation < self.length:
            msg = f"separation: expected at least the length {self.length:g} s, got {self.separation:g} s"
            raise ValueError(msg)
        return self

    @property
    def key(self) -> str:
        """Its name in metrics.json: the length in seconds, shortest decimal."""
        return window_key(self.length)


class Link(Part):
    """The optical link that the line of sight carries.

    Parameters
    ----------
    divergence : float
        w, half angle of the beam at 1/e^2 of its intensity [rad].
    outage_below : float
        Power over that of a beam that does not move, below which the link is out, such as "-3 dB" [-].
    """

    divergence: PositiveAngle
    outage_below: Level = 10.0**-0.3


class PointingParameters(Part):
    """From rate to pointing: a mirror that a fused rate feeds forward, behind an optical tracker.

    Parameters
    ----------
    feed_forward : tuple of str, optional
        The filters that do so, each by itself; all if not given.
    tracker, mirror : Tracker, Mirror
        What holds the line of sight.
    windows : tuple of Window
        Over which the error is judged.
    link : Link, optional
        What it is for.
    """

    feed_forward: Annotated[tuple[str, ...], Field(min_length=1)] | None = None
    tracker: Tracker = Tracker()
    mirror: Mirror = Mirror()
    windows: Annotated[tuple[Window, ...], Field(max_length=16)] = ()
    link: Link | None = None

    def margins(self, gains: Gains | None = None) -> Margins:
        """Return the margins of the tracker's loop.

        Parameters
        ----------
        gains : Gains, optional
            Of the blend; those of a tracker without noise if not given, the largest that a blend may have.
        """
        tracker, mirror = self.tracker, self.mirror
        delay = tracker.latency + mirror.latency
        delay += sum(0.5 / rate for rate in (tracker.rate, mirror.rate) if rate is not None)
        return loop_margins(gains or butterworth_gains(tracker.bandwidth), mirror.dynamics.response, delay)


def window_key(length: float) -> str:
    """Return the shortest decimal of a length [s], as keys of metrics.json have it."""
    text = f"{length:.12f}".rstrip("0").rstrip(".")
    return text if float(text or "0") > 0.0 and math.isclose(float(text), length, rel_tol=1e-9) else repr(length)
