"""The first half of the chain: what is commanded, and what the table makes of it."""

from __future__ import annotations

from typing import TYPE_CHECKING

from testbed.models.turntable.turntable import Turntable
from testbed.runs.block import POSE_STRIDE
from testbed.scenario.step_choice import choose_step, exposed

if TYPE_CHECKING:
    from testbed.models.motion import CommandBlock
    from testbed.models.turntable.truth import TruthBlock
    from testbed.scenario.model import Scenario


class Truth:
    """Motion and turntable of a scenario; nothing in it knows the seed of the noise.

    Parameters
    ----------
    scenario : Scenario
        What to play.
    """

    def __init__(self, scenario: Scenario) -> None:
        self._motion = scenario.profile()
        self.step = choose_step(scenario)
        self.turntable = Turntable(
            scenario.turntable,
            {name: sensor.mounting for name, sensor in scenario.sensors.items()},
            scenario.base_rate_hz,
            substeps=self.step.substeps,
            holds=self.step.holds,
            pose_stride=POSE_STRIDE,
            exposed=exposed(scenario),
            modal=self.step.modal,
            floor=scenario.floor(),
        )

    def process(self, n_time: int) -> tuple[CommandBlock, TruthBlock]:
        """Return what was commanded and what happened over the next `n_time` base samples."""
        command = self._motion.process(n_time)
        return command, self.turntable.process(command, self._motion.peek(self.turntable.lookahead))
