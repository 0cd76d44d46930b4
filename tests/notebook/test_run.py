"""A run shows itself: one line, a table, figures, its signals for other libraries; it copies and pickles."""

from __future__ import annotations

import copy
import json
import pickle
import re
import tomllib
from pathlib import Path

import numpy as np
import pytest
import xarray as xr
from matplotlib.figure import Figure

import testbed
from testbed.notebook.tables import INSTALL
from testbed.runs.metrics import RunMetrics
from tests.scenes import short


@pytest.fixture(scope="module")
def pair(tmp_path_factory):
    """Run the same scenario in memory and to disk, with lost readings."""
    folder = tmp_path_factory.mktemp("face")
    scenario = short(folder, ("preset: adis16505_filtered", "preset: adis16505_filtered, dropped: 10 %"))
    return testbed.run(scenario), testbed.run(scenario, out=folder / "run")


@pytest.fixture(params=["memory", "disk"])
def run(request, pair):
    return pair[request.param == "disk"]


def test_one_line_says_what_was_run_and_how_good_it_was(run):
    text = repr(run)
    rmse = run.metrics.fusion["kalman"].rmse_deg_s
    assert "\n" not in text
    assert len(text) < 300
    assert text.startswith("<Run short, 0.5 s, seed 11; ")
    assert f"kalman {rmse:.4g} deg/s" in text
    assert (str(run.folder) in text) == (run.folder is not None)


def test_the_table_of_a_notebook_has_a_row_for_every_source(run):
    page = run._repr_html_()
    rows = re.findall(r"<tr><th>(\w+)</th><td>([^<]*)</td>", page)
    errors = {name: source.rmse_deg_s for name, source in run.metrics.sources.items()}
    assert dict(rows) == {name: f"{error:.4g}" for name, error in errors.items()}
    assert "expected kalman rmse_deg_s &lt; 1: met" in page


def test_a_name_in_the_table_is_text_and_no_markup(pair):
    evil = "<script>"
    metrics = RunMetrics.model_validate({**pair[0].metrics, "scenario": evil, "fusion": {evil: {"rmse_deg_s": 1.0}}})
    from testbed.notebook.page import error_page

    assert evil not in error_page(metrics)


def test_the_figures_are_those_of_the_report(run):
    figures = run.plot()
    assert list(figures) == [
        "rates",
        "errors",
        "spectrum",
        "allan",
        "bode",
        "whiteness",
        "adapted",
        "profile",
        "budget",
    ]
    assert all(isinstance(figure, Figure) and figure.axes for figure in figures.values())
    assert [axes.get_title(loc="left")[:6] for axes in figures["errors"].axes] == ["kalman", "arw_sh"]


def test_a_notebook_shows_the_figures_and_two_cells_do_not_mix(pair):
    figures, others = pair[0].plot(), pair[1].plot()
    page, other = figures._repr_html_(), others._repr_html_()
    assert page.count("<svg") == len(figures) == 9
    ids, more = (set(re.findall(r'\bid="([^"]+)"', text)) for text in (page, other))
    assert ids
    assert not ids & more


def test_the_tree_has_units_names_and_the_signals(run):
    tree = run.to_xarray()
    assert isinstance(tree, xr.DataTree)
    assert tree.attrs["Conventions"].startswith("CF-")
    assert {node.path for node in tree.leaves} == {
        "/commanded", "/truth", "/sensors/mhd_ars", "/sensors/mems_gyro", "/fusion/kalman", "/fusion/arw_shakf",
    }  # fmt: skip
    for node in tree.leaves:
        assert node.time.attrs["units"] == "s"
        for variable in node.data_vars.values():
            assert variable.attrs["units"]
            assert variable.attrs["long_name"]
            assert variable.dims == ("time",)
    assert np.array_equal(tree["sensors/mems_gyro/rate"].values, run.sensors["mems_gyro"].rate, equal_nan=True)
    # One line of a notebook: the rms error of a filter, aligned by time.
    error = (tree["fusion/kalman/rate"] - tree["truth/rate"]).sel(time=slice(0.2, None))
    assert np.rad2deg(np.sqrt((error**2).mean())) == pytest.approx(run.metrics.fusion["kalman"].rmse_deg_s, rel=1e-9)


