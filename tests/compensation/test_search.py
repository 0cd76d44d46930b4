"""The two searches on functions whose minimum is known."""

from __future__ import annotations

import numpy as np
import pytest

from testbed.compensation.search import evolve, grey_wolf

SEARCHES = [grey_wolf, evolve]


def bowl(p):
    return float((p[0] - 1.0) ** 2 + 4.0 * (p[1] + 2.0) ** 2)


@pytest.mark.oracle
@pytest.mark.parametrize("search", SEARCHES)
def test_finds_the_minimum_of_a_bowl(search):
    """20 generations shrink a pack by far more than the hundredth of the box that is asked for."""
    best = search(bowl, [(-5.0, 5.0), (-5.0, 5.0)], seed=3)
    assert np.allclose(best.point, [1.0, -2.0], rtol=0.0, atol=0.1)
    assert best.value == bowl(best.point)


@pytest.mark.oracle
@pytest.mark.parametrize("search", SEARCHES)
def test_finds_a_minimum_on_the_border_and_never_asks_beyond(search):
    asked = []

    def slope(p):
        asked.append(p.copy())
        return float(p.sum())

    best = search(slope, [(2.0, 3.0), (-1.0, 4.0)], seed=1)
    assert best.point == pytest.approx([2.0, -1.0], abs=0.02)
    assert np.min(asked, axis=0) == pytest.approx([2.0, -1.0], abs=0.02)
    assert np.all(np.min(asked, axis=0) >= [2.0, -1.0])
    assert np.all(np.max(asked, axis=0) <= [3.0, 4.0])


@pytest.mark.oracle
def test_decades_need_a_logarithmic_search():
    """The minimum lies at gamma 1e3, width 1e-2 of (10, 1e5) x (1e-6, 1e6): one part in 1e8 of the linear box."""

    def objective(p):
        return float(np.log10(p[0] / 1e3) ** 2 + np.log10(p[1] / 1e-2) ** 2)

    bounds = [(10.0, 1e5), (1e-6, 1e6)]
    assert grey_wolf(objective, bounds, log=True).value < 0.01
    assert evolve(objective, bounds, log=True).value < 0.01
    assert grey_wolf(objective, bounds).value > 1.0


@pytest.mark.parametrize("search", SEARCHES)
def test_counts_and_repeats(search):
    asked = []

    def counted(p):
        asked.append(p)
        return bowl(p)

    first = search(counted, [(-5.0, 5.0), (-5.0, 5.0)], seed=7)
    assert first.evaluations == len(asked)
    second = search(bowl, [(-5.0, 5.0), (-5.0, 5.0)], seed=7)
    assert np.array_equal(first.point, second.point)
    assert not np.array_equal(first.point, search(bowl, [(-5.0, 5.0), (-5.0, 5.0)], seed=8).point)


def test_wolves_ask_a_thousand_times_and_evolution_a_fifth_of_that():
    bounds = [(-5.0, 5.0), (-5.0, 5.0)]
    assert grey_wolf(bowl, bounds).evaluations == 50 * 20
    # 16 points in 1 + 6 generations and at most 60 for the simplex.
    assert evolve(bowl, bounds).evaluations <= 16 * 7 + 60


@pytest.mark.parametrize("search", SEARCHES)
@pytest.mark.parametrize(("bounds", "log"), [([(1.0, 1.0)], False), ([(0.0, 1.0)], True), ([(0.0, np.inf)], False)])
def test_bounds_that_are_no_box_are_refused(search, bounds, log):
    with pytest.raises(ValueError, match="bounds"):
        search(bowl, bounds, log=log)
