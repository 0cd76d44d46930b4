"""The report of a run: its numbers are those of metrics.json, its figures those of run.nc, it is never half there."""

from __future__ import annotations

import json
import re
import tracemalloc
from html.parser import HTMLParser
from typing import TYPE_CHECKING, Any

import h5netcdf
import numpy as np
import pytest

import testbed
from testbed.errors import ScenarioError
from testbed.pages.numbers import fixed, significant
from testbed.report import run_figures, save_figures, write_report
from testbed.report.digest import digest_run, zoom_window
from testbed.runs.manifest import strangers
from testbed.runs.metrics import RunMetrics
from testbed.runs.results import RunRecord

if TYPE_CHECKING:
    from pathlib import Path

SMALL = {
    "name": "small",
    "duration": "0.4 s",
    "settle": "0.2 s",
    "motion": [{"sine": {"frequency": "10 Hz", "rate": "1 deg/s"}}],
    "sensors": {"mhd_ars": {"preset": "sx300"}, "mems_gyro": {"preset": "adis16505_filtered"}},
    "fusion": {"kalman": {}},
}
BASE_HZ, GYRO_HZ = 20000.0, 2000.0


def put(file: h5netcdf.File, group: str, sample_rate_hz: float, **variables: np.ndarray) -> None:
    """Write one group as the run folder documents it."""
    target = file.create_group(group)
    n_time = next(iter(variables.values())).size
    target.dimensions = {"time": n_time}
    time = target.create_variable("time", ("time",), data=np.arange(n_time) / sample_rate_hz)
    time.attrs["units"] = "s"
    for name, values in variables.items():
        variable = target.create_variable(
            name, ("time",), data=values, compression="gzip", compression_opts=1, chunks=(min(n_time, 20000),)
        )
        variable.attrs["units"] = "rad" if name == "angle" else "rad/s"


def source(rmse: float | None, **more: Any) -> dict[str, Any]:
    lines = [
        {"frequency_hz": 0.5, "gain": 0.19743, "phase_deg": 78.43},
        {"frequency_hz": 10.0, "gain": 0.98312, "phase_deg": -13.9117},
    ]
    return {"rmse_deg_s": rmse, "rmse_aligned_deg_s": 0.0021234, "floor_rmse_deg_s": None, "lines": lines} | more


def metrics_of(
    duration_s: float, settle_s: float, filters: tuple[str, ...] = ("kalman", "shakf", "arw_shakf")
) -> dict[str, Any]:
    fusion = {
        name: source(
            0.00234567 * 1.1**i,
            floor_rmse_deg_s=0.0011111,
            optimum_rmse_deg_s=None,
            mean_std_deg_s=0.0024,
            guard_hits=17,
        )
        for i, name in enumerate(filters)
    }
    return {
        "scenario": "mixed_0p5hz_10hz",
        "seed": 2024,
        "duration_s": duration_s,
        "settle_s": settle_s,
        "bandwidth_hz": 1000.0,
        "versions": {"testbed": "0.1.0", "mujoco": "4.0.1"},
        "sensors": {"mhd_ars": source(0.56512), "mems_gyro": source(0.0315)},
        "fusion": fusion,
        "expectations": [
            {"subject": name, "metric": "rmse_deg_s", "bound": "< 0.0143", "value": 0.00234567, "met": True}
            for name in filters[:1]
        ],
    }


def make_run(folder: Path, metrics: dict[str, Any], *, noise: float = 4e-5) -> Path:
    """Write a run folder: two sines, a high-pass-like and a noisy sensor, filters with white errors of std `noise`."""
    rng = np.random.default_rng(7)
    n = round(metrics["duration_s"] * BASE_HZ)
    t = np.arange(n) / BASE_HZ
    rate = np.radians(1.0) * np.sin(np.pi * t) + np.radians(0.18) * np.sin(20 * np.pi * t)
    folder.mkdir(parents=True)
    with h5netcdf.File(folder / "run.nc", "w") as file:
        put(file, "commanded", BASE_HZ, rate=rate)
        put(file, "truth", BASE_HZ, rate=rate, angle=np.cumsum(rate) / BASE_HZ)
        slow = 0.4 * np.radians(1.0) * np.sin(np.pi * t + 0.9)
        put(file, "sensors/mhd_ars", BASE_HZ, rate=rate - slow + 1e-5 * rng.standard_normal(n))
        coarse = rate[::10]
        put(file, "sensors/mems_gyro", GYRO_HZ, rate=coarse + 2e-4 * rng.standard_normal(coarse.size))
        for i, name in enumerate(metrics["fusion"]):
            error = noise * 1.3**i * rng.standard_normal(n) + 3e-3 * np.exp(-t / 0.3)
            put(file, f"fusion/{name}", BASE_HZ, rate=rate + error, std=np.full(n, noise))
    (folder / "metrics.json").write_text(json.dumps(metrics), encoding="utf-8")
    (folder / "scenario.yaml").write_text("name: mixed_0p5hz_10hz\nduration: 3 s\n", encoding="utf-8")
    return folder


