"""The figures of a campaign: what varies decides how it is drawn, and in which units."""

from __future__ import annotations

import itertools
import re

import numpy as np
import pytest

from testbed.campaigns.axes import as_written
from testbed.campaigns.curves import Point, Summary
from testbed.campaigns.figures import by_ratios, figures_of, makes_curve, panels_of
from testbed.campaigns.maps import color_at, crossed, errors_over
from testbed.campaigns.page import in_units_of
from testbed.campaigns.study import load_study
from testbed.pages.palette import luminance
from testbed.pages.scales import Scale
from tests.campaigns.test_study import written

NONE = (np.nan,) * 3


def point(case, rmse, **axes):
    bounds = {"floor": rmse / 4, "optimum": rmse / 3, "claimed": rmse, "nees": 1.0}
    ends = {"lower": rmse / 2, "rmse": rmse, "upper": 2 * rmse}
    return Point(
        case=case, axes=axes, n_seed=3, first_seed=1, gain=(0.9, 1.0, 1.1), phase=NONE, sight={}, **bounds, **ends
    )


def summary(points, names=("kalman", "shakf")):
    return Summary({("filter", name): points for name in names}, [], [])


GRID = [point(k, 1.0 + k, f=f, d=d) for k, (f, d) in enumerate(itertools.product((1.0, 10.0, 100.0), (0.0, 1.0)))]
RNG = np.random.default_rng(4)
DRAWN = [point(k, 1.0 + k, f=float(f), d=float(d)) for k, (f, d) in enumerate(RNG.uniform(1.0, 20.0, (30, 2)))]


def test_axes_that_meet_are_cells_and_those_that_were_drawn_are_points():
    cells, points = (str(figures_of(summary(one), {"f": "Hz", "d": "ms"})["map"]) for one in (GRID, DRAWN))
    # Of two filters, beside the bar of colours.
    shades = len(re.findall("<rect", points))
    assert cells.count("<rect") - shades == 2 * len(GRID)
    assert cells.count("<circle") == 0
    assert points.count("<circle") == 2 * len(DRAWN)
    assert crossed(errors_over(GRID[:3], "f", "d"))  # as far as it has come


def test_points_that_were_drawn_together_are_not_joined_and_their_axes_are_even():
    assert makes_curve(GRID, "f")
    assert not makes_curve(DRAWN, "f")
    for found, dashed in ((summary(GRID), True), (summary(DRAWN), False)):
        for _, panels, _ in panels_of(found, "f"):
            assert {one.dash is not None for panel in panels for one in panel.series} == {dashed}
    assert by_ratios(np.array([1.0, 10.0, 100.0]))
    assert not by_ratios(np.linspace(1.0, 100.0, 7))
    assert not by_ratios(np.array(sorted(one.axes["f"] for one in DRAWN)))


def test_where_another_axis_varies_a_curve_has_the_rms_over_it():
    ((_, (panel,), _), *_) = panels_of(summary(GRID), "f")
    np.testing.assert_allclose(panel.series[0].y, np.sqrt([(1 + 4) / 2, (9 + 16) / 2, (25 + 36) / 2]))
    assert [one.name for one in panel.series] == ["kalman", "shakf", "noise floor", "optimum of each case"]


def test_the_colours_of_the_map_grow_lighter_with_the_error():
    shades = Scale(1e-3, 1.0, 0.0, 1.0, log=True)
    light = [luminance(color_at(shades, error)) for error in np.geomspace(1e-3, 1.0, 30)]
    assert np.all(np.diff(light) > 0.0)


def test_more_filters_than_a_row_holds_stand_below():
    names = [f"filter_{k}" for k in range(7)]
    drawn = str(figures_of(summary(GRID, names), {"f": "Hz", "d": "ms"})["map"])
    feet = {float(y) for y, name in re.findall(r'y="([\d.]+)" [^>]*>(filter_\d)<', drawn)}
    assert len(feet) == 3


@pytest.mark.parametrize(
    ("values", "found"),
    [
        (["0.1 ms", "1e-1 ms"], ([0.1, 0.1], "ms")),
        ([3, 4.5], ([3.0, 4.5], "")),
        (["1 ms", "1 s"], None),
        (["1 ms", None], None),
        ([True, False], None),
        ([{"preset": "sx300"}], None),
        (["exact", "1 Hz"], None),
    ],
)
def test_an_axis_is_shown_in_the_unit_of_its_study(values, found):
    assert as_written(values) == found


def test_the_points_of_a_page_are_in_the_units_of_its_study(tmp_path):
    axis = "{sensors.mhd_ars.delay: {linear: [0 ms, 1 ms], points: 3}, duration: [200 ms, 0.4 s]}"
    study = load_study(written(tmp_path, f"vary: {axis}\nseeds: 1\n"))
    one, other = study.axes
    si = [
        point(case.number, 1.0, **{one: 1e-3 * (case.number // 2) / 2, other: 0.2 + 0.2 * (case.number % 2)})
        for case in study.cases
    ]
    found, units = in_units_of(study, summary(si))
    assert units == {one: "ms", other: "s"}
    assert [each.axes for each in found.points["filter", "kalman"]] == [
        {one: k / 2, other: 0.2 + 0.2 * n} for k in range(3) for n in range(2)
    ]
