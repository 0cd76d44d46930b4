"""The layout: rows as high as their legends need, tabs by topic where the window is too low, logarithms in decades."""

from __future__ import annotations

import re

import numpy as np
import pytest
import rerun.blueprint as rrb
from rerun.chunk import RrdReader

from testbed.recording.layout import DIAGNOSTICS, ENTRY, FRAME, ROOM, _rows, blueprint
from testbed.recording.stream import Clock
from testbed.scenario.loader import load_scenario
from testbed.units import PER_RATE
from tests.recording.test_live import rows
from tests.scenario.test_loader import SCENARIOS


def row(name, n_lines):
    return name, [rrb.TimeSeriesView(name=name)], n_lines


def test_a_row_is_as_high_as_its_legend_needs():
    """Seven names and three, as a run of three filters has them, fit into a window of 900 points."""
    found = _rows([row("a", 7), row("b", 7), row("c", 3), row("d", 3)])
    assert list(found.row_shares) == [FRAME + 7 * ENTRY] * 2 + [FRAME + 3 * ENTRY] * 2
    assert sum(found.row_shares) <= ROOM


def test_where_the_window_is_too_low_the_topics_are_tabs():
    found = _rows([row("a", 12), row("b", 12), row("c", 8), row("d", 8), row("e", 1)])
    assert len(found.contents) == 3
    topics = found.contents[2]
    assert isinstance(topics, rrb.Tabs)
    assert [view.name for view in topics.contents] == ["c", "d", "e"]


def test_what_spans_decades_is_there_as_its_logarithm_too(synthetic_run, tmp_path):
    run = synthetic_run(30_000, filters=("kalman",))
    path = run.record(tmp_path / "r.rrd")
    plain, log = (rows(path, f"/fusion/kalman/{name}") for name in ("R_mhd_ars", "log10_R_mhd_ars"))
    assert np.array_equal(plain[:, 0], log[:, 0])
    np.testing.assert_array_equal(log[:, 1], np.log10(plain[:, 1]))
    names = {chunk.entity_path for chunk in RrdReader(path).stream()}
    assert "/fusion/kalman/log10_innovation_mems_gyro" not in names


def test_readings_that_were_struck_out_are_marked_on_the_filters_line(synthetic_run, tmp_path):
    """Three rises of the count, one at the first sample of a block; however the run is cut."""
    run = synthetic_run(30_000, filters=("kalman",))
    struck = np.array([5, 10_000, 22_222])
    run.diagnostics["gated_mhd_ars"] = np.searchsorted(struck, np.arange(run.n_time), side="right").astype(float)
    for size in (10_000, 7_777):
        path = run.record(tmp_path / f"{size}.rrd", size)
        found = rows(path, "/fusion/kalman/struck_mhd_ars")
        np.testing.assert_array_equal(found[:, 0], struck * 50_000)
        np.testing.assert_array_equal(found[:, 1], PER_RATE["deg/s"] * run.estimates["kalman"][struck])


@pytest.mark.parametrize("path", SCENARIOS, ids=lambda path: path.stem)
def test_the_views_of_every_shipped_scenario_have_the_unit_of_its_report(path):
    """deg/h of the gyro in its thermal chamber, deg/s of all others; nothing of the program's own rad/s."""
    scenario = load_scenario(path)
    unit = scenario.rate_unit
    assert unit == ("deg/h" if path.parent.name == "fog" and path.stem != "fused" else "deg/s")
    shown = blueprint(
        entities=dict.fromkeys(entities_of(scenario)),
        sensors=list(scenario.sensors),
        filters=list(scenario.fusion),
        channels=["mhd_ars"],
        model=None,
        clock=Clock(scenario.base_rate_hz, scenario.n_time, scenario.detail),
        unit=unit,
    )
    names = list(titles(shown.root_container))
    assert f"Rate, whole run [{unit}]" in names
    assert not [name for name in names if "rad/s" in name]
    assert {unit} == {found for name in names for found in re.findall(r"\bdeg/\w+", name)}


