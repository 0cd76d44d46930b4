"""The lines of sight of a run: who judges them, and where a bound finds its value."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from testbed.judging.noise_terms import noise_terms
from testbed.pointing.judge import PointingJudge
from testbed.scenario.pointing import fed_forward, gains_of

if TYPE_CHECKING:
    from collections.abc import Mapping

    from testbed.scenario.model import Scenario


def pointing_judges(scenario: Scenario, base_rate_hz: float) -> dict[str, PointingJudge]:
    """Return the judge of the line of sight behind each filter that feeds forward.

    Parameters
    ----------
    scenario : Scenario
        What runs.
    base_rate_hz : float
        Base clock [Hz].
    """
    pointing = scenario.pointing
    if pointing is None:
        return {}
    terms = {name: noise_terms(sensor) for name, sensor in scenario.sensors.items()}
    settle = round(scenario.frame.settle * base_rate_hz)
    return {
        name: PointingJudge(
            pointing,
            gains_of(scenario, name),
            base_rate_hz,
            settle,
            scenario.n_time,
            terms,
        )
        for name in fed_forward(scenario)
    }


def pointing_value(sight: Mapping[str, Any], metric: str) -> float | None:
    """Return the value of a metric such as ``residual_rms_urad``, ``rpe_urad.0.1`` or ``outage``, None if undefined.

    Parameters
    ----------
    sight : mapping
        Of one filter, as metrics.json has it.
    metric : str
        Its name; behind the first dot the window.
    """
    name, _, window = metric.partition(".")
    if window:
        value: float | None = (sight.get(name) or {}).get(window)
        return value
    found: float | None = sight.get(name, (sight.get("link") or {}).get(name))
    return found
