"""What the sensors make of a rate, frequency by frequency, and what filters were told of it."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from testbed.fusion.belief import declared

if TYPE_CHECKING:
    from collections.abc import Callable

    from testbed.scenario.model import Scenario
    from testbed.signals import ComplexArray, FloatArray

_POINTS = np.logspace(-2, 4, 73)


def response_curves(scenario: Scenario) -> dict[str, Any]:
    """Return the entry `responses` of metrics.json: each sensor's up to half its sample rate, as it is built and, where
    that is another, as filters believe; those that believe the same stand together.

    Parameters
    ----------
    scenario : Scenario
        What runs.
    """
    beliefs: list[dict[str, Any]] = []
    for name, spec in scenario.fusion.items():
        if declared(spec.belief) == "exact":
            continue
        told = {
            sensor: _curve(one.response, scenario.sensors[sensor].sample_rate) for sensor, one in spec.belief.items()
        }
        same = next((entry for entry in beliefs if entry["sensors"] == told), None)
        if same:
            same["filters"].append(name)
        else:
            beliefs.append({"filters": [name], "sensors": told})
    return {
        "frequency_hz": _POINTS.tolist(),
        "sensors": {name: _curve(one.response, one.sample_rate) for name, one in scenario.sensors.items()},
        "beliefs": beliefs,
    }


def _curve(response: Callable[[FloatArray], ComplexArray], sample_rate_hz: float) -> dict[str, list[float]]:
    found = response(_POINTS[: np.searchsorted(_POINTS, sample_rate_hz / 2.0)])
    # Six digits: a figure shows three.
    return {
        "gain": [float(f"{one:.6g}") for one in np.abs(found)],
        "phase_deg": [float(f"{one:.6g}") for one in np.degrees(np.angle(found))],
    }
