"""Coefficients that scatter between cycles bound what any model of other cycles can reach."""

import numpy as np
import pytest

from testbed.compensation.model_only import train
from testbed.drift.quality import timed_means
from testbed.models.fog_thermal import COEFFICIENTS
from testbed.reproduce import paper3
from testbed.sensors import load_preset

FS, SCATTER = 0.1, 0.1
SEEDS = range(1, 31)
FOG = load_preset("fog_paper3")


def quiet(thermal):
    return FOG.model_copy(update={"noise": False, "scale_factor_temperature": 0.0, "thermal": thermal})


def spread(fog, seed, name="paper"):
    """Return the variance of the 100 s means of the drift."""
    return timed_means(paper3.cycle(name, seed, FS, fog).drift, FS).var()


@pytest.mark.slow
def test_what_is_left_is_the_scatter_of_the_judged_cycle_and_of_the_mean_of_those_trained_on():
    """Independent coefficients: E left^2 = s^2 (1 + 1/2) sum_j var(term j), the terms being the drift of one
    coefficient alone. Without noise, so that the model knows each cycle's drift.
    """
    thermal = FOG.thermal
    nothing = dict.fromkeys(COEFFICIENTS[:-1], 0.0)
    alone = [{**nothing, "hysteresis": (0.0, 0.0), name: getattr(thermal, name)} for name in COEFFICIENTS[:-1]]
    h = thermal.hysteresis
    alone += [{**nothing, "hysteresis": (h[0], 0.0)}, {**nothing, "hysteresis": (0.0, h[1])}]
    terms = sum(spread(quiet(thermal.model_copy(update=change)), 0) for change in alone)
    fog = quiet(thermal.model_copy(update={"scatter": SCATTER}))
    left = []
    for seed in SEEDS:
        cycles = [paper3.cycle(name, 100 * seed + k, FS, fog) for k, name in enumerate(("two rates, up", "down first"))]
        judged = paper3.cycle("paper", 100 * seed + 50, FS, fog)
        out = train([one.record for one in cycles]).apply(judged.record)
        left.append(timed_means(judged.drift - out.drift, FS).var())
    # One term, the linear one, has most of it: chi-square of one degree of freedom, std sqrt(2) of its mean. Three
    # sigma over thirty seeds are 0.77; the form of the model leaves a few per cent more.
    bound = 3.0 * np.sqrt(2.0 / len(left))
    assert np.mean(left) == pytest.approx(1.5 * SCATTER**2 * terms, rel=bound, abs=0.0)


@pytest.mark.slow
@pytest.mark.parametrize(("scatter", "reduction"), [(0.0, 30.0), (0.1, 5.9), (0.2, 4.1)])
def test_reductions_that_were_reported_are_those_of_scattering_coefficients(scatter, reduction):
    """30 without, 5.9 at 10 % and 4.1 at 20 % were reported. With ours 18 to 25 without noise in the training, 7 and
    4.4 with (benchmarks/fog_audit.py): the median of 16 cycles within a factor of two of what was reported, since the
    logarithm of a reduction scatters by half.
    """
    fog = FOG.model_copy(update={"thermal": FOG.thermal.model_copy(update={"scatter": scatter})})
    known = fog if scatter else quiet(FOG.thermal)
    found = []
    for seed in range(1, 9):
        names = ("two rates, up", "two rates, down")
        model = train([paper3.cycle(name, 100 * seed + k, FS, known).record for k, name in enumerate(names)])
        for k, name in enumerate(("paper", "down first")):
            judged = paper3.cycle(name, 100 * seed + 50 + k, FS, fog)
            rest = timed_means(judged.drift - model.apply(judged.record).drift, FS)
            found.append(timed_means(judged.drift, FS).std() / rest.std())
    assert reduction / 2.0 < np.median(found) < 2.0 * reduction
