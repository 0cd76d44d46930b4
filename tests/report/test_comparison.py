"""Two runs side by side: what differs is found, ratios are those of the metrics, and the page reads."""

from __future__ import annotations

import re
from functools import partial

import pytest

import testbed
from testbed.errors import ScenarioError
from testbed.report.comparison import _differs, write_comparison
from tests.cli.test_grammar import say
from tests.report.browser import BOXES, browser, overlaps
from tests.report.test_within import RUN


@pytest.fixture(scope="module")
def folders(tmp_path_factory):
    place = tmp_path_factory.mktemp("two")
    second = {**RUN, "seed": 6, "fusion": {"kalman": {}, "steady_state": {}}}
    for name, scenario in (("one", RUN), ("other", second)):
        testbed.run(scenario, out=place / name, outputs=("netcdf",))
    return place


@pytest.fixture(scope="module")
def page(folders):
    return write_comparison(folders / "one", folders / "other", folders / "page.html")


def test_differences_of_trees_are_leaves_or_whole_parts():
    a = {"name": "a", "seed": 1, "fusion": {"kalman": {"q": 1.0}, "shakf": {"q": 2.0}}, "motion": [{"sine": 1}, 2]}
    b = {"name": "b", "seed": 1, "fusion": {"kalman": {"q": 3.0}}, "motion": [{"sine": 1}, 4]}
    assert list(_differs(a, b)) == [
        ("fusion.kalman.q", 1.0, 3.0),
        ("fusion.shakf", "there", None),
        ("motion.1", 2, 4),
    ]
    assert list(_differs(a, {**a, "name": "c"})) == []


def test_the_ratio_is_that_of_the_metrics_and_strangers_are_named(folders, page):
    text = page.read_text("utf-8")
    one, other = (testbed.open_run(folders / name).metrics for name in ("one", "other"))
    for name in ("mhd_ars", "mems_gyro", "kalman"):
        row = re.search(rf'<tr data-name="{name}">.*?data-metric="ratio"><data value="([^"]+)"', text)
        assert float(row[1]) == pytest.approx(other.sources[name].rmse_deg_s / one.sources[name].rmse_deg_s, rel=1e-12)
    assert "Only in A: shakf, wideband." in text
    assert "Only in B: steady_state." in text
    assert '<th scope="row">seed</th><td class="text">5</td><td class="text">6</td>' in text


def test_the_command_writes_it_below_runs_and_refuses_what_makes_no_sense(folders, monkeypatch, capsys):
    monkeypatch.chdir(folders)
    words = partial(say, monkeypatch=monkeypatch, capsys=capsys)
    assert words("report", "one", "other")[0] == 0
    assert (folders / "runs" / "one_against_other.html").is_file()
    status, _, told = words("report", "one", "--out", "x.html")
    assert status == 2
    assert "name the second run" in told
    assert words("report", "one", "other", "--figures")[0] == 2
    with pytest.raises(ScenarioError, match="nowhere"):
        write_comparison(folders / "one", folders / "nowhere", folders / "x.html")
    assert not (folders / "x.html").exists()


@pytest.mark.slow
@pytest.mark.parametrize("width", [1200, 390])
def test_nothing_lies_on_anything(page, width):
    with browser() as driver:
        shown = driver.new_page(viewport={"width": width, "height": 900})
        shown.goto(page.as_uri())
        assert "Two runs side by side" in shown.inner_text("h1")
        assert overlaps(shown.evaluate(BOXES)) == []
        assert shown.evaluate("document.documentElement.scrollWidth <= window.innerWidth")
