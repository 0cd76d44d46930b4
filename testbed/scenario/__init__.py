"""From YAML to a validated scenario, and back."""

from testbed.scenario.model import Bound, FilterSpec, Frame, Scenario

__all__ = ["Bound", "FilterSpec", "Frame", "Scenario"]
