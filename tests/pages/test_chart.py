"""Figures without a drawing library: a point stands where its axis says, and a name is text."""

from __future__ import annotations

import itertools
import re
from xml.etree import ElementTree as ET

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from testbed.pages.chart import ChartLine, Panel, chart
from testbed.pages.palette import _MARKERS, Mark
from testbed.pages.scales import Cells, scale_over
from testbed.pages.shapes import SHAPES, is_open

FULL, CIRCLE = (0, None), Mark((0, None), "o", 0)
NUMBER = r"(-?[\d.]+)"


def series(name="one", color="#2f9e58", **changes):
    x = np.array([1.0, 10.0, 100.0])
    return ChartLine(name, color, FULL, CIRCLE, 1.9, x, np.array([1.0, 10.0, 10.0]))._replace(**changes)


def elements(figure, tag):
    return ET.fromstring(str(figure)).iter(tag)


def points_of(figure, color):
    """Return where the line of a colour goes, piece by piece."""
    (line,) = [
        one for one in elements(figure, "path") if one.get("stroke") == color and one.get("stroke-width") == "1.9"
    ][1:]  # the first one is that of the legend
    pieces = line.get("d").split("M")[1:]
    return [[tuple(map(float, point.split())) for point in piece.split("L")] for piece in pieces]


def text_at(figure, text):
    (found,) = [one for one in elements(figure, "text") if one.text == text]
    return float(found.get("x")), float(found.get("y"))


def test_a_point_stands_at_the_mark_of_its_value():
    """Between those of 1 and 100 is 10; upright, 3.16 is half way from 1 to 10."""
    one = series(x=np.array([1.0, 10.0, 100.0]), y=np.array([2.0, 4.0, 6.0]))
    figure = chart([Panel("y", [one], log=False)], "x", 300.0, log=True)
    ((first, second, third),) = points_of(figure, one.color)
    assert first[0] == text_at(figure, "1")[0]
    assert third[0] == text_at(figure, "100")[0]
    assert second[0] == pytest.approx((first[0] + third[0]) / 2.0, abs=0.1)
    foot = [text_at(figure, text)[1] for text in ("2", "4", "6")]
    assert np.ptp(np.subtract(foot, [first[1], second[1], third[1]])) < 0.15
    assert first[1] > second[1] > third[1]  # up is less


def test_what_is_missing_breaks_the_line():
    values = np.array([1.0, np.nan, 3.0, 4.0, -1.0])
    one = series(x=np.arange(1.0, 6.0), y=values)
    figure = chart([Panel("y", [one], log=True)], "x", 300.0, log=False)
    assert [len(piece) for piece in points_of(figure, one.color)] == [1, 2]


def test_points_that_are_not_joined_have_bars_and_no_line():
    one = series(dash=None, low=np.array([0.5, np.nan, 8.0]), high=np.array([2.0, np.nan, 12.0]))
    figure = chart([Panel("y", [one], log=True)], "x", 300.0, log=True)
    (bars,) = [path for path in elements(figure, "path") if path.get("stroke-opacity") == ".5"]
    assert len(re.findall(f"M{NUMBER} {NUMBER}V{NUMBER}", bars.get("d"))) == 2
    assert not [path for path in elements(figure, "path") if path.get("stroke-width") == "1.9"]
    (marks,) = [path for path in elements(figure, "path") if path.get("d").count(SHAPES["o"]) == 3]
    assert marks.get("fill") == one.color


def test_names_are_text_and_nothing_else():
    figure = chart([Panel("<b>", [series('<script>alert("x")</script>')], log=True)], "a & b", 300.0, log=True)
    said = {one.text for one in elements(figure, "text")}
    assert {"<b>", '<script>alert("x")</script>', "a & b"} <= said
    assert "<script" not in str(figure)