def entities_of(scenario):
    """Return the paths of everything that a recording of it may hold."""
    sensors, filters = list(scenario.sensors), list(scenario.fusion)
    diagnostics = [kind + sensor for kind in DIAGNOSTICS for sensor in sensors if kind]
    return [
        *("/commanded/rate", "/truth/rate", *(f"/sensors/{name}/rate" for name in sensors)),
        *(f"/sensors/{name}/temperature" for name in sensors),
        *(f"/truth/{name}/drift" for name in sensors),
        *(f"/pointing/{name}/residual" for name in filters),
        *(f"/fusion/{name}/{what}" for name in filters for what in ("rate", "error", "std", *diagnostics)),
    ]


def titles(part):
    """Yield the name of every view and container below a part of the layout."""
    yield from filter(None, [getattr(part, "name", None)])
    for inner in getattr(part, "contents", []):
        if not isinstance(inner, str):
            yield from titles(inner)


def plots(*, live=False, **extremes):
    """Return the plots of a run by their title; extremes of its signals after settle by name and diagnostic."""
    entities = {f"/fusion/{name.replace('__', '/')}": found for name, found in extremes.items()}
    shown = blueprint(
        entities=entities,
        sensors=["mhd_ars"],
        filters=sorted({entity.split("/")[2] for entity in entities}),
        channels=[],
        model=None,
        clock=Clock(20e3, 400_000, (10.0, 12.0)),
        unit="deg/s",
        live=live,
    )
    return {view.name: view for view in views(shown.root_container)}


def views(part):
    """Yield every view below a part of the layout."""
    if isinstance(part, rrb.View):
        yield part
    for inner in getattr(part, "contents", []):
        if not isinstance(inner, str):
            yield from views(inner)


def scale(view):
    """Return the ends of the upright axis, None where the viewer finds them."""
    axis = view.properties.get("ScalarAxis")
    return None if axis is None else tuple(axis.range.as_arrow_array().to_pylist()[0])


def test_errors_stand_beside_each_other_in_one_scale_but_for_one_that_would_be_flat():
    found = plots(a__error=(-2.0, 1.0), b__error=(-0.6, 0.9), c__error=(-0.1, 0.1))
    assert {f"Error of {name} [deg/s]" for name in "abc"} <= set(found)
    # 5 % of the span of 4 at each end.
    assert scale(found["Error of a [deg/s]"]) == scale(found["Error of b [deg/s]"]) == pytest.approx((-2.2, 2.2))
    assert scale(found["Error of c [deg/s]"]) is None
    assert found["Error of a [deg/s]"].contents == ["/fusion/a/error"]


def test_who_looks_on_sees_the_last_seconds_instead_of_what_has_not_come_yet():
    watched, kept = plots(live=True, a__rate=None), plots(a__rate=None)
    assert set(watched) - set(kept) == {"Rate, the last 2 s [deg/s]"}
    assert set(kept) - set(watched) == {"Rate ±50 ms at the cursor [deg/s]"}


def test_the_start_sets_no_scale_but_that_of_counts_and_logarithms():
    found = plots(w__frequency_mhd_ars=(9.0, 11.0), w__log10_R_mhd_ars=(-6.0, -5.0), w__gated_mhd_ars=(3.0, 7.0))
    assert scale(found["Frequency that is seen, mhd_ars [Hz]"]) == pytest.approx((8.9, 11.1))
    assert scale(found["Adapted R, mhd_ars [log10 of (deg/s)²]"]) is None
    assert scale(found["Gated readings, mhd_ars [counted]"]) is None


def test_the_names_of_all_diagnostics_stand_in_one_row_of_tabs():
    """Three fifths of a window of 1600 points; a letter takes at most 8 of them, icon and space 36."""
    names = {tab for tab, _, _ in DIAGNOSTICS.values()}
    assert sum(8 * len(name) + 36 for name in names) <= 0.6 * 1600
