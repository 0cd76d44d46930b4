"""The layout: rows as high as their legends need, tabs by topic where the window is too low, logarithms in decades."""

from __future__ import annotations

import numpy as np
import rerun.blueprint as rrb
from rerun.chunk import RrdReader

from testbed.recording.layout import ENTRY, FRAME, ROOM, _rows
from tests.recording.test_live import rows


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
        np.testing.assert_array_equal(found[:, 1], run.estimates["kalman"][struck])
