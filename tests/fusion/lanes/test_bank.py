"""Banks under many seeds have the bits that each has alone, and share what covariances they can."""

from __future__ import annotations

import ast
from copy import deepcopy

import numpy as np
import pytest

from testbed.fusion.belief import default_belief
from testbed.fusion.filters.wideband import Wideband, WidebandParameters
from testbed.fusion.kernels.covariance import LOST_VARIANCE
from testbed.fusion.lanes import heirs
from testbed.fusion.lanes.bank import BANKS_AT_ONCE, FEWEST
from testbed.fusion.lanes.source import LANES
from testbed.fusion.lanes.together import Together

RATES = {"mhd_ars": 20_000.0, "mems_gyro": 2_000.0}
# Slow noise of one state, and few filters, so that little is compiled.
SLOW = {"bias_instability": 5e-6, "rate_random_walk": 1e-7, "lowest_frequency": 0.05}
FEW = {"filters": 3, "decades": 9.0, "order": 2, "q": 1e-4}


def banks(n, **parameters):
    belief = default_belief()
    belief["mhd_ars"] = belief["mhd_ars"].model_copy(update={"noise_knee": None})
    belief["mems_gyro"] = belief["mems_gyro"].model_copy(update=SLOW)
    first = Wideband(belief, RATES, WidebandParameters(**parameters))
    return [deepcopy(first) for _ in range(n)]


class Table:
    """Motion as the filters believe it, under many seeds: at rest first, then not much less lively than the fastest of
    the bank expects, which no gate takes for a spike. The others start again, at instants of their own.
    """

    def __init__(self, one, n, rng):
        self.model, self.R, self.n, self.rng, self.k = one.model, one._R, n, rng, 0
        self.root = 0.03 * np.linalg.cholesky(one._Q[:, :, -1] + 1e-30 * np.eye(len(one._Q)))
        self.x = np.zeros((len(one._x), n))

    def readings(self, n_time):
        """Return the next readings of each seed."""
        Z = np.empty((n_time, len(self.R), self.n))
        for k in range(n_time):
            if self.k + k > 200:
                self.x = self.model.F @ self.x + self.root @ self.rng.standard_normal(self.x.shape)
            Z[k] = self.model.H @ self.x
        Z += np.sqrt(self.R)[:, None] * self.rng.standard_normal(Z.shape)
        due = {"mhd_ars": slice(None), "mems_gyro": slice(-self.k % 10, None, 10)}
        self.k += n_time
        place = {name: self.model.sensors.index(name) for name in due}
        return [{name: Z[at, place[name], s].copy() for name, at in due.items()} for s in range(self.n)]


def process(together, lanes, given):
    """Return what the lanes give, and how many of them went side by side."""
    received = [one.received(values) for one, values in zip(lanes, given, strict=True)]
    done = {}
    advance = together._lanes.advance
    together._lanes.advance = lambda *arguments: done.setdefault(0, advance(*arguments))
    found = [*together.process(lanes, received)]
    del together._lanes.advance
    return found, sorted(done[0])


def assert_same(alone, ours):
    for signal in ("rate", "std"):
        assert np.array_equal(getattr(alone, signal), getattr(ours, signal)), signal
    for key, values in ours.diagnostics.items():
        assert np.array_equal(alone.diagnostics[key], values, equal_nan=True), key


def assert_left_alike(alone, ours):
    """Compare what the next block begins with, without the upper half of P, which Joseph's form does not have."""
    half = np.tril_indices(len(alone._x))
    for name in ("_x", "_score", "_watch", "_setting"):
        assert np.array_equal(getattr(alone, name), getattr(ours, name)), name
    assert np.array_equal(alone._P[half], ours._P[half])


