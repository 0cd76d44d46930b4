"""The folder of an audit: its page, JSON and CSV say the same, and its figures draw what the audit found."""

import csv
import json
from html.parser import HTMLParser

import numpy as np
import pytest

from testbed.compensation.record import GyroRecord
from testbed.drift.figures import drift_figure, gain_figure, residual_allan_figure
from testbed.drift.leak import find_leaks
from testbed.drift.page import Audited, curves, write_audit
from testbed.drift.quality import smoothed
from testbed.drift.records import ThermalRecord
from testbed.drift.summary import audit_summary
from testbed.sensors.noise import GyroNoise
from testbed.signals import sample_times

FS, N_TIME = 0.25, 12_600  # 14 h
DEG_H = np.radians(1.0) / 3600.0
NOISE = GyroNoise(angle_random_walk=np.radians(7.8e-4) / 60.0, bias_instability=1.5e-2 * DEG_H)
NAME = "<b>cycle</b> & co"


def record():
    t = sample_times(0, N_TIME, FS)
    temperature = 293.0 + 30.0 * np.sin(2.0 * np.pi * t / t[-1])
    drift = 0.1 * DEG_H * ((temperature - 293.0) / 30.0) ** 3
    return ThermalRecord(NAME, GyroRecord(drift + NOISE.sample(N_TIME, FS, 7), temperature, FS), drift)


def audited(compensate, *, truth=True, **more):
    thermal = record()
    drift = thermal.drift if truth else None
    plain = compensate(thermal.record)
    thermal = ThermalRecord(thermal.name, thermal.record, drift)
    return Audited("<i>method</i>", thermal, plain, find_leaks(compensate, thermal.record, plain, drift), **more)


def smooth(of):
    """Cut the band: no coefficients, a low-pass beside it, no leak."""
    return smoothed(of.rate, FS, 1.0 / 150.0)


def leaking(of):
    return of.rate - smoothed(of.rate, FS, 1.0 / 1800.0)


@pytest.fixture(scope="module")
def results():
    drift = record().drift
    return {
        "smooth": audited(smooth, extrapolated=0.125, start_distance=12.5, trained_on=("<u>up</u>", "down")),
        "leaking": audited(leaking),
        "oracle": audited(lambda of: of.rate - drift),
        "no truth": audited(leaking, truth=False),
    }


@pytest.fixture(scope="module")
def folders(results, tmp_path_factory):
    top = tmp_path_factory.mktemp("audits")
    return {name: write_audit(result, top / name).parent for name, result in results.items()}


def loaded(folder):
    def refuse(word):
        pytest.fail(f"{word} is no JSON")

    return json.loads((folder / "audit.json").read_text(), parse_constant=refuse)


class Rows(HTMLParser):
    """Collect the numbers of each table row by its heading: the value of <data>, None for a dash; and what is bold."""

    def __init__(self, text):
        super().__init__()
        self.rows, self.tags, self._head = {}, set(), None
        self.feed(text)

    def handle_starttag(self, tag, attrs):
        found = dict(attrs)
        self.tags.add(tag)
        self._head = "" if found.get("scope") == "row" else self._head
        if tag == "data":
            self.rows[self._key].append(float(found["value"]))
        elif found.get("class") == "none" and tag == "span":
            self.rows[self._key].append(None)

    def handle_endtag(self, tag):
        if tag == "th" and self._head is not None:
            self._key, self._head = self._head, None
            self.rows[self._key] = []

    def handle_data(self, data):
        if self._head is not None:
            self._head += data


def quality_row(quality):
    shown = [quality["block_std_100s_deg_h"], quality["allan_deviation_1h_deg_h"]]
    if quality["coefficients"] is None:
        return [*shown, None, None, None]
    terms = (quality["coefficients"][letter] for letter in "QNB")
    return [*shown, *(term["upper"] if term["value"] is None else term["value"] for term in terms)]


