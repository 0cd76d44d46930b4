"""Optimum and noise budget beside every result: in metrics.json, on the terminal and in the report."""

from __future__ import annotations

import re
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest
from rich.console import Console

import testbed
from testbed.cli.terminal import print_metrics
from testbed.judging.budget import budget_summary
from testbed.pages.palette import series_colors
from testbed.report.budget import band_rows, budget_figure, line_error, line_optima
from testbed.report.digest import digest_run
from testbed.runs.metrics import Budget, RunMetrics
from testbed.sensors import load_preset

if TYPE_CHECKING:
    from pathlib import Path

SCENARIO = """
name: two_lines
seed: 4
duration: 2 s
settle: 1 s
turntable: {mode: ideal}
motion:
  - sine: {frequency: 4 Hz, rate: 1 deg/s}
  - sine: {frequency: 40 Hz, rate: 0.5 deg/s}
sensors:
  mhd_ars: {preset: sx300}
  mems_gyro: {preset: adis16505_filtered}
fusion:
  complementary: {belief: identified}
"""


@pytest.fixture(scope="module")
def run(tmp_path_factory: pytest.TempPathFactory) -> tuple[dict[str, Any], Path]:
    folder = tmp_path_factory.mktemp("budget")
    (folder / "scenario.yaml").write_text(SCENARIO, encoding="utf-8")
    out = folder / "run"
    return testbed.run(testbed.load_scenario(folder / "scenario.yaml"), out=out).metrics, out


def test_every_line_has_its_error_and_its_optimum(run: tuple[dict[str, Any], Path]) -> None:
    row = run[0]["fusion"]["complementary"]
    slow, fast = row["lines"]
    assert 0.0 < slow["optimum_deg_s"] < fast["optimum_deg_s"] < row["optimum_rmse_deg_s"]
    # Made for 10 Hz: the lag at 40 Hz is 64 times that at 10 Hz, half the amplitude.
    assert slow["error_deg_s"] < fast["error_deg_s"] <= row["rmse_deg_s"]
    assert all("optimum_deg_s" not in line for line in run[0]["sensors"]["mhd_ars"]["lines"])


def test_bands_add_up_to_the_floor_of_the_metrics(run: tuple[dict[str, Any], Path]) -> None:
    metrics = run[0]
    floor = metrics["fusion"]["complementary"]["floor_rmse_deg_s"]
    total = sum(band["floor_deg_s"] ** 2 for band in metrics["budget"]["bands"])
    # Both by trapezoids in ln f, 130 points per decade at least.
    assert np.sqrt(total) == pytest.approx(floor, rel=1e-3, abs=0.0)


def test_the_terminal_says_it_in_one_line(
    run: tuple[dict[str, Any], Path], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    print_metrics(run[0], tmp_path)
    text = capsys.readouterr().out
    (line,) = [line for line in text.splitlines() if line.startswith("noise floor:")]
    assert re.search(
        r"crossover 0\.0116\d Hz; mhd_ars 0\.000\d+ deg/s \(most at 0\.01-0\.1 Hz\), mems_gyro 0\.00\d+ deg/s", line
    )
    entry = run[0]["fusion"]["complementary"]["lines"][0]
    assert f" deg, {entry['error_deg_s'] / entry['optimum_deg_s']:.3g}" in text
    quiet = RunMetrics.model_validate({**run[0], "budget": None})
    print_metrics(quiet, tmp_path)
    assert "noise floor:" not in capsys.readouterr().out


@pytest.mark.parametrize("width", [80, 100, 116, 132, 160])
def test_no_terminal_cuts_a_number(
    run: tuple[dict[str, Any], Path],
    tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
    monkeypatch: pytest.MonkeyPatch,
    width: int,
) -> None:
    """Lines are left to the report where they do not fit, also behind a long name."""
    row = run[0]["fusion"]["complementary"]
    monkeypatch.setattr("testbed.cli.terminal.terminal", lambda: Console(width=width))
    fusion = {"complementary": row, "a_long_filter_name": row}
    print_metrics(RunMetrics.model_validate({**run[0], "fusion": fusion}), tmp_path)
    text = capsys.readouterr().out
    assert "\N{HORIZONTAL ELLIPSIS}" not in text
    assert f"{row['rmse_deg_s'] / row['optimum_rmse_deg_s']:.1f} │" in text


def test_the_report_has_the_section(run: tuple[dict[str, Any], Path]) -> None:
    page = (run[1] / "report.html").read_text(encoding="utf-8")
    assert "<h2>Noise budget</h2>" in page
    assert "<h2>Each line against its optimum</h2>" in page
    for band in run[0]["budget"]["bands"]:
        assert f'value="{band["floor_deg_s"]}"' in page
    for line in run[0]["fusion"]["complementary"]["lines"]:
        assert f'value="{line["error_deg_s"]}"' in page
        assert f'value="{line["optimum_deg_s"]}"' in page


def test_errors_by_band_are_the_error_of_the_run(run: tuple[dict[str, Any], Path]) -> None:
    """What the bands hold is part of the mean square, and the lag at 40 Hz is in the band from 10 to 100 Hz."""
    stored = testbed.open_run(run[1])
    metrics, digest = stored.metrics, digest_run(stored)
    assert metrics.budget is not None
    rows = band_rows(metrics.budget, digest)
    found = [row["filters"]["complementary"] for row in rows]
    # A segment of a part of a second starts at some hertz.
    assert found[0] is None
    assert found[-1] is not None
    source = metrics.fusion["complementary"]
    assert source.rmse_deg_s is not None
    assert sum(value**2 for value in found if value is not None) < source.rmse_deg_s**2
    error, at_4_hz = line_error(source, 40.0), line_error(source, 4.0)
    assert error is not None
    assert at_4_hz is not None
    lag = np.sqrt(error**2 - at_4_hz**2)
    assert found[-2] > 0.8 * lag
    assert line_optima(metrics)[40.0] == run[0]["fusion"]["complementary"]["lines"][1]["optimum_deg_s"]


def test_the_figure_marks_the_crossover_and_lies_on_the_better_sensor() -> None:
    sensors = {"mhd_ars": load_preset("sx300"), "mems_gyro": load_preset("adis16505_filtered")}
    summary = budget_summary({name: sensor.input_noise_psd for name, sensor in sensors.items()}, 1000.0)
    budget = Budget.model_validate(summary)
    axes = budget_figure(budget, series_colors(list(sensors), [])).axes[0]
    lines = {line.get_label(): np.asarray(line.get_ydata()) for line in axes.lines}
    combined = lines["best combination (noise floor)"]
    assert np.all(combined < np.fmin(lines["mhd_ars"], lines["mems_gyro"]))
    assert np.all(combined >= np.fmin(lines["mhd_ars"], lines["mems_gyro"]) / np.sqrt(2.0) * (1.0 - 1e-12))
    assert "crossover 0.0116 Hz" in [text.get_text() for text in axes.texts]


def test_a_sensor_that_is_blind_somewhere_has_no_density_there() -> None:
    def blind(freq: Any) -> Any:
        return np.where(freq < 1.0, np.inf, 1e-14)

    summary = budget_summary({"blind": blind, "other": lambda freq: np.full(freq.shape, 1e-12)}, 100.0)
    budget = Budget.model_validate(summary)
    assert budget.densities["blind"][0] is None
    assert budget.combined()[0] == pytest.approx(np.rad2deg(1e-6), rel=1e-12)
