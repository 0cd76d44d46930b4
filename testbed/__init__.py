"""Physics testbed for wide-band angular-rate sensing.

Data flows one way: scenario -> commanded motion -> turntable (truth) -> sensors (readings) -> fusion (estimates) ->
results.

Conventions
-----------
SI floats inside: rate [rad/s], angle [rad], frequency [Hz], time [s]. Units live in YAML files, tables and plots only.
Noise densities are two-sided root densities [rad/sqrt(s)], so that white noise sampled at interval T has the standard
deviation N/sqrt(T). Truth is the inertial rate at a sensor's site, never the encoder; the filters know readings and
their own belief, never the truth.

Glossary
--------
aligned
    An error once the phase of each line is forgiven.
base clock
    The steps on which the motion is commanded and the truth is known: 20 kHz, or what the sensors of a fixed table ask
    for. Sensors read on every n-th of them.
belief
    What a filter takes a sensor to be: a transfer function and white noise before and behind it. It may differ from
    what the simulator does.
block
    The samples that all stages work on at a time; results do not depend on its length.
due, missing
    A slow sensor has no reading at most steps of the fastest one: there it is not due, NaN inside a filter. A reading
    that was due and was lost is missing: NaN where users see it, infinite inside a filter.
floor
    The error that no filter of an unknown signal gets below, by the sensors' noise. (That of a building is a `Floor`.)
form
    What a covariance recursion carries: P by Joseph's formula, P by the short one, or a root of P.
line
    A frequency of the commanded motion; gain and phase of an estimate are known at lines.
optimum
    The error of the best filter of this very signal, with exact models.
part
    The frozen, validated parameters of one motion, sensor, filter or turntable, and what it does with them.
preset
    A part that is shipped, such as an instrument with its data sheet's values.
reading
    What a sensor says of the rate. What it is not: the truth.
scenario
    One experiment: table, motion, sensors, filters and what is expected of them.
settle
    From this time on a run is judged.
stage
    What has a state, takes a block and returns a block.
std
    The standard deviation that a filter claims for its own rate.

Examples
--------
>>> import testbed
>>> run = testbed.run(
...     {
...         "name": "ten_hertz",
...         "duration": "0.3 s",
...         "settle": "0.1 s",
...         "motion": [{"sine": {"frequency": "10 Hz", "rate": "1 deg/s"}}],
...         "sensors": {"mhd_ars": {"preset": "sx300"}, "mems_gyro": {"preset": "adis16505_filtered"}},
...         "fusion": {"kalman": {}},
...     }
... )
>>> run.fusion["kalman"].rate.shape, run.truth.units["rate"]
((6000,), 'rad/s')
>>> run.metrics.fusion["kalman"].rmse_deg_s < run.metrics.sensors["mems_gyro"].rmse_deg_s
True
"""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any

from testbed._version import __version__

if TYPE_CHECKING:
    from testbed.campaigns.evaluate import evaluate
    from testbed.campaigns.sweep import open_sweep, sweep
    from testbed.chain.runner import run
    from testbed.chain.sight import line_of_sight
    from testbed.errors import Problem, RunError, ScenarioError, UnknownNameError
    from testbed.fusion import estimate, list_filters
    from testbed.identification.session import identify_sensors
    from testbed.logs import read_log
    from testbed.models.motions import list_motions
    from testbed.notebook import Run, open_run
    from testbed.playback.export import export
    from testbed.playback.replay import replay
    from testbed.scenario.beliefs import belief_of
    from testbed.scenario.loader import load_scenario
    from testbed.scenario.model import Scenario
    from testbed.sensors import list_presets, list_sensors, load_preset

__all__ = [
    "Problem",
    "Run",
    "RunError",
    "Scenario",
    "ScenarioError",
    "UnknownNameError",
    "__version__",
    "belief_of",
    "estimate",
    "evaluate",
    "export",
    "identify_sensors",
    "line_of_sight",
    "list_filters",
    "list_motions",
    "list_presets",
    "list_sensors",
    "load_preset",
    "load_scenario",
    "open_run",
    "open_sweep",
    "read_log",
    "replay",
    "run",
    "sweep",
]

# No name of a package below: once that is imported, it would hide the function.
_LAZY = {
    "Problem": "testbed.errors",
    "Run": "testbed.notebook",
    "RunError": "testbed.errors",
    "Scenario": "testbed.scenario.model",
    "ScenarioError": "testbed.errors",
    "UnknownNameError": "testbed.errors",
    "belief_of": "testbed.scenario.beliefs",
    "estimate": "testbed.fusion",
    "evaluate": "testbed.campaigns.evaluate",
    "export": "testbed.playback.export",
    "identify_sensors": "testbed.identification.session",
    "line_of_sight": "testbed.chain.sight",
    "open_sweep": "testbed.campaigns.sweep",
    "sweep": "testbed.campaigns.sweep",
    "list_filters": "testbed.fusion",
    "list_motions": "testbed.models.motions",
    "list_presets": "testbed.sensors",
    "list_sensors": "testbed.sensors",
    "load_preset": "testbed.sensors",
    "load_scenario": "testbed.scenario.loader",
    "open_run": "testbed.notebook",
    "read_log": "testbed.logs",
    "replay": "testbed.playback.replay",
    "run": "testbed.chain.runner",
}


def __getattr__(name: str) -> Any:
    # Heavy libraries load on first use, so that `testbed --help` answers at once.
    if name in _LAZY:
        return getattr(import_module(_LAZY[name]), name)
    msg = f"module 'testbed' has no attribute {name!r}"
    raise AttributeError(msg)


def __dir__() -> list[str]:
    return sorted(__all__)
