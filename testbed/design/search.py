"""Every chain that the parts allow, what it leaves by spectra, and which are worth their cost."""

from __future__ import annotations

import itertools
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

from testbed.design.response import filter_response
from testbed.design.spectra import disturbance, doubts_of, errors_of, mean_squares, reading_noise
from testbed.errors import Problem, ScenarioError
from testbed.pointing.parameters import PointingParameters
from testbed.scenario.pointing import gains_of

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping

    from testbed.design.requirement import Requirement
    from testbed.scenario.model import Scenario

_MOST = 20_000
# A tracker of that bandwidth [Hz], and that time after an unknown start [s], leave nothing of the start: spectra and
# runs agree within 0.5 %, and by 13 % no longer at 1 Hz, or at 2 s.
_QUICK_HZ, _STARTED = 3.0, 8.0


@dataclass(frozen=True)
class Candidate:
    """One chain.

    Parameters
    ----------
    sensors : tuple of str
        Names.
    blend, tracker, mirror : str
        Names.
    cost : float
        Of all its parts.
    values : mapping of str to float
        What it leaves, by the metrics that are asked for, and `residual_rms_urad` [urad].
    met : bool
        Whether that is enough.
    doubts : tuple of str
        What the spectra do not know of it and should: where its mirror comes to an end.
    """

    sensors: tuple[str, ...]
    blend: str
    tracker: str
    mirror: str
    cost: float
    values: Mapping[str, float]
    met: bool
    doubts: tuple[str, ...] = ()

    @property
    def name(self) -> str:
        """All its parts in words."""
        return f"{' + '.join(self.sensors)}, {self.blend}, {self.tracker}, {self.mirror}"


@dataclass(frozen=True)
class Design:
    """All candidates, and those that could not be judged.

    Parameters
    ----------
    candidates : tuple of Candidate
        The cheapest first, of equal cost the best.
    refused : mapping of str to str
        Why a combination has no spectrum, by its sensors and filter.
    """

    candidates: tuple[Candidate, ...]
    refused: Mapping[str, str]

    @property
    def chosen(self) -> Candidate | None:
        """The cheapest that is enough, None if none is."""
        return next((one for one in self.candidates if one.met), None)

    def pareto(self, metric: str) -> list[Candidate]:
        """Return the candidates of which no cheaper one is as good, cheapest first.

        Parameters
        ----------
        metric : str
            What counts.
        """
        front: list[Candidate] = []
        for one in sorted(self.candidates, key=lambda each: (each.cost, each.values[metric])):
            if not front or one.values[metric] < front[-1].values[metric]:
                front.append(one)
        return front


def search(requirement: Requirement) -> Design:
    """Return what every chain of a requirement's parts leaves.

    Parameters
    ----------
    requirement : Requirement
        What is asked, and the parts.

    Raises
    ------
    ScenarioError
        If there are too many chains, or none has a spectrum.
    """
    whole = requirement.scenario
    shake = disturbance(whole)
    noise = reading_noise(whole.sensors, shake.freq_hz)
    metrics = list(dict.fromkeys([*(bound.metric for bound in requirement.bounds), "residual_rms_urad"]))
    n_chain = (2 ** len(whole.sensors) - 1) * len(whole.fusion) * len(requirement.trackers) * len(requirement.mirrors)
    if n_chain > _MOST:
        raise ScenarioError([Problem(f"expected at most {_MOST} chains, got {n_chain}", file=whole.file)])
    found, refused = [], {}
    for part in _with_some_sensors(whole):
        (blend,) = part.fusion
        try:
            judged = whole.frame.settle, whole.frame.duration
            response = filter_response(part.fusion[blend], part.sensors, part.base_rate_hz, *judged)
        except ValueError as error:
            refused[f"{' + '.join(part.sensors)}, {blend}"] = str(error)
            continue
        for tracker, mirror in itertools.product(requirement.trackers, requirement.mirrors):
            pointing = PointingParameters(tracker=requirement.trackers[tracker], mirror=requirement.mirrors[mirror])
            if not pointing.margins().stable:
                refused[f"{tracker}, {mirror}"] = "the tracker's loop is unstable"
                continue
            aimed = replace(part, pointing=pointing)
            gains = gains_of(aimed, blend)
            heard = {name: noise[name] for name in part.sensors}
            way = response, heard, pointing.mirror, gains, pointing.tracker.noise
            power, deflection = mean_squares(shake, *way)
            values = {metric: errors_of(power, shake, metric) for metric in metrics}
            met = all(bound.met(values[bound.metric]) for bound in requirement.bounds)
            chain = (*(("sensors", name) for name in part.sensors), ("fusion", blend), ("trackers", tracker))
            cost = sum(requirement.costs[key] for key in (*chain, ("mirrors", mirror)))
            doubts = (*doubts_of(deflection, shake, pointing.mirror), *_start_doubts(aimed, blend))
            found.append(Candidate(tuple(part.sensors), blend, tracker, mirror, cost, values, met, doubts))
    if not found:
        reasons = [Problem(f"{name}: {reason}", file=whole.file) for name, reason in refused.items()]
        raise ScenarioError(reasons)
    first = requirement.bounds[0].metric
    return Design(tuple(sorted(found, key=lambda one: (one.cost, one.values[first]))), refused)


def _start_doubts(part: Scenario, blend: str) -> Iterator[str]:
    """Yield where what the start has left is seen, which no spectrum holds: gains still move, means are not gone."""
    assert part.pointing is not None
    if part.pointing.tracker.bandwidth < _QUICK_HZ:
        yield (
            f"a tracker of {part.pointing.tracker.bandwidth:g} Hz lets through what the filter's start has left, for "
            "half a minute, which spectra do not know: judge it by --prove"
        )
    if getattr(part.fusion[blend].parameters, "start", "rest") == "unknown" and part.frame.settle < _STARTED:
        yield (
            f"{part.frame.settle:g} s after an unknown start its error is not gone, which spectra do not know: judge "
            "it by --prove, or from later on"
        )


def _with_some_sensors(whole: Scenario) -> Iterator[Scenario]:
    """Yield the scenario with each choice of sensors and one filter of these."""
    for count in range(1, len(whole.sensors) + 1):
        for chosen in itertools.combinations(whole.sensors, count):
            for blend, spec in whole.fusion.items():
                of_chosen = replace(spec, belief={name: spec.belief[name] for name in chosen})
                sensors = {name: whole.sensors[name] for name in chosen}
                yield replace(whole, sensors=sensors, fusion={blend: of_chosen})


def chosen_scenario(requirement: Requirement, candidate: Candidate) -> dict[str, Any]:
    """Return the keys of the scenario that plays a candidate, with what is asked as its expectations.

    Parameters
    ----------
    requirement : Requirement
        Where its parts are from.
    candidate : Candidate
        Which.
    """
    written, seed = requirement.written, requirement.scenario.frame.seed
    expect = {bound.metric: f"{bound.relation} {bound.limit!r}" for bound in requirement.bounds}
    return {
        # The motion that was designed for, whatever noise the sensors have.
        "truth_seed": seed,
        **written["frame"],
        "sensors": {name: written["sensors"][name] for name in candidate.sensors},
        "fusion": {candidate.blend: written["fusion"][candidate.blend]},
        "pointing": {
            "tracker": written["trackers"][candidate.tracker],
            "mirror": written["mirrors"][candidate.mirror],
            "windows": [f"{window.length!r} s" for window in requirement.windows],
        },
        "expect": {candidate.blend: expect},
    }