def test_an_interval_is_an_area_around_the_line():
    one = series(low=np.array([0.5, 5.0, 5.0]), high=np.array([2.0, 20.0, 20.0]))
    figure = chart([Panel("y", [one], log=True), Panel("z", [one], log=False)], "x", 400.0, log=True)
    areas = [path for path in elements(figure, "path") if path.get("fill-opacity")]
    assert len(areas) == 2
    corners = np.array(re.findall(f"[ML]{NUMBER} {NUMBER}", areas[0].get("d")), float)
    assert corners.shape == (6, 2)
    # On a logarithmic axis half and twice a value are as far from it.
    alone = chart([Panel("y", [one], log=True)], "x", 400.0, log=True)
    line = np.array(points_of(alone, one.color)[0])
    (area,) = [path for path in elements(alone, "path") if path.get("fill-opacity")]
    low, high = np.split(np.array(re.findall(f"[ML]{NUMBER} {NUMBER}", area.get("d")), float), 2)
    np.testing.assert_allclose(low[:, 1] + high[::-1, 1], 2.0 * line[:, 1], rtol=0, atol=0.2)


@given(
    st.lists(st.floats(1e-9, 1e9), min_size=1, max_size=20),
    st.booleans(),
)
def test_every_value_is_on_the_axis_and_the_marks_rise(values, log):
    scale = scale_over(np.array(values), 60.0, 650.0, log=log)
    assert np.all((scale.place(np.array(values)) >= 60.0) & (scale.place(np.array(values)) <= 650.0))
    marks = [value for value, _ in scale.marks()]
    assert marks == sorted(set(marks))
    assert 2 <= len(marks) <= 13
    assert all(scale.low * (1 - 1e-6) <= value <= scale.high * (1 + 1e-6) for value in marks)
    assert len({text for _, text in scale.marks()}) == len(marks)


def test_marks_are_the_round_values_that_people_expect():
    assert [text for _, text in scale_over(np.array([4.0, 400.0]), 0, 1, log=True).marks()] == ["10", "100"]
    assert [text for _, text in scale_over(np.array([2e-5, 3e-2]), 0, 1, log=True).marks()] == ["10⁻⁴", "10⁻³", "10⁻²"]
    assert [text for _, text in scale_over(np.array([1.0, 5.0]), 0, 1, log=True).marks()] == ["1", "2", "5"]
    assert [text for _, text in scale_over(np.array([-90.0, 30.0]), 0, 1, log=False).marks()] == [
        *("−80", "−60", "−40", "−20", "0", "20"),
    ]
    between = scale_over(np.array([1.0, 30.0]), 0, 1, log=True).between()
    np.testing.assert_allclose(between, [0.9, *range(1, 10), 10, 20, 30])
    assert scale_over(np.array([]), 0.0, 1.0, log=True).marks()[0] == (1.0, "1")


def test_cells_stand_side_by_side():
    steps = Cells(np.array([0.5, 1.0, 2.0, 40.0]), 10.0, 90.0)
    np.testing.assert_allclose(steps.place(np.arange(4)), [20.0, 40.0, 60.0, 80.0])
    assert [text for _, text in steps.marks()] == ["0.5", "1", "2", "40"]
    assert len(Cells(np.arange(100.0), 0.0, 1.0).marks()) == 5


def test_every_mark_has_a_shape_of_its_own_and_is_as_large_as_the_others():
    """Open marks are strokes, solid ones end where they began; none reaches further than 4 from its place."""
    assert {marker for markers in _MARKERS.values() for marker in markers} <= set(SHAPES)
    for (_, one), (_, other) in itertools.combinations(SHAPES.items(), 2):
        assert one != other
    for marker, path in SHAPES.items():
        assert is_open(marker) == (marker in _MARKERS["sensors"] or marker in "_|")
        steps = np.array(re.findall(f"[ml]{NUMBER} {NUMBER}", path), float)
        if marker == "o":
            continue
        reach = np.hypot(*np.cumsum(steps, axis=0).T)
        assert 2.0 < reach.max() < 4.0, marker