@pytest.mark.parametrize("name", ["smooth", "leaking", "oracle", "no truth"])
def test_the_numbers_of_the_page_are_those_of_the_json(folders, name):
    found, rows = loaded(folders[name]), Rows((folders[name] / "audit.html").read_text()).rows
    for key, label in (
        ("before", "before"),
        ("after", "compensated"),
        ("low_passed", "low-pass of the same bandwidth"),
        ("oracle", "oracle: true drift removed"),
    ):
        assert rows.get(label) == (None if found[key] is None else quality_row(found[key]))
    for key, label in (
        ("oracle_ratio_1h", "Allan deviation at 1 h over that of the oracle"),
        ("block_std_over_oracle", "std of 100 s means over that of the oracle"),
        ("least_gain_in_drift_band", "least gain of a slow true rate"),
        ("step_gain", "gain of a step of true rate"),
        ("earth_rate_gain", "gain of Earth-rate steps"),
        ("temperature_rate_gain", "gain of a true rate that follows temperature"),
        ("bandwidth_hz", "bandwidth left [Hz]"),
    ):
        expected = [] if key == "bandwidth_hz" and found[key] is None else [found[key]]
        assert rows.get(label) == (None if found["oracle"] is None and "oracle" in label else expected)
    # As the paper prints them: N, B.
    assert rows["paper 3, Table 2: original"] == [7.8034e-4, 1.5323e-2]
    assert rows["paper 3, Table 2: paper's pipeline"] == [7.2110e-6, 1.1504e-4]
    share = rows.get("samples flagged as outside the trained temperatures and slopes [%]")
    assert share == ([12.5] if name == "smooth" else None)
    far = "from its first temperature to the nearest start of a training cycle [K]"
    assert rows.get(f"{far}: too far, its first hours are compensated worse") == share
    assert (found["start_distance_k"], found["starts_elsewhere"]) == (
        (12.5, True) if name == "smooth" else (None, None)
    )


def test_what_is_unknown_or_infinite_is_null(folders, results):
    """The oracle leaves no drift, so its reduction is infinite, which JSON cannot hold; a text file knows no drift at
    all.
    """
    assert results["oracle"].audit.drift_reduction == np.inf
    assert loaded(folders["oracle"])["drift_reduction"] is None
    without = loaded(folders["no truth"])
    assert [without[key] for key in ("oracle", "drift_reduction", "oracle_ratio_1h", "block_std_over_oracle")] == [
        None
    ] * 4
    # Seconds and four samples a period: the shortest sine at 0.25 Hz has 20 s.
    assert loaded(folders["smooth"])["gains"][0]["period_s"] == 20.0
    assert loaded(folders["smooth"])["after"]["coefficients"] is None
    # The low-pass loses short periods, which is no loss in the drift band.
    assert min(line["gain"] for line in loaded(folders["smooth"])["gains"]) < 0.1
    assert loaded(folders["smooth"])["least_gain_in_drift_band"] > 0.95


def test_the_verdict_stands_on_page_and_in_json(folders):
    sentences = {
        "oracle": "No leak was found: slow true rate survives",
        "smooth": "No leak was found, but this is no compensation of the drift",
        "leaking": "This result is a leak",
        "no truth": "This result is a leak",
    }
    for name, sentence in sentences.items():
        found, page = loaded(folders[name]), (folders[name] / "audit.html").read_text()
        assert found["passed"] is (name == "oracle")
        assert bool(found["excess"]) is (name == "smooth")
        assert bool(found["leaks"]) is (name in {"leaking", "no truth"})
        for other in set(sentences.values()):
            assert (other in page) is (other == sentence)
        assert all(finding in page for finding in found["leaks"] + found["excess"])


def test_names_are_escaped(folders):
    page = (folders["smooth"] / "audit.html").read_text()
    for name in (NAME, "<i>method</i>", "<u>up</u>"):
        assert name not in page
    assert "&lt;b&gt;cycle&lt;/b&gt; &amp; co" in page
    assert "Trained on: &lt;u&gt;up&lt;/u&gt;; down" in page
    assert not Rows(page).tags & {"i", "u", "script"}


def test_the_page_reads_on_light_and_on_dark(folders):
    """Text and axes take the page's colour, and the page asks the reader's system for its own."""
    page = (folders["leaking"] / "audit.html").read_text()
    assert "prefers-color-scheme: dark" in page
    figures = [part.split("</svg>")[0] for part in page.split("<svg")[1:]]
    assert len(figures) == 3
    for figure in figures:
        assert "currentColor" in figure
        assert not {"#000000", "#010203", "#ffffff", "NaN"} & set(figure.replace(";", " ").replace('"', " ").split())


def test_the_tables_as_text_hold_the_curves_and_the_gains(folders, results):
    result, folder = results["smooth"], folders["smooth"]
    with (folder / "gains.csv").open(newline="") as file:
        rows = [tuple(map(float, row.values())) for row in csv.DictReader(file)]
    assert rows == [(line.period, line.gain, line.phase) for line in result.audit.gains]
    with (folder / "allan.csv").open(newline="") as file:
        lines = list(csv.DictReader(file))
    for name, quality in curves(result.audit).items():
        mine = [line for line in lines if line["record"] == name]
        values = np.array([[float(line[key]) for key in ("tau_s", "deviation_deg_h", "upper_deg_h")] for line in mine])
        expected = (quality.curve.tau, quality.curve.deviation / DEG_H, quality.curve.upper / DEG_H)
        np.testing.assert_allclose(values, np.stack(expected, axis=1), rtol=1e-8)
    assert {line["record"] for line in lines} == {"record", "compensated", "equal low-pass", "oracle"}


