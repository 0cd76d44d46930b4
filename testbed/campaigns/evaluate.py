"""Metrics of many seeds and settings of a scenario, without files and without a run for each."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from threadpoolctl import threadpool_limits

from testbed.campaigns.lockstep import Lockstep
from testbed.chain.pipeline import block_lengths, simulate
from testbed.chain.versions import versions
from testbed.judging.judge import Judge
from testbed.runs.metrics import RunMetrics
from testbed.scenario.loader import as_scenario

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator, Mapping, Sequence
    from pathlib import Path

    from testbed.scenario.model import Scenario

# Seeds that advance together: a truth is played once for all of them, and their states take up to a MB each.
_TOGETHER = 128


def evaluate(
    scenario: Scenario | str | Path | Mapping[str, Any],
    seeds: Iterable[int],
    settings: Iterable[Mapping[str, Any]] | None = None,
) -> list[Any]:
    """Return the metrics of a scenario under many seeds, each those of `testbed.run` with that seed to 1e-9.

    Only `profiles`, the fluid over the height of a channel that a report draws, belong to a run alone.
    Nothing is written and no signal is kept: memory grows neither with the duration nor with the number of seeds, but
    for the metrics themselves. Motion and table are played once for all seeds and settings that share them, and so are
    what a sensor reads without noise, the floors and the optimum. Scenarios with a random motion or floor need a
    `truth_seed`, or else every seed has a truth of its own.

    Parameters
    ----------
    scenario : Scenario, str, Path or mapping
        A scenario, its file, or its keys as `Scenario.from_dict` takes them.
    seeds : iterable of int
        Instead of the scenario's.
    settings : iterable of mapping, optional
        Changes of the scenario as `Scenario.with_` takes them, by dotted keys; each is evaluated under every seed.

    Returns
    -------
    list of RunMetrics, or list of such lists
        One per seed, in the order of the seeds; with `settings` one such list per setting.

    Raises
    ------
    ScenarioError
        If the scenario, a seed or a setting is bad; nothing has run then.
    RunError
        If a run fails: the plant diverges, the motor saturates, a plug-in raises.

    Examples
    --------
    >>> still = {"name": "still", "duration": "0.1 s", "motion": [{"static": {}}], "turntable": {"mode": "fixed"}}
    >>> still["sensors"] = {"mems_gyro": {"preset": "adis16505"}}
    >>> found = evaluate(still, range(3), [{}, {"sensors.mems_gyro.angle_random_walk": "3 deg/sqrt(h)"}])
    >>> quiet, loud = ([one.sensors["mems_gyro"].rmse_deg_s for one in each] for each in found)
    >>> max(quiet) < min(loud)
    True
    """
    loaded, wanted = as_scenario(scenario), list(seeds)
    cases = [loaded] if settings is None else [loaded.with_(**one) for one in settings]
    # A bad seed is refused before anything runs.
    checked = [loaded.with_seed(seed).frame.seed for seed in wanted]
    found: dict[tuple[int, int], RunMetrics] = {}
    # Sums over a block are too short for threads: beside a busy core they wait seven times longer than they work.
    with threadpool_limits(limits=1, user_api="blas"):
        for group in _same_truth(cases):
            for together in _parts(checked, 1 if _own_truths(cases[group[0]]) else _TOGETHER):
                found |= _play(cases, group, together)
    table = [[found[i, seed] for seed in checked] for i in range(len(cases))]
    return table[0] if settings is None else table


def _play(cases: Sequence[Scenario], group: Sequence[int], seeds: Sequence[int]) -> dict[tuple[int, int], RunMetrics]:
    """Return the metrics by number of the case and seed."""
    if any(by_itself(cases[i]) for i in group):
        return {(i, seed): _alone(cases[i].with_seed(seed)) for i in group for seed in seeds}
    lockstep = Lockstep([cases[i] for i in group], seeds)
    for n_time in block_lengths(cases[group[0]]):
        lockstep.advance(n_time)
    made_by = versions()
    return {(number, seed): lockstep.metrics(i, seed, made_by) for i, number in enumerate(group) for seed in seeds}


def by_itself(scenario: Scenario) -> bool:
    """Return whether every seed of a scenario is played by itself: its sensors have clocks of their own.

    Parameters
    ----------
    scenario : Scenario
        Which.
    """
    return any(sensor.clocked(scenario.base_rate_hz) for sensor in scenario.sensors.values())


def _alone(scenario: Scenario) -> RunMetrics:
    """Return the metrics of a scenario by itself: sensors with clocks of their own share nothing between seeds."""
    chain, blocks = simulate(scenario)
    judge = Judge(scenario, chain.rates, chain.step)
    for block in blocks:
        judge.write(block)
    whole = judge.metrics(versions()).to_dict()
    return RunMetrics.model_validate({key: value for key, value in whole.items() if key != "profiles"})


def _parts(seeds: Sequence[int], most: int) -> Iterator[list[int]]:
    distinct = list(dict.fromkeys(seeds))
    return (distinct[k : k + most] for k in range(0, len(distinct), most))


def _own_truths(scenario: Scenario) -> bool:
    """Return whether every seed has a truth of its own."""
    return scenario.random_truth and scenario.frame.truth_seed is None


def _same_truth(cases: Sequence[Scenario]) -> list[list[int]]:
    """Return the numbers of the cases in groups that share the truth and what surrounds the sensors."""
    groups: list[tuple[Any, list[int]]] = []
    for i, case in enumerate(cases):
        content = _truth_of(case)
        for known, members in groups:
            if known == content:
                members.append(i)
                break
        else:
            groups.append((content, [i]))
    return [members for _, members in groups]


def _truth_of(case: Scenario) -> tuple[Any, ...]:
    """Return what the truth is made of."""
    frame = case.frame
    mountings = {name: (sensor.mounting, sensor.exposed) for name, sensor in case.sensors.items()}
    drawn = frame.truth_seed if case.random_truth else None
    clock = (frame.duration, frame.ramp_in, frame.temperature, case.base_rate_hz)
    return case.turntable, case.motion, mountings, drawn, clock