@pytest.mark.parametrize(("start", "n", "restart"), [("unknown", LANES + 3, 20.0), ("rest", FEWEST, 1e6)])
def test_banks_have_the_bits_of_the_kernel(start, n, restart, rng):
    """Through blocks of any length, while filters start again from better ones and come back; and where they never do,
    so that they find readings far beyond their gate.
    """
    alone, lanes = (banks(n, start=start, restart=restart, **FEW) for _ in range(2))
    together, table = Together(lanes[0]), Table(lanes[0], n, rng)
    for length in (301, 1, 700, 57):
        given = table.readings(length)
        expected = [one.process(values) for one, values in zip(alone, given, strict=True)]
        found, side_by_side = process(together, lanes, given)
        assert side_by_side == list(range(n))
        for a, b in zip(expected, found, strict=True):
            assert_same(a, b)
        for a, b in zip(alone, lanes, strict=True):
            assert_left_alike(a, b)
    P = np.stack([one._P[np.tril_indices(len(one._x))] for one in lanes])
    shared = (P[0] == P).all(axis=(0, 1))
    # The fastest one never starts again; the others have, so that the rest of the test means something.
    assert shared.tolist() == ([False, False, True] if restart < 100.0 else [True] * 3)


def test_a_bank_of_its_own_fate_goes_alone(rng):
    """Lost readings, a spike beyond the gate; the others do not notice, and it is back in the next block."""
    alone, lanes = banks(FEWEST + 3, gate=False, **FEW), banks(FEWEST + 3, gate=False, **FEW)
    together, table, beside = Together(lanes[0]), Table(lanes[0], len(lanes), rng), []
    for number in range(4):
        given = table.readings(300)
        if number == 1:
            given[1]["mhd_ars"][50:60] = np.nan
            given[2]["mems_gyro"][7] = np.nan
            given[4]["mhd_ars"][-1] = 5.0
        expected = [one.process(values) for one, values in zip(alone, given, strict=True)]
        found, side_by_side = process(together, lanes, given)
        beside.append(side_by_side)
        for a, b in zip(expected, found, strict=True):
            assert_same(a, b)
        for a, b in zip(alone, lanes, strict=True):
            assert_left_alike(a, b)
    everyone = list(range(FEWEST + 3))
    assert beside == [everyone, sorted({*everyone} - {1, 2, 4}), everyone, everyone]


def test_a_few_go_alone(rng):
    """Nothing is compiled for them."""
    lanes = banks(FEWEST - 1, **FEW)
    together = Together(lanes[0])
    found, side_by_side = process(together, lanes, Table(lanes[0], len(lanes), rng).readings(100))
    assert len(found) == FEWEST - 1
    assert side_by_side == []


def test_a_bank_that_loses_the_rate_at_once_goes_alone(rng):
    """As after a gap up to the end of the last block: the kernel recalls it, which the lanes do not know."""
    alone, lanes = banks(FEWEST + 1, **FEW), banks(FEWEST + 1, **FEW)
    together, table = Together(lanes[0]), Table(lanes[0], len(lanes), rng)
    for number in range(2):
        given = table.readings(100)
        expected = [one.process(values) for one, values in zip(alone, given, strict=True)]
        found, side_by_side = process(together, lanes, given)
        assert side_by_side == [m for m in range(FEWEST + 1) if number == 0 or m != 3]
        for a, b in zip(expected, found, strict=True):
            assert_same(a, b)
        alone[3]._P[0, 0] = lanes[3]._P[0, 0] = 2.0 * LOST_VARIANCE


def test_banks_that_lose_the_rate_in_every_step_go_alone(rng, monkeypatch):
    """In the first block it is found out, behind that nothing is tried any longer."""
    lively = FEW | {"decades": 26.0}
    alone, lanes = banks(FEWEST, **lively), banks(FEWEST, **lively)
    together, table = Together(lanes[0]), Table(banks(1, **FEW)[0], len(lanes), rng)
    for number in range(3):
        given = table.readings(100)
        expected = [one.process(values) for one, values in zip(alone, given, strict=True)]
        found, side_by_side = process(together, lanes, given)
        assert side_by_side == []
        for a, b in zip(expected, found, strict=True):
            assert_same(a, b)
        if number == 0:
            monkeypatch.setattr("testbed.fusion.lanes.bank.Banks.run", None)