def test_a_folder_is_written_again_the_same(results, tmp_path):
    first = {path.name: path.read_bytes() for path in write_audit(results["smooth"], tmp_path).parent.iterdir()}
    second = {path.name: path.read_bytes() for path in write_audit(results["smooth"], tmp_path).parent.iterdir()}
    assert first == second
    assert set(first) == {"audit.json", "audit.html", "gains.csv", "allan.csv"}


def lines_of(axes):
    return {line.get_label(): line.get_xydata() for line in axes.get_lines()}


def test_the_gains_are_drawn_and_the_low_pass_is_3_db_down_at_its_bandwidth(results):
    found = results["smooth"].audit
    lines = lines_of(gain_figure(found).axes[0])
    np.testing.assert_array_equal(lines["sines"], [(line.period, line.gain) for line in found.gains])
    period, gain = lines["equal low-pass"].T
    assert np.interp(1.0 / found.bandwidth_hz, period, gain) == pytest.approx(np.sqrt(0.5), abs=0.01)
    np.testing.assert_array_equal(lines["step"][:, 1], found.step_gain)
    np.testing.assert_array_equal(lines["Earth-rate steps"][:, 1], found.earth_gain)
    np.testing.assert_array_equal(lines["rate that follows T"][:, 1], found.heat_gain)


def test_a_curve_without_coefficients_is_drawn_without_a_fit(results):
    found = results["smooth"].audit
    axes = residual_allan_figure(curves(found)).axes[0]
    circles = [line for line in axes.get_lines() if line.get_linestyle() == "None"]
    described = [quality for quality in curves(found).values() if quality.fit is not None]
    assert len(circles) == len(described) == 2  # record and oracle
    label = "compensated (no Q, N, B: the noise model does not describe it)"
    np.testing.assert_allclose(lines_of(axes)[label][:, 1], found.after.curve.deviation / DEG_H, rtol=1e-12)
    # The fitted sum follows the curve that it describes: 30 % is five standard deviations of 30 means.
    for circle, quality in zip(circles, described, strict=True):
        tau, fitted = circle.get_xydata().T
        early = tau < 1000.0
        measured = np.interp(tau[early], quality.curve.tau, quality.curve.deviation / DEG_H)
        np.testing.assert_allclose(fitted[early], measured, rtol=0.3)


def test_the_drift_is_drawn_in_hours_and_degrees_per_hour(results):
    result = results["leaking"]
    axes = drift_figure(result.thermal.record, result.compensated, result.thermal.drift).axes
    hours, removed = lines_of(axes[0])["removed"].T
    blocks = (result.thermal.record.rate - result.compensated).reshape(-1, 25).mean(axis=1) / DEG_H
    np.testing.assert_allclose(removed, blocks - blocks.mean(), atol=1e-12)
    # Of 25 samples in 100 s the mean is 12 samples, 48 s, after the first.
    np.testing.assert_allclose(hours, (48.0 + 100.0 * np.arange(504)) / 3600.0, rtol=1e-12)
    warm = axes[2].get_lines()[0].get_ydata()
    assert [warm.min(), warm.max()] == pytest.approx([-10.15, 49.85], abs=0.01)
    assert "true drift" in lines_of(axes[0])
    assert "true drift" not in lines_of(drift_figure(result.thermal.record, result.compensated).axes[0])


def test_the_summary_is_in_the_units_of_its_keys(results):
    """Against the SI figures of the audit, converted by hand: 1 deg/h = 4.848e-6 rad/s, 1 deg/sqrt(h) = 2.909e-4
    rad/sqrt(s).
    """
    found, figures = results["oracle"].audit, audit_summary(results["oracle"].audit)
    assert figures["before"]["block_std_100s_deg_h"] == pytest.approx(found.before.block_std / 4.84813681e-6, rel=1e-8)
    coefficients = figures["before"]["coefficients"]
    assert coefficients["N"]["unit"] == "deg/sqrt(h)"
    assert coefficients["N"]["value"] == pytest.approx(
        found.before.fit.angle_random_walk.value / 2.90888209e-4, rel=1e-8
    )
    assert coefficients["B"]["unit"] == "deg/h"
    assert coefficients["B"]["value"] == pytest.approx(
        found.before.fit.bias_instability.value / 4.84813681e-6, rel=1e-8
    )
