"""Physics testbed for wide-band angular-rate sensing.

Data flows one way: scenario -> commanded motion -> turntable (truth) -> sensors (readings) -> fusion (estimates) ->
results.

Conventions: SI floats inside (rate [rad/s], angle [rad], frequency [Hz], time [s]); noise densities are two-sided root
densities [rad/sqrt(s)], so that white noise sampled at interval T has the standard deviation N/sqrt(T); units live in
YAML files, tables and plots only. Truth is the inertial rate at a sensor's site, never the encoder; the filters know
readings and their own belief, never the truth.
"""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any

from testbed._version import __version__

if TYPE_CHECKING:
    from testbed.chain.runner import run
    from testbed.errors import Problem, RunError, ScenarioError, UnknownNameError
    from testbed.notebook import Run, open_run
    from testbed.scenario.beliefs import belief_of
    from testbed.scenario.loader import load_scenario
    from testbed.scenario.model import Scenario

__all__ = [
    "Problem",
    "Run",
    "RunError",
    "Scenario",
    "ScenarioError",
    "UnknownNameError",
    "__version__",
    "belief_of",
    "load_scenario",
    "open_run",
    "run",
]

_LAZY = {
    "Problem": "testbed.errors",
    "Run": "testbed.notebook",
    "RunError": "testbed.errors",
    "Scenario": "testbed.scenario.model",
    "ScenarioError": "testbed.errors",
    "UnknownNameError": "testbed.errors",
    "belief_of": "testbed.scenario.beliefs",
    "load_scenario": "testbed.scenario.loader",
    "open_run": "testbed.notebook",
    "run": "testbed.chain.runner",
}


def __getattr__(name: str) -> Any:
    # Heavy libraries load on first use, so that `testbed --help` answers at once.
    if name in _LAZY:
        return getattr(import_module(_LAZY[name]), name)
    msg = f"module 'testbed' has no attribute {name!r}"
    raise AttributeError(msg)
