"""From YAML to a validated scenario, and back."""

from testbed.scenario.frame import Frame
from testbed.scenario.model import Bound, FilterSpec, Scenario

__all__ = ["Bound", "FilterSpec", "Frame", "Scenario"]
