"""Printed in grey, every figure can be read: no two of its series have one style and nearly one grey."""

from __future__ import annotations

import io
from dataclasses import replace

import numpy as np
import pytest
from matplotlib.figure import Figure
from PIL import Image

import testbed
from testbed.campaigns.curves import Point, Summary
from testbed.campaigns.figures import figures_of, panels_of
from testbed.campaigns.rows import RESIDUAL
from testbed.pages.palette import NAMED, series_marks
from testbed.pages.svg import figure_bytes
from testbed.report import run_figures
from testbed.report.comparison import Side, _figures
from testbed.report.digest import ThermalTrace, digest_run
from testbed.report.figures import thermal_figure
from testbed.runs.results import RunRecord
from tests.report.grey import confused, confused_series, grey
from tests.report.test_browser import RUN
from tests.report.test_figures import colors_of, envelope_of, make_digest

MANY = {
    **RUN,
    "fusion": {**RUN["fusion"], "imm": {}, "blending": {}, "mine": {"type": "kalman"}, "me": {"type": "shakf"}},
}


@pytest.fixture(scope="module")
def run():
    return testbed.run(MANY)


@pytest.fixture(scope="module")
def figures(run):
    return run_figures(run)


def test_the_figures_of_a_run_with_many_filters(figures):
    assert {"rates", "spectrum", "allan", "bode", "whiteness", "adapted", "profile", "budget"} <= set(figures)
    assert {"sight_curves", "sight_budget"} <= set(figures)
    assert [(name, *pair) for name, figure in figures.items() for pair in confused(figure)] == []


def test_two_runs_side_by_side(run):
    side = Side(run.metrics, digest_run(RunRecord.of(run.groups, run.metrics)), {})
    drawn = _figures(side, side, ("deg/s", 1.0))
    assert [(name, *pair) for name, figure in drawn.items() for pair in confused(figure)] == []


def test_the_curves_of_a_campaign():
    def point(value):
        pair = (value / 2, value, 2 * value)
        bounds = (value / 2, value, 2 * value, value, value / 3, value / 4)
        return Point(0, {"f": value}, 3, *bounds, 1.0, pair, pair, 1, {RESIDUAL: pair})

    points = [point(value) for value in (1.0, 3.0, 10.0, 30.0)]
    sources = [("sensor", "mhd_ars"), ("sensor", "mems_gyro"), *(("filter", name) for name in MANY["fusion"])]
    found = Summary(dict.fromkeys(sources, points), [], [])
    assert list(figures_of(found, {"f": "Hz"})) == ["errors", "sight", "response"]
    panels = [(name, panel) for name, panels, _ in panels_of(found, "f") for panel in panels]
    for _, panel in panels:
        assert {one.name for one in panel.series} >= set(MANY["fusion"])
    assert [(name, *pair) for name, panel in panels for pair in confused_series(panel.series)] == []


def test_sensors_with_thermometers():
    digest = make_digest(["fog", "second", "third"], {})
    thermal = ThermalTrace(envelope_of(np.linspace(290.0, 300.0, 2000)), envelope_of(np.linspace(0.0, 1e-5, 2000)))
    digest = replace(digest, thermal=dict.fromkeys(["fog", "second", "third"], thermal))
    assert confused(thermal_figure(digest, colors_of(digest))) == []


def test_what_ships_and_what_does_not_has_a_mark_of_its_own():
    groups = [*NAMED, *(f"fusion/strange_{i}" for i in range(20)), *(f"sensors/other_{i}" for i in range(12))]
    marks = series_marks(groups)
    pairs = {(group.split("/")[0], mark.dash, mark.marker) for group, mark in marks.items()}
    assert len(pairs) == len(marks) == len(groups) - 2
    # What ships keeps its own beside whatever else there is.
    alone = series_marks(["fusion/shakf"])["fusion/shakf"]
    assert alone[:2] == marks["fusion/shakf"][:2]


def test_the_greys_are_those_of_the_picture(figures):
    """A patch of a colour, drawn and turned into grey, has the grey that is reckoned with."""
    colors = [NAMED["fusion/kalman"], NAMED["sensors/mhd_ars"], NAMED["truth"]]
    for color in colors:
        picture = Image.open(io.BytesIO(figure_bytes(_patch(color), "png"))).convert("L")
        assert picture.getpixel((picture.width // 2, picture.height // 2)) == pytest.approx(grey(color), abs=1)
    # On paper all is dark enough to be seen, and nothing but the ground is white.
    picture = np.asarray(Image.open(io.BytesIO(figure_bytes(figures["spectrum"], "png"))).convert("L"))
    assert picture.min() < 30
    assert np.mean(picture > 250) > 0.5


def _patch(color):
    figure = Figure(figsize=(0.2, 0.2))
    figure.add_axes((0, 0, 1, 1)).set_axis_off()
    figure.axes[0].fill_between([0, 1], [0, 0], [1, 1], color=color)
    figure.axes[0].set(xlim=(0, 1), ylim=(0, 1))
    return figure


def test_a_planted_pair_is_found():
    figure = Figure()
    axes = figure.subplots()
    axes.plot([0, 1], [0, 1], color=NAMED["fusion/kalman"], label="one")
    axes.plot([0, 1], [1, 0], color=NAMED["fusion/shakf"], label="other")
    axes.legend()
    assert ("one", "other") in confused(figure)