def test_a_block_of_nothing_begins_nothing(rng):
    """The first step of the next one is still that of the first reading, before which nothing moves."""
    alone, lanes = banks(FEWEST, **FEW), banks(FEWEST, **FEW)
    together, table = Together(lanes[0]), Table(lanes[0], len(lanes), rng)
    for length in (0, 30):
        given = table.readings(length)
        expected = [one.process(values) for one, values in zip(alone, given, strict=True)]
        found, _ = process(together, lanes, given)
        for a, b in zip(expected, found, strict=True):
            assert_same(a, b)
        for a, b in zip(alone, lanes, strict=True):
            assert_left_alike(a, b)


def test_no_argument_is_a_bare_number():
    """Such a number is part of the type: what models share would be compiled for each, and two processes that do so at
    the same time could take each other's code from the disk.
    """
    lanes = Together(banks(1, **FEW)[0])._lanes
    assert lanes is not None
    tree = ast.parse(lanes._source.text)
    ours = {part.name for part in tree.body if isinstance(part, ast.FunctionDef)}
    shared = [part for part in tree.body if isinstance(part, ast.ImportFrom) and part.module.startswith("testbed")]
    ours |= {one.name for part in shared for one in part.names}
    calls = [part for part in ast.walk(tree) if isinstance(part, ast.Call) and getattr(part.func, "id", "") in ours]
    assert len({call.func.id for call in calls}) > 2
    assert [ast.unparse(call) for call in calls if any(isinstance(one, ast.Constant) for one in call.args)] == []


def test_more_seeds_are_there_at_once_where_they_share():
    lanes = banks(1, **FEW)
    assert Together(lanes[0]).at_once == BANKS_AT_ONCE
    assert not Together(banks(1, form="square_root", **FEW)[0]).in_lanes


def test_heirs_of_one_parent_at_one_step_are_one(rng):
    """Against dictionaries: who has which covariance, through births, deaths and moves; every number of a covariance
    tells its filter and its past.
    """
    M, kept, packs = 3, 2, 2
    C = np.zeros((packs * M + 1, (kept + 1) * LANES))
    noise = np.arange(M, dtype=float)[:, None]
    of = np.tile(np.arange(M)[:, None], (packs, 1, LANES))
    users, live = np.bincount(of.ravel(), minlength=len(C) * LANES), np.zeros(len(C), np.int64)
    live[0] = M
    child, counted = np.full((len(C) * LANES, M, 2), -1), np.array([0, M])
    whole = C.reshape(len(C), kept + 1, LANES)
    whole[0, 0, :M], whole[0, -1, :M] = np.arange(M), np.arange(M)
    # What a filter should have: the first row of its founder, the step of its birth in the second.
    founder = of.astype(float)
    born_at = np.zeros(of.shape)
    for step in range(1, 60):
        counted[0] = step
        for p in range(packs):
            best = rng.integers(1, M, LANES)
            for m in range(M - 1):
                slower = ((rng.random(LANES) < 0.3) & (m < best)).astype(float)
                even = heirs.change.py_func(slower, best, m, of[p], C, kept, noise, child, users, live, counted)
                assert even == (of[p, m] == of[p, m, 0]).all()
                for s in np.flatnonzero(slower):
                    founder[p, m, s], born_at[p, m, s] = founder[p, best[s], s], born_at[p, best[s], s]
        if step % 7 == 0:
            heirs.close_ranks.py_func(C, kept + 1, of, users, live, counted)
            assert (users > 0)[: (users > 0).sum()].all()
        assert np.array_equal(users, np.bincount(of.ravel(), minlength=users.size))
        assert np.array_equal(live, (users.reshape(-1, LANES) > 0).sum(axis=1))
        assert np.array_equal(whole[of // LANES, 0, of % LANES], founder)
        assert np.array_equal(whole[of // LANES, 1, of % LANES], born_at)
        assert np.array_equal(whole[of // LANES, 2, of % LANES], np.broadcast_to(np.arange(M)[:, None], of.shape))
        # Those that live on change, so that no two of them are alike unless they are one.
        c = np.flatnonzero(users)
        whole[c // LANES, 1, c % LANES] = c + 1000.0 * step
        born_at = whole[of // LANES, 1, of % LANES].copy()
    # All that have one covariance at last came from one parent at one step.
    assert len({(m, founder[p, m, s], born_at[p, m, s]) for p, m, s in np.ndindex(of.shape)}) == np.unique(of).size
