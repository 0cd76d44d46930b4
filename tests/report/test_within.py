"""What happened inside the filters: figures and page show what the run has."""

from __future__ import annotations

import numpy as np
import pytest

import testbed
from testbed.report import run_figures
from testbed.report.bode import bode_figure
from testbed.report.digest import digest_run
from testbed.runs.results import RunRecord

RUN = {
    "name": "inside",
    "seed": 5,
    "duration": "2 s",
    "settle": "1 s",
    "turntable": {"engine": "modal"},
    "motion": [{"sine": {"frequency": "80 Hz", "rate": "1 deg/s"}}],
    "sensors": {"mhd_ars": {"preset": "sx300"}, "mems_gyro": {"preset": "adis16505_filtered"}},
    "fusion": {"kalman": {"belief": "eq39"}, "shakf": {}, "wideband": {}},
}


@pytest.fixture(scope="module")
def run(tmp_path_factory):
    folder = tmp_path_factory.mktemp("inside") / "run"
    testbed.run(RUN, out=folder, outputs=("netcdf",))
    return RunRecord.open(folder)


@pytest.fixture(scope="module")
def figures(run):
    return run_figures(run)


def test_correlations_are_those_of_the_stored_innovations(run):
    found = digest_run(run).correlations["mems_gyro"]["kalman"]
    signals = run.fusion["kalman"]
    late = signals.time >= 1.0
    e, c = (signals[name][late].astype(float) for name in ("innovation_mems_gyro", "innovation_variance_mems_gyro"))
    nu = (e / np.sqrt(c))[np.isfinite(e)]
    assert found.n == nu.size
    wanted = [nu[lag:] @ nu[:-lag] / (nu @ nu) for lag in range(1, 41)]
    np.testing.assert_allclose(found.values, wanted, rtol=1e-9, atol=1e-12)


def test_only_what_adapts_is_drawn_and_variances_have_decades(run, figures):
    adapted = digest_run(run).adapted
    assert {name for by_filter in adapted.values() for name in by_filter} == {"shakf", "wideband"}
    assert set(adapted["R_mhd_ars"]) == set(adapted["R_mems_gyro"]) == {"shakf"}
    assert {axes.get_yscale() for axes in figures["adapted"].axes} == {"log"}


def test_the_frequency_that_the_sensors_see_is_drawn_in_hertz(run, figures):
    """80 Hz, from the MHD ARS to its noise: 1 deg/s over some 0.01 deg/s of it, a second of means."""
    assert run.fusion["wideband"].units["frequency_mhd_ars"] == "Hz"
    assert run.fusion["wideband"].frequency_mhd_ars[-1] == pytest.approx(80.0, rel=1e-2)
    (axes,) = [axes for axes in figures["adapted"].axes if axes.get_title(loc="left").endswith("seen by mhd_ars")]
    assert axes.get_ylabel() == "Hz"
    drawn = np.concatenate([part.vertices[:, 1] for part in axes.collections[0].get_paths()])
    assert np.min(np.abs(drawn - 80.0)) < 0.8


def test_responses_are_those_of_the_parts_and_of_the_belief(run):
    responses = run.metrics.responses
    gain = dict(zip(responses.frequency_hz, responses.sensors["mhd_ars"].gain, strict=False))
    wanted = abs(testbed.load_preset("sx300").response([10.0]))[0]
    assert gain[10.0] == pytest.approx(wanted, rel=1e-5)
    assert len(responses.sensors["mems_gyro"].gain) < len(responses.sensors["mhd_ars"].gain)
    assert responses.beliefs[0].filters[0] == "kalman"
    assert responses.beliefs[0].sensors["mhd_ars"].gain != responses.sensors["mhd_ars"].gain


def test_the_line_of_the_bode_plot_is_that_of_the_least_squares(run):
    """Two independent estimates of one line; the noise of the gyro moves either by some thousandths."""
    for group, transfer in digest_run(run).transfers.items():
        (line,) = run.metrics.sources[group.split("/")[1]].lines
        (k,) = np.flatnonzero(transfer.freq_hz == 80.0)
        assert abs(transfer.response[k]) == pytest.approx(line.gain, rel=1e-2)
        assert np.degrees(np.angle(transfer.response[k])) == pytest.approx(line.phase_deg, abs=0.6)


def test_the_bode_plot_has_gain_phase_and_coherence_but_at_rest(figures, run):
    assert [axes.get_ylabel() for axes in figures["bode"].axes] == ["gain", "phase [deg]", "coherence"]
    still = bode_figure(run.metrics, {}, dict.fromkeys(digest_run(run).transfers, "k"))
    assert [axes.get_ylabel() for axes in still.axes] == ["gain", "phase [deg]"]
    assert still.axes[-1].get_xlabel() == "frequency [Hz]"
    assert [axes.get_title(loc="left") for axes in figures["whiteness"].axes] == [
        "innovations of mhd_ars",
        "innovations of mems_gyro",
    ]
