"""The integration step of a run: as given, or as large as the truth allows."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from testbed.errors import RunError, ScenarioError
from testbed.models.motion import MotionProfile
from testbed.models.turntable.modal import check_modal
from testbed.models.turntable.turntable import Turntable
from testbed.scenario.peaks import command_peaks
from testbed.signals import BASE_RATE_HZ

if TYPE_CHECKING:
    from testbed.models.turntable.parameters import TurntableParameters
    from testbed.models.turntable.truth import TruthBlock
    from testbed.scenario.model import Scenario
    from testbed.signals import FloatArray

TRUTH_ERROR = 1e-6
# What is measured on an excerpt may be at most half of what is promised for the run.
_MARGIN = 2.0
_MOST_HOLDS = 8
_EXCERPT, _RAMP_IN = 5000, 0.05
# A table that does not move has no rate to compare with [rad/s].
_LEAST_RATE = 1e-6
_LEAPS = ("servo", "ideal")


@dataclass(frozen=True)
class StepChoice:
    """How the plant of a run is integrated.

    Parameters
    ----------
    holds : int
        Base steps per integration step.
    substeps : int
        Integration steps per base step; one of both is 1.
    error : float or None
        Largest change of a true rate against MuJoCo at the base step, over the largest rate [-], as measured on
        excerpts of the scenario; None where nothing was compared.
    base_rate_hz : float
        Base clock [Hz]; another than 20 kHz only where there is no plant.
    modal : bool
        The plant is played by its modes instead of MuJoCo's steps; they are exact over a base step.
    """

    holds: int = 1
    substeps: int = 1
    error: float | None = None
    base_rate_hz: float = BASE_RATE_HZ
    modal: bool = False

    @property
    def engine(self) -> str:
        """What plays the plant, "modal" or "mujoco"."""
        return "modal" if self.modal else "mujoco"

    @property
    def step(self) -> float:
        """Integration step [s]."""
        return self.holds / self.substeps / self.base_rate_hz


def choose_step(scenario: Scenario) -> StepChoice:
    """Return the step that the scenario asks for.

    `auto` takes the most base steps, up to 8, whose error is below half of 1e-6 of the largest rate. It is measured on
    excerpts of a quarter of a second: where the rate, the torque and the third derivative of the rate are largest.
    The engine `auto` takes modes instead where they differ from MuJoCo by less than 1e-6 on the same excerpts.

    Parameters
    ----------
    scenario : Scenario
        With `step` in its turntable.

    Raises
    ------
    ScenarioError
        If a given step is neither a multiple nor a whole part of the base step.
    """
    choice = given_step(scenario.turntable)
    if scenario.turntable.mode == "fixed":
        return StepChoice(base_rate_hz=scenario.base_rate_hz)
    if scenario.turntable.engine != "mujoco" and (modal := _by_modes(scenario)) is not None:
        return modal
    if choice.holds > 1:
        return replace(choice, error=_Excerpts(scenario).error(choice.holds))
    if scenario.turntable.step != "auto" or not _may_leap(scenario.turntable):
        return choice
    excerpts = _Excerpts(scenario)
    for holds in range(2, _MOST_HOLDS + 1):
        try:
            error = excerpts.error(holds)
        except (ScenarioError, RunError):
            break  # a mode is too fast for this step
        if error >= TRUTH_ERROR / _MARGIN:
            break
        choice = StepChoice(holds, 1, error)
    return choice


def _by_modes(scenario: Scenario) -> StepChoice | None:
    """Return the choice of the modes; None if they were not asked for by name and do not stand for MuJoCo here."""
    if scenario.turntable.engine == "modal":
        return StepChoice(modal=True)
    try:
        check_modal(scenario.turntable, exposed(scenario))
        error = _Excerpts(scenario).error(1, modal=True)
    except (ScenarioError, RunError):
        return None
    return StepChoice(error=error, modal=True) if error < TRUTH_ERROR else None


def exposed(scenario: Scenario) -> list[str]:
    """Return the sensors that feel cross rates and specific forces too."""
    return [name for name, sensor in scenario.sensors.items() if sensor.exposed]


def excerpt(scenario: Scenario, start: int = 0, ramp_in: float = 0.0) -> MotionProfile:
    """Return the commanded motion from base step `start` on as if it were the beginning, angle 0.

    Parameters
    ----------
    scenario : Scenario
        Whose motion.
    start : int, optional
        First base step.
    ramp_in : float, optional
        Ramp-in instead of the scenario's [s].
    """
    return _part(scenario.profile(ramp_in=0.0), start, ramp_in)


def _part(whole: MotionProfile, start: int, ramp_in: float) -> MotionProfile:
    begin = start / BASE_RATE_HZ

    def part(t: FloatArray) -> FloatArray:
        return whole.rate(t + begin)

    return MotionProfile([part], ramp_in, BASE_RATE_HZ)


def given_step(parameters: TurntableParameters) -> StepChoice:
    """Return the step that the parameters give, its error not yet measured; the base step for `auto`.

    Parameters
    ----------
    parameters : TurntableParameters
        With their `step`.

    Raises
    ------
    ScenarioError
        If it is neither a multiple nor a whole part of the base step, a multiple where each hold is a step, or given
        beside modes.
    """
    if parameters.engine == "modal" and parameters.step not in {"auto", 1.0 / BASE_RATE_HZ}:
        msg = f"expected none beside engine modal, whose modes are exact over each hold, got {parameters.step:g} s"
        raise ScenarioError(msg)
    if parameters.step == "auto":
        return StepChoice()
    ratio, base = float(parameters.step) * BASE_RATE_HZ, f"{1e6 / BASE_RATE_HZ:g} us"
    holds, substeps = max(round(ratio), 1), max(round(1.0 / ratio), 1)
    if abs(holds / substeps - ratio) > 1e-9 * ratio:
        msg = f"expected auto, or {base} times or divided by a whole number, got {ratio / BASE_RATE_HZ * 1e6:g} us"
        raise ScenarioError(msg)
    if holds > 1 and parameters.mode != "fixed" and not _may_leap(parameters):
        why = "with a moving floor" if parameters.mode in _LEAPS else f"in mode {parameters.mode}"
        msg = f"expected at most {base} {why}, got {ratio / BASE_RATE_HZ * 1e6:g} us"
        raise ScenarioError(msg)
    return StepChoice(holds, substeps)


def _may_leap(parameters: TurntableParameters) -> bool:
    """Return whether excerpts of the motion stand for the run: not for a loop of its own clock, nor for a floor of its
    own time.
    """
    return parameters.mode in _LEAPS and not parameters.floor.top_frequency()


class _Excerpts:
    """The hardest parts of a scenario, played with the base step, to compare longer steps with."""

    def __init__(self, scenario: Scenario) -> None:
        self._scenario = scenario
        self._n_time = min(_EXCERPT, scenario.n_time)
        # A floor moves on its own: whatever it does, it does under both.
        self._floor = scenario.floor(self._n_time / BASE_RATE_HZ)
        peaks = command_peaks(scenario)
        self._scale, self._motion = peaks.rate, scenario.profile(ramp_in=0.0)
        last = scenario.n_time - self._n_time
        starts = sorted({min(max(k - self._n_time // 2, 0), last) for k in peaks.places})
        self._base = {start: self._play(start, 1) for start in starts}

    def error(self, holds: int, *, modal: bool = False) -> float:
        """Return the largest change of a true rate by steps of `holds` base steps, or by modes, over the largest."""
        changes = [
            float(np.max(np.abs(a - b)))
            for start, base in self._base.items()
            for a, b in zip(_rates(base), _rates(self._play(start, holds, modal=modal)), strict=True)
        ]
        return max(changes) / max(self._scale, _LEAST_RATE)

    def _play(self, start: int, holds: int, *, modal: bool = False) -> TruthBlock:
        mountings = {name: sensor.mounting for name, sensor in self._scenario.sensors.items()}
        table = Turntable(
            self._scenario.turntable, mountings, BASE_RATE_HZ, holds=holds, floor=self._floor, modal=modal
        )
        motion = _part(self._motion, start, _RAMP_IN)
        command = motion.process(self._n_time)
        return table.process(command, motion.peek(table.lookahead))


def _rates(truth: TruthBlock) -> tuple[FloatArray, ...]:
    return truth.rate, truth.encoder_rate, *truth.sensor_rate.values()