def test_the_tree_in_memory_is_the_one_on_disk(pair):
    memory, disk = (run.to_xarray() for run in pair)
    assert memory.attrs == disk.attrs
    for node in disk.leaves:
        kept = memory[node.path].dataset
        assert kept.attrs == node.attrs
        assert set(kept.variables) == set(node.dataset.variables)
        for name, variable in node.dataset.variables.items():
            assert kept.variables[name].attrs == variable.attrs
            values = kept.variables[name].values.astype(variable.dtype)
            assert np.array_equal(values, variable.values, equal_nan=True), (node.path, name)


def test_the_frame_has_a_row_per_source_and_the_numbers_of_metrics_json(run):
    frame = run.to_pandas()
    assert list(frame.index) == ["mhd_ars", "mems_gyro", "kalman", "arw_shakf"]
    assert frame.index.name == "source"
    for name, source in run.metrics.sources.items():
        assert frame.loc[name, "rmse_deg_s"] == source.rmse_deg_s
    assert frame.loc["mems_gyro", "missing"] == np.count_nonzero(np.isnan(run.sensors["mems_gyro"].rate[400:]))
    assert np.isnan(frame.loc["mems_gyro", "mean_std_deg_s"])


@pytest.mark.parametrize("method", ["to_xarray", "to_pandas"])
def test_without_the_extra_the_error_says_how_to_install_it(pair, monkeypatch, method):
    def missing(name):
        raise ImportError(name)

    monkeypatch.setattr("testbed.notebook.tables.import_module", missing)
    with pytest.raises(ImportError, match=re.escape(f"is not installed; install it with: {INSTALL}")):
        getattr(pair[0], method)()


def test_the_line_that_installs_names_this_distribution_and_its_extra():
    project = tomllib.loads((Path(__file__).parents[2] / "pyproject.toml").read_text())["project"]
    assert f"pip install '{project['name']}[notebook]'" == INSTALL
    assert {line.split(">")[0] for line in project["optional-dependencies"]["notebook"]} == {
        "duckdb",
        "pandas",
        "xarray",
    }


@pytest.mark.parametrize("way", [copy.copy, copy.deepcopy, lambda run: pickle.loads(pickle.dumps(run))])
def test_a_run_and_its_signals_copy_and_pickle(run, way, monkeypatch, tmp_path):
    twin, truth = way(run), way(run.truth)
    monkeypatch.chdir(tmp_path)  # what is on disk is found from anywhere
    assert repr(twin) == repr(run)
    assert twin.metrics == run.metrics
    assert type(twin.metrics) is RunMetrics
    assert np.array_equal(twin.fusion["kalman"].rate, run.fusion["kalman"].rate)
    assert np.array_equal(truth.angle, run.truth.angle)
    assert truth.units == run.truth.units
    if run.folder is None:
        assert not twin.truth.rate.flags.writeable


def test_signals_carry_their_units(run):
    assert run.truth.units["angle"] == "rad"
    assert run.fusion["kalman"].units["std"] == run.sensors["mhd_ars"].units["rate"] == "rad/s"
    assert run.fusion["arw_shakf"].units["R_mems_gyro"] == "rad^2/s^2"
    assert "rate [rad/s]" in repr(run.truth)
    assert run.sensors["mems_gyro"].sample_rate_hz == 2000.0


def test_part_of_a_signal_is_read_alone(run):
    assert np.array_equal(run.truth.read("rate", 10, 20), run.truth.rate[10:20])
    with pytest.raises(KeyError):
        run.truth.read("ratte")


def test_metrics_are_typed_and_go_on_as_a_mapping(pair):
    memory, disk = pair
    metrics = memory.metrics
    assert metrics.fusion["kalman"].rmse_deg_s == metrics["fusion"]["kalman"]["rmse_deg_s"]
    assert metrics.fusion["kalman"].lines[0].gain == metrics["fusion"]["kalman"]["lines"][0]["gain"]
    stored = json.loads((disk.folder / "metrics.json").read_text())
    assert stored == metrics == disk.metrics
    assert json.loads(json.dumps(metrics.to_dict(), allow_nan=False)) == stored
    assert list(stored) == list(metrics)


def test_a_key_that_metrics_json_does_not_hold_is_no_key_but_none_as_an_attribute(pair):
    sensor = pair[0].metrics.sensors["mhd_ars"]
    assert sensor.mean_std_deg_s is None
    assert "mean_std_deg_s" not in sensor
    assert sensor.get("mean_std_deg_s", "nothing") == "nothing"
    with pytest.raises(KeyError):
        sensor["mean_std_deg_s"]
