"""Source of what the filters of a bank do with each other, under a pack of seeds side by side."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

from testbed.fusion.lanes.source import LANES, added, function, over_lanes

if TYPE_CHECKING:
    from collections.abc import Iterable, Sequence


@dataclass(frozen=True)
class Bank:
    """Where what stands of the filters under a pack of seeds, all of it in one array W.

    Parameters
    ----------
    names : tuple of str
        Rows that each filter has, its states first.
    n_filter : int
        Filters.
    """

    names: tuple[str, ...]
    n_filter: int

    def at(self, name: str, m: int = 0) -> str:
        """Return the element of a row of filter m in the present lane."""
        return f"W[{LANES * (m * len(self.names) + self.names.index(name))} + s]"

    def all(self, name: str) -> list[str]:
        """Return the elements of a row of all filters in the present lane."""
        return [self.at(name, m) for m in range(self.n_filter)]


def mixture_functions(bank: Bank, n_sensor: int) -> list[str]:
    """Return functions on W: of each sensor `judge` and `credit`; `fade`, `weigh`, `contest`, `follow` and `mix`.

    Parameters
    ----------
    bank : Bank
        Their rows.
    n_sensor : int
        Sensors.
    """
    of_sensors = [part(bank, i) for i in range(n_sensor) for part in (_judge, _credit)]
    return [*of_sensors, _fade(bank), _weigh(bank), _contest(bank), _follow(bank), _mix(bank)]


def _greatest(names: Sequence[str]) -> str:
    """Return the greatest of some, from the left."""
    return names[0] if len(names) == 1 else f"max({_greatest(names[:-1])}, {names[-1]})"


def _scattered(bank: Bank, variance: str, value: str, mean: str) -> Iterable[str]:
    """Return the terms of the mixture's variance: that of each filter and its square off the mean, weighted."""
    parts = zip(bank.all("weight"), bank.all(variance), bank.all(value), strict=True)
    return (f"{weight} * ({own} + ({at} - {mean}) ** 2)" for weight, own, at in parts)


def _weighted(bank: Bank, value: str) -> str:
    return added(f"{weight} * {at}" for weight, at in zip(bank.all("weight"), bank.all(value), strict=True))


def _judge(bank: Bank, i: int) -> str:
    """Return how the mixture sees a reading, and by how much it is beyond the gate."""
    body = [
        f"mean = {_weighted(bank, f'e{i}')}",
        f"variance = {added(('R', *_scattered(bank, f'spread{i}', f'e{i}', 'mean')))}",
        "beyond[s] = max(beyond[s], abs(mean) / np.sqrt(variance) - gate)",
        "innovation[s], variances[s] = mean, variance",
    ]
    return function(f"judge{i}(W, R, gate, innovation, variances, beyond)", over_lanes(4, body))


def _credit(bank: Bank, i: int) -> str:
    """Return what adds the log likelihood of a reading to the scores, as
    `testbed.fusion.kernels.bank.log_likelihood` has it.
    """
    count = [f"far += 1 if {_greatest(bank.all(f'ratio{i}'))} > gate else 0"]
    parts = zip(bank.all("score"), bank.all(f"ratio{i}"), bank.all(f"logarithm{i}"), strict=True)
    near = [f"{score} += -0.5 * ({ratio} * {ratio} + {logarithm})" for score, ratio, logarithm in parts]
    score, ratio, logarithm = (f"W[first + {bank.at(name)[2:]}" for name in ("score", f"ratio{i}", f"logarithm{i}"))
    one = [
        f"ratio = {ratio}",
        "nis = gate * gate * (1.0 + 2.0 * np.log(ratio / gate)) if ratio > gate else ratio * ratio",
        f"{score} += -0.5 * (nis + {logarithm})",
    ]
    far = [f"        for first in range(0, W.size, {LANES * len(bank.names)}):", *over_lanes(12, one), "        return"]
    lines = ["    far = 0", *over_lanes(4, count), "    if far > 0:", *far, *over_lanes(4, near)]
    return function(f"credit{i}(W, gate)", lines)


def _fade(bank: Bank) -> str:
    return function("fade(W, forget)", over_lanes(4, [f"{score} *= forget" for score in bank.all("score")]))


def _weigh(bank: Bank) -> str:
    """Return what `testbed.fusion.kernels.bank.weigh` does."""
    scores, weights = bank.all("score"), bank.all("weight")
    shift = [f"top = {_greatest(scores)}", *(f"{score} -= top" for score in scores)]
    # Below that the exponential is 0.
    each = [f"{w} = np.exp({x}) if {x} > -746.0 else 0.0" for w, x in zip(weights, scores, strict=True)]
    powers = [line for one in each for line in over_lanes(4, [one])]
    divide = [f"total = {added(weights)}", *(f"{weight} = {weight} / total" for weight in weights)]
    return function("weigh(W)", [*over_lanes(4, shift), *powers, *over_lanes(4, divide)])


def _contest(bank: Bank) -> str:
    """Return what finds the best filter, of scores of which the highest is 0, and those that start again from it: that
    are slower, and by exp(-restart) less likely. How many do.
    """
    M = bank.n_filter
    body = [f"best = {M - 1}.0"]
    body += [f"best = {m}.0 if {bank.at('score', m)} == 0.0 else best" for m in range(M - 2, -1, -1)]
    body += ["ahead[s] = best"]
    body += [
        f"{bank.at('slower', m)} = 1.0 if ({bank.at('score', m)} < -restart) & ({m}.0 < best) else 0.0"
        for m in range(M)
    ]
    body += [f"some[s] = {added(bank.all('slower'))}"]
    found = ["    behind = 0.0", f"    for s in range({LANES}):", "        behind += some[s]", "    return behind"]
    return function("contest(W, restart, ahead, some)", [*over_lanes(4, body), *found])


def _follow(bank: Bank) -> str:
    """Return what gives a filter the states and the variance of another one where it is slower."""
    rows = range(bank.names.index("own") + 1)
    body = [f"a{k}, b{k} = ahead[{LANES * k} + s], W[{LANES * k} + s]" for k in rows]
    body += [f"there = {bank.at('slower')} > 0.0", *(f"W[{LANES * k} + s] = a{k} if there else b{k}" for k in rows)]
    return function("follow(W, ahead)", over_lanes(4, body))


def _mix(bank: Bank) -> str:
    """Return estimate and claim of the mixture [rad/s]."""
    body = [f"mean = {_weighted(bank, 'x0')}"]
    body += [f"variance = {added(_scattered(bank, 'own', 'x0', 'mean'))}", "rate[s], std[s] = mean, np.sqrt(variance)"]
    return function("mix(W, rate, std)", over_lanes(4, body))