@pytest.fixture(scope="module")
def run(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return make_run(tmp_path_factory.mktemp("runs") / "mixed", metrics_of(3.0, 1.0))


@pytest.fixture(scope="module")
def page(run: Path) -> str:
    return write_report(run).read_text(encoding="utf-8")


class Tables(HTMLParser):
    """Reads back the numbers: (kind, name, metric) -> exact value and the text that is shown."""

    def __init__(self, page: str) -> None:
        super().__init__()
        self.cells: dict[tuple[str, str, str], tuple[float | None, str]] = {}
        self._row: dict[str, Any] = {}
        self._key: tuple[str, str, str] | None = None
        self.feed(page)

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        found = dict(attrs)
        if tag == "tr":
            self._row = found
        elif tag == "td" and "data-metric" in found:
            row = self._row.get("data-kind") or self._row["data-frequency"]
            self._key = (row, found.get("data-name") or self._row["data-name"], found["data-metric"])
            self.cells[self._key] = (None, "")
        elif tag == "data" and self._key:
            self.cells[self._key] = (float(found["value"]), "")

    def handle_endtag(self, tag: str) -> None:
        if tag == "td":
            self._key = None

    def handle_data(self, data: str) -> None:
        if self._key:
            value, text = self.cells[self._key]
            self.cells[self._key] = (value, text + data.strip())


def as_number(text: str) -> float:
    return float(text.replace("−", "-"))


def test_report_numbers_equal_metrics_json(run: Path, page: str):
    metrics = json.loads((run / "metrics.json").read_text())
    cells = Tables(page).cells
    shown = ("rmse_deg_s", "rmse_aligned_deg_s", "floor_rmse_deg_s", "mean_std_deg_s")
    for kind in ("sensors", "fusion"):
        for name, item in metrics[kind].items():
            for metric in shown:
                value, text = cells[kind, name, metric]
                assert value == item.get(metric)
                # Three significant digits round by at most half a unit of the third: 0.5 %.
                assert text == "—" if value is None else as_number(text) == pytest.approx(value, rel=5e-3)
            for line in item["lines"]:
                frequency = str(line["frequency_hz"])
                assert cells[frequency, name, "gain"] == (line["gain"], significant(line["gain"], 4))
                assert cells[frequency, name, "phase_deg"] == (line["phase_deg"], fixed(line["phase_deg"], 2))
    value, _ = cells["fusion", "kalman", "ratio"]
    assert value == 0.00234567 / 0.0011111
    assert cells["sensors", "mhd_ars", "ratio"] == (None, "—")


def test_report_says_what_came_out(page: str):
    text = re.sub(r"\s+", " ", re.search(r'<p id="summary">(.*?)</p>', page, re.DOTALL)[1])
    assert "Of 3 filters kalman is the most accurate: its error is 0.00235 deg/s rms" in text
    assert (
        "13.4 times smaller than the error of the best sensor alone (mems_gyro, 0.0315 deg/s)" in text
    )  # 0.0315 / 0.00234567
    assert "2.11 times the noise floor" in text
    assert "The one expectation of the scenario was met." in text
    assert "guard_hits" in page
    assert "duration: 3 s" in page


def test_report_missed_expectation_is_named(tmp_path: Path):
    metrics = metrics_of(0.2, 0.0, ("kalman",))
    metrics["expectations"] = [
        {"subject": "kalman", "metric": "rmse_deg_s", "bound": "< 0.001", "value": 0.002, "met": False}
    ]
    page = write_report(make_run(tmp_path / "run", metrics)).read_text(encoding="utf-8")
    assert "1 of 1 expectations of the scenario missed: kalman rmse_deg_s &lt; 0.001." in page
    assert "✗ missed" in page


def test_report_is_self_contained_and_moderate(page: str):
    assert not re.findall(r'(?:src|href)="(?!#)', page)
    # Its own scripts, and nothing from elsewhere.
    assert re.findall(r"<script[^>]*src|<link|@import|url\((?!#)", page) == []
    assert "@import" not in page
    figures = re.findall(r"<svg.*?</svg>", page, re.DOTALL)
    assert len(figures) == 5
    assert max(len(figure) for figure in figures) < 300_000
    ids = re.findall(r'\bid="([^"]+)"', page)
    assert len(ids) == len(set(ids))
    used = set(re.findall(r'href="#([^"]+)"|url\(#([^)]+)\)', page))
    assert {first or second for first, second in used} <= set(ids)


def test_report_twice_gives_the_same_bytes(run: Path, page: str):
    assert write_report(run).read_text(encoding="utf-8") == page


def test_report_escapes_names(tmp_path: Path):
    name = "<b>k & $x$"
    metrics = metrics_of(0.3, 0.1, (name,))
    metrics["scenario"] = "<script>alert(1)</script>"
    folder = make_run(tmp_path / "run", metrics)
    (folder / "scenario.yaml").write_text("name: </pre><img src=x>\n", encoding="utf-8")
    page = write_report(folder).read_text(encoding="utf-8")
    assert "<script>alert" not in page
    assert "<b>k" not in page
    assert "<img" not in page
    assert ("fusion", name, "rmse_deg_s") in Tables(page).cells


def test_report_without_lines_floor_filters_or_spectrum(tmp_path: Path):
    """`static`, nothing defined, one sensor, a record too short for a spectrum."""
    metrics = metrics_of(0.01, 0.0099, ("kalman",))
    for item in [*metrics["sensors"].values(), *metrics["fusion"].values()]:
        item.update(rmse_deg_s=None, rmse_aligned_deg_s=None, floor_rmse_deg_s=None, lines=None)
    metrics["expectations"] = []
    page = write_report(make_run(tmp_path / "run", metrics)).read_text(encoding="utf-8")
    assert "No filter has a defined error." in page
    assert 'id="lines"' not in page
    assert not re.search(r"\b(nan|None|NaN)\b", re.sub(r"<svg.*?</svg>", "", page, flags=re.DOTALL))
    metrics["fusion"] = {}
    page = write_report(make_run(tmp_path / "none", metrics)).read_text(encoding="utf-8")
    assert len(re.findall("<svg", page)) == 2


@pytest.mark.parametrize("sensors", [{}, {"mems_gyro": {"preset": "adis16505", "dropped": "100 %"}}])
def test_report_of_a_table_alone_and_of_a_sensor_without_a_reading(tmp_path: Path, sensors: dict[str, Any]):
    still = {"name": "table", "duration": "0.1 s", "motion": [{"constant": {"rate": "1 deg/s"}}], "sensors": sensors}
    run = testbed.run(still, out=tmp_path / "run")
    page = (tmp_path / "run" / "report.html").read_text(encoding="utf-8")
    assert ("spectrum" in run.plot()) == bool(sensors)
    assert len(re.findall("<svg", page)) == len(run.plot())


def test_a_run_of_one_sample_has_its_report_too(tmp_path: Path):
    sensors = {"mhd_ars": {"preset": "sx300"}, "mems_gyro": {"preset": "adis16505_filtered"}}
    brief = {
        "name": "brief",
        "duration": "50 us",
        "motion": [{"static": {}}],
        "sensors": sensors,
        "fusion": {"kalman": {}},
    }
    run = testbed.run(brief, out=tmp_path / "run")
    assert run.sensors["mems_gyro"].rate.shape == (1,)
    assert run.sensors["mems_gyro"].sample_rate_hz == 2000.0
    assert "spectrum" in run.plot()


def test_report_optimum_column_only_when_known(tmp_path: Path, page: str):
    assert not {("fusion", "kalman", key) for key in ("optimum_rmse_deg_s", "optimum_ratio")} & set(Tables(page).cells)
    metrics = metrics_of(0.2, 0.0, ("kalman",))
    metrics["fusion"]["kalman"]["optimum_rmse_deg_s"] = 0.0013
    cells = Tables(write_report(make_run(tmp_path / "run", metrics)).read_text(encoding="utf-8")).cells
    assert cells["fusion", "kalman", "optimum_rmse_deg_s"] == (0.0013, "0.00130")
    assert cells["fusion", "kalman", "optimum_ratio"] == (0.00234567 / 0.0013, "1.80")
    assert cells["sensors", "mhd_ars", "optimum_ratio"] == (None, "—")


def test_report_is_replaced_whole(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    folder = make_run(tmp_path / "run", metrics_of(0.2, 0.0, ("kalman",)))
    (folder / "report.html").write_text("earlier", encoding="utf-8")

    def full_disk(self: Path, target: Path) -> Path:
        assert "</html>" in self.read_text(encoding="utf-8")  # whole before it is renamed
        raise OSError(28, "No space left on device")

    before = sorted(folder.iterdir())
    with monkeypatch.context() as patch:
        patch.setattr(type(folder), "replace", full_disk)
        with pytest.raises(OSError, match="No space left"):
            write_report(folder)
    assert (folder / "report.html").read_text(encoding="utf-8") == "earlier"
    assert sorted(folder.iterdir()) == before
    assert write_report(folder).read_text(encoding="utf-8").rstrip().endswith("</html>")
    assert sorted(folder.iterdir()) == before


@pytest.mark.parametrize(
    ("name", "damage"),
    [
        *[(name, damage) for name in ("run.nc", "metrics.json") for damage in ("missing", "empty", "binary", "cut")],
        ("scenario.yaml", "missing"),  # any text is shown as it is
        ("scenario.yaml", "binary"),
    ],
)
def test_report_damaged_folder_is_named(tmp_path: Path, name: str, damage: str):
    folder = make_run(tmp_path / "run", metrics_of(1.0, 0.0, ("kalman",)))
    path = folder / name
    content = path.read_bytes()
    if damage == "missing":
        path.unlink()
    else:
        path.write_bytes({"empty": b"", "binary": b"\xff\x00\xfe" * 50, "cut": content[: len(content) // 2]}[damage])
    with pytest.raises(ScenarioError, match=re.escape(str(path))) as caught:
        write_report(folder)
    assert "expected" in str(caught.value)
    assert not (folder / "report.html").exists()


def test_report_missing_folder(tmp_path: Path):
    with pytest.raises(ScenarioError, match="expected a run folder"):
        write_report(tmp_path / "nothing")


def test_report_metrics_key_missing_is_named(tmp_path: Path):
    metrics = metrics_of(0.2, 0.0, ("kalman",))
    del metrics["seed"]
    metrics["fusion"]["kalman"]["rmse_deg_s"] = "small"
    with pytest.raises(ScenarioError) as caught:
        write_report(make_run(tmp_path / "run", metrics))
    assert [problem.key for problem in caught.value.problems] == ["seed", "fusion.kalman.rmse_deg_s"]


def test_report_wrong_units_and_unknown_filter_are_named(tmp_path: Path):
    folder = make_run(tmp_path / "run", metrics_of(0.2, 0.0, ("kalman",)))
    with h5netcdf.File(folder / "run.nc", "a") as file:
        file["fusion/kalman/std"].attrs["units"] = "deg/s"
    with pytest.raises(ScenarioError, match=r"fusion/kalman/std: expected units 'rad/s', got 'deg/s'"):
        write_report(folder)
    metrics = metrics_of(0.2, 0.0, ("kalman", "absent"))
    (folder / "metrics.json").write_text(json.dumps(metrics), encoding="utf-8")
    with h5netcdf.File(folder / "run.nc", "a") as file:
        file["fusion/kalman/std"].attrs["units"] = "rad/s"
    with pytest.raises(ScenarioError, match=r"fusion/absent/rate: expected a variable"):
        write_report(folder)


def digest_of(folder: Path):
    return digest_run(RunRecord.open(folder))


def test_digest_pairs_each_reading_with_the_truth_at_its_instant(tmp_path: Path):
    """A truth that differs at every sample, a 2 kHz sensor and a filter that hold it exactly: every error is zero."""
    metrics = metrics_of(0.5, 0.1, ("kalman",))
    folder = make_run(tmp_path / "run", metrics)
    truth = np.random.default_rng(3).standard_normal(10000)
    (folder / "run.nc").unlink()
    with h5netcdf.File(folder / "run.nc", "w") as file:
        put(file, "commanded", BASE_HZ, rate=truth)
        put(file, "truth", BASE_HZ, rate=truth)
        put(file, "sensors/mhd_ars", BASE_HZ, rate=truth)
        put(file, "sensors/mems_gyro", GYRO_HZ, rate=truth[::10])
        put(file, "fusion/kalman", BASE_HZ, rate=truth, std=np.ones(10000))
    digest = digest_of(folder)
    for trace in [*digest.sensor_errors.values(), *digest.filter_errors.values()]:
        assert np.all(trace.whole.low == 0.0)
        assert np.all(trace.whole.high == 0.0)
    write_report(folder)  # an error of zero has no place on a logarithmic axis: drawn without a warning


def test_digest_coverage_and_spectrum_of_a_white_error(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    """White error of the claimed std: 95.45 % inside, and a density std^2 / fs; small blocks do not change a bit of
    it.
    """
    folder = make_run(tmp_path / "run", metrics_of(4.0, 3.0, ("kalman",)))
    trace = digest_of(folder).filter_errors["kalman"]
    # 3 s = 10 time constants of the start-up: 1.4e-7 rad/s left, 0.3 % of the std. Binomial scatter of n = 20000 is
    # 0.0015; 5 sigma.
    assert trace.inside == pytest.approx(0.9545, abs=5 * 0.0015)
    # n_segment = 10000, 3 segments, bins of up to 280 frequencies near the top: relative scatter 1/sqrt(3 * 0.9 * 280 /
    # 1.5) = 4.5 %; 5 sigma.
    assert trace.n_segments == 3
    assert trace.density[-5] == pytest.approx(4e-5**2 / BASE_HZ, rel=0.23)
    monkeypatch.setattr("testbed.report.digest.BLOCK", 1234)
    again = digest_of(folder).filter_errors["kalman"]
    assert again.inside == trace.inside
    assert np.array_equal(again.density, trace.density)
    assert np.array_equal(again.whole.low, trace.whole.low)
    assert np.array_equal(again.std.high, trace.std.high)


def test_digest_nan_readings_leave_gaps(tmp_path: Path):
    folder = make_run(tmp_path / "run", metrics_of(1.0, 0.0, ("kalman",)))
    with h5netcdf.File(folder / "run.nc", "a") as file:
        rate = file["sensors/mems_gyro/rate"]
        values = rate[:]
        values[500:900] = np.nan
        rate[:] = values
    trace = digest_of(folder).sensor_errors["mems_gyro"]
    gap = np.isnan(trace.whole.low)
    # 700 bins on 2000 samples: 2.86 samples a bin, 400 missing samples cover 140 bins, less one broken at each end.
    assert 138 <= np.count_nonzero(gap) <= 140
    assert trace.n_segments == 1  # of the segments [0, 1000), [500, 1500), [1000, 2000) only the last is whole
    write_report(folder)


def test_zoom_window_shows_two_periods_inside_the_run():
    def window(duration_s: float, settle_s: float, lines: list[float]) -> tuple[float, float]:
        item = {"lines": [{"frequency_hz": f} for f in lines]}
        return zoom_window(RunMetrics.model_validate(metrics_of(duration_s, settle_s, ()) | {"sensors": {"a": item}}))

    assert window(20.0, 10.0, [10.0, 0.5]) == (10.0, 14.0)
    assert window(20.0, 10.0, []) == (10.0, 11.0)
    assert window(20.0, 10.0, [0.1]) == (10.0, 20.0)


@pytest.mark.parametrize(
    ("value", "text"),
    [
        (0.0024, "0.00240"),
        (0.565, "0.565"),
        (9.999, "10.0"),
        (-12.345, "−12.3"),
        (123456.0, "1.23×10⁵"),
        (5.7e-6, "5.70×10⁻⁶"),
        (0.0, "0"),
        (None, "—"),
        (float("nan"), "—"),
    ],
)
def test_significant_digits(value: float | None, text: str):
    assert significant(value) == text


@pytest.mark.slow
def test_report_memory_is_flat_in_duration(tmp_path: Path):
    """Two and a half times the run, the same peak: blocks, envelopes and a capped spectrum segment.

    The cap of 2^19 samples on a segment is reached from 52 s on: both runs are beyond it.
    """
    peaks = []
    for duration_s in (60.0, 150.0):
        folder = tmp_path / f"run{duration_s:g}"
        metrics = metrics_of(duration_s, 0.0, ("kalman",)) | {"sensors": {}}
        folder.mkdir()
        (folder / "metrics.json").write_text(json.dumps(metrics), encoding="utf-8")
        (folder / "scenario.yaml").write_text("name: long\n", encoding="utf-8")
        noise = np.random.default_rng(1).integers(-3, 4, round(duration_s * BASE_HZ)) * 1e-5
        with h5netcdf.File(folder / "run.nc", "w") as file:
            put(file, "commanded", BASE_HZ, rate=noise)
            put(file, "truth", BASE_HZ, rate=np.zeros(noise.size))
            put(file, "fusion/kalman", BASE_HZ, rate=noise, std=np.full(noise.size, 2e-5))
        del noise
        tracemalloc.start()
        write_report(folder)
        peaks.append(tracemalloc.get_traced_memory()[1])
        tracemalloc.stop()
    # One signal of the long run alone is 24 MB; 5 % covers text that differs.
    assert peaks[1] < 1.05 * peaks[0]


def test_a_slow_run_is_in_one_unit_and_of_one_sensor_in_its_words(tmp_path: Path):
    """Every rate in deg/h, figure numbers in their order, no word of a second sensor or of a filter."""
    metrics = metrics_of(3.0, 1.0, ())
    metrics["rate_unit"] = "deg/h"
    metrics["sensors"] = {"mems_gyro": {"rmse_deg_s": 1e-4, "peak_error_deg_s": 3e-16, "lines": []}}
    page = write_report(make_run(tmp_path / "run", metrics)).read_text(encoding="utf-8")
    text = re.sub(r"<svg.*?</svg>|<pre.*?</pre>", "", page, flags=re.DOTALL)
    assert "its error is 0.360 deg/h rms. No filter was run." in text
    assert "deg/s" not in text.replace("rmse_deg_s", "")
    assert "below 3.6×10⁻⁹" in text
    for word in ("mhd", "MHD", "gyro</sub>", "other sensor", "filters wide", "claimed std", "best sensor"):
        assert word not in text
    assert re.findall(r"<b>Figure (\d+)\.</b>", page) == ["1", "2", "3", "4"]


def test_the_set_up_names_presets_and_what_differs(tmp_path: Path):
    metrics = metrics_of(0.2, 0.0, ("kalman",))
    differs = [{"key": "angle_random_walk", "here": "0.3 deg/sqrt(h)", "preset": "0.15 deg/sqrt(h)"}]
    metrics["setup"] = [
        {"part": "sensors.mems_gyro", "preset": "adis16505_filtered", "differs": differs},
        {"part": "fusion.kalman", "preset": None, "differs": []},
    ]
    page = write_report(make_run(tmp_path / "run", metrics)).read_text(encoding="utf-8")
    assert "adis16505_filtered" in page
    assert 'angle_random_walk&nbsp;= 0.3 deg/sqrt(h) <span class="none">(0.15 deg/sqrt(h))</span>' in page


def test_gain_and_phase_are_shown_with_their_intervals(tmp_path: Path):
    metrics = metrics_of(0.2, 0.0, ("kalman",))
    metrics["fusion"]["kalman"]["lines"] = [
        {"frequency_hz": 0.5, "gain": 0.19743, "gain_ci95": 0.0031, "phase_deg": 78.4, "phase_ci95_deg": 0.9},
        {"frequency_hz": 208.0, "gain": 0.2, "gain_ci95": 0.5, "phase_deg": 12.0, "phase_ci95_deg": 180.0},
    ]
    page = write_report(make_run(tmp_path / "run", metrics)).read_text(encoding="utf-8")
    cells = Tables(page).cells
    assert cells["0.5", "kalman", "gain"] == (0.19743, "0.197± 0.003")
    assert cells["208.0", "kalman", "gain"] == (0.2, "0.2± 0.5")
    assert cells["208.0", "kalman", "phase_deg"] == (12.0, "lost")


def test_figures_for_elsewhere_are_whole_known_to_the_manifest_and_repeatable(tmp_path: Path):
    """Each is what its name says, a rerun may replace them, and equal runs give equal files."""
    run = testbed.run(testbed.Scenario.from_dict(SMALL), out=tmp_path / "run")
    assert run.folder is not None
    written = save_figures(run.folder)
    names = set(run_figures(run))
    assert {path.name for path in written} == {f"{name}.{kind}" for name in names for kind in ("svg", "pdf", "png")}
    first = {path: path.read_bytes() for path in written}
    for path, content in first.items():
        start = {".svg": b"<?xml", ".pdf": b"%PDF-", ".png": b"\x89PNG\r\n"}[path.suffix]
        assert content.startswith(start)
        assert content.rstrip().endswith({".svg": b"</svg>", ".pdf": b"%%EOF", ".png": b"IEND\xaeB`\x82"}[path.suffix])
    assert strangers(run.folder) == []
    assert {path: path.read_bytes() for path in save_figures(run.folder)} == first
    testbed.run(testbed.Scenario.from_dict(SMALL), out=tmp_path / "run")
    assert not (tmp_path / "run" / "figures").exists()
