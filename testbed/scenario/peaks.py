"""What the commanded motion asks of table and sensors at its hardest, found in bounded time however long the run is."""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import lru_cache
from typing import TYPE_CHECKING

import numpy as np

from testbed.errors import ScenarioError
from testbed.models.motions import MOTIONS
from testbed.models.turntable.servo import required_torque
from testbed.signals import BLOCK

if TYPE_CHECKING:
    from collections.abc import Iterator

    from testbed.models.motion import Motion
    from testbed.models.turntable.parameters import TurntableParameters
    from testbed.scenario.model import Scenario

# Terms that are worked out, each a sine over a base step or as dear as one: about a second.
_MOST_WORK = 24_000_000
# What a base step costs besides its terms.
_STEP = 3
_LEAST_WINDOW = 256


@dataclass(frozen=True)
class Peaks:
    """The hardest moments of a commanded motion.

    Parameters
    ----------
    rate : float
        Largest commanded rate [rad/s].
    torque : float
        Largest torque that it asks of the motor [N m].
    places : tuple of 3 int
        Base steps of the largest rate, torque and third derivative of the rate.
    stroke : float
        Half of the angle between the extreme positions, in windows that do not follow one another of the widest [rad].
    """

    rate: float
    torque: float
    places: tuple[int, int, int]
    stroke: float


def command_peaks(scenario: Scenario) -> Peaks:
    """Play the commanded motion without a plant, whole or in windows, and return its peaks.

    A scenario that asks the same is not played again, unless what it plays may have changed: a file, or a plug-in.

    Parameters
    ----------
    scenario : Scenario
        Whose motion.

    Raises
    ------
    ScenarioError
        If a recorded motion cannot be read, or noise takes too many points.
    RunError
        If the motion of a plug-in fails.
    """
    asked = _Asked(
        (scenario.base_rate_hz, scenario.frame.duration, scenario.frame.ramp_in),
        scenario.truth_seed if any(motion.draws for _, motion in scenario.motion) else None,
        scenario.motion,
        scenario.turntable,
        scenario,
    )
    lasting = all(kind in MOTIONS and motion.lasting for kind, motion in scenario.motion)
    return _kept(asked) if lasting else _peaks(scenario)


@dataclass(frozen=True)
class _Asked:
    """All that the peaks of a scenario depend on, and the scenario."""

    times: tuple[float, ...]
    truth_seed: int | None
    motion: tuple[tuple[str, Motion], ...]
    turntable: TurntableParameters
    scenario: Scenario = field(compare=False, repr=False)


@lru_cache(maxsize=64)
def _kept(asked: _Asked) -> Peaks:
    return _peaks(asked.scenario)


def _peaks(scenario: Scenario) -> Peaks:
    motion, peaks, places = scenario.profile(), [0.0, -1.0, -1.0], [0, 0, 0]
    stroke, end, angle, extremes = 0.0, 0, 0.0, (0.0, 0.0)
    for start, n_time in windows(scenario.n_time, _cost(scenario)):
        command = motion.peek(n_time, start)
        if not (np.isfinite(command.rate).all() and np.isfinite(command.rate_mid).all()):
            msg = f"expected a finite rate, got one that is not, from t = {start / scenario.base_rate_hz:g} s on"
            raise ScenarioError(msg)
        if start != end:
            angle, extremes = 0.0, (0.0, 0.0)
        extremes = min(extremes[0], angle + command.angle.min()), max(extremes[1], angle + command.angle.max())
        end, angle = start + n_time, angle + command.angle[-1]
        stroke = max(stroke, 0.5 * float(extremes[1] - extremes[0]))
        torque = required_torque(scenario.turntable, command, scenario.base_rate_hz)
        for i, measure in enumerate((np.abs(command.rate), torque, np.abs(np.diff(command.rate, n=3)))):
            if measure.size and float(np.max(measure)) > peaks[i]:
                peaks[i], places[i] = float(np.max(measure)), start + int(np.argmax(measure))
    return Peaks(peaks[0], max(peaks[1], 0.0), (places[0], places[1], places[2]), stroke)


def played(scenario: Scenario) -> int:
    """Return how many base steps of a run `command_peaks` looks at.

    Parameters
    ----------
    scenario : Scenario
        Whose motion.
    """
    return sum(n_time for _, n_time in windows(scenario.n_time, _cost(scenario)))


def _cost(scenario: Scenario) -> int:
    return _STEP + sum(part.n_term() for _, part in scenario.motion)


def windows(n_time: int, cost: int) -> Iterator[tuple[int, int]]:
    """Yield start and length of the windows in which a run is played [base steps], from its first to its last step.

    Parameters
    ----------
    n_time : int
        Length of the run [base steps].
    cost : int
        Work per base step; if that of the run is within the cap, the windows follow one another.
    """
    most = max(_MOST_WORK // cost, _LEAST_WINDOW)
    if n_time <= most:
        yield from ((start, min(BLOCK, n_time - start)) for start in range(0, n_time, BLOCK))
        return
    length = min(max(most // 64, _LEAST_WINDOW), BLOCK)
    number = max(most // length, 2)
    yield from (((n_time - length) * i // (number - 1), length) for i in range(number))
