"""The keys of a scenario that are no parts of their own."""

from __future__ import annotations

from typing import Annotated

from pydantic import Field

from testbed.models.temperature import ROOM, TemperatureProfile
from testbed.parts import Part
from testbed.units import Duration, Frequency, PositiveDuration

# What the signed 64 bits of run.nc hold.
MOST_SEED = 2**63 - 1
Seed = Annotated[int, Field(ge=0, le=MOST_SEED, strict=True)]


class Frame(Part):
    """The keys of a scenario that are no parts of their own.

    Parameters
    ----------
    name : str
        Names the run folder.
    description : str, optional
        What the experiment shows.
    seed : int, optional
        Seed of every random stream.
    truth_seed : int, optional
        Seed of what the table really does, random motions and floor, instead of `seed`: then `seed` varies the noise of
        the sensors alone.
    duration : float
        Length of the run [s].
    fusion_from : float, optional
        The filters see the readings from here on [s], a time at which every sensor has one; then they do not know that
        the table has been at rest, unless an entry says ``start: rest``.
    settle : float, optional
        Metrics start here [s]; with the filters if not given.
    ramp_in : float, optional
        Smooth ramp-in of the motion [s].
    temperature : TemperatureProfile, optional
        Of every instrument with temperature terms, such as ``25 degC``, or from `start` to `stop` over a time [K].
    bandwidth : float, optional
        Bandwidth W of the noise floor in the metrics [Hz].
    no_rate_below : float, optional
        The signal is known to have nothing below this [Hz]: then the metrics have a floor with that prior too.
    detail : tuple of two floats, optional
        From when to when the recording holds every sample [s]; two seconds after `settle` if not given, at least 1000
        samples.
    """

    name: Annotated[str, Field(pattern=r"^[A-Za-z0-9][A-Za-z0-9_.-]*$", max_length=100)]
    description: str = ""
    seed: Seed = 0
    truth_seed: Seed | None = None
    duration: PositiveDuration
    fusion_from: Duration = 0.0
    settle: Duration = Field(default_factory=lambda given: float(given.get("fusion_from", 0.0)))
    ramp_in: Duration = 0.5
    temperature: TemperatureProfile = ROOM
    bandwidth: Frequency = 1000.0
    no_rate_below: Frequency | None = None
    detail: tuple[Duration, Duration] | None = None
