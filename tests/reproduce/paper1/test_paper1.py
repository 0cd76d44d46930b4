"""Paper 1's Table II against the physics of table and sensors."""

from __future__ import annotations

import csv
from typing import TYPE_CHECKING

import numpy as np
import pytest

from testbed.models.motion import MotionProfile
from testbed.reproduce.paper1 import PAPER, report, table_ii
from testbed.reproduce.paper1.defects import CASES
from testbed.reproduce.paper1.runs import (
    FILTERS,
    SENSORS,
    SIGNALS,
    FusionProtocol,
    errors,
    outputs,
    presets,
    truth,
)
from testbed.signals import BASE_RATE_HZ
from testbed.units import DEG

if TYPE_CHECKING:
    from pathlib import Path

SHORT = FusionProtocol(duration=2.0, settle=1.0)
# Half of Table II, at 10 Hz three quarters; the mixed signal is half of the text's 0.0143 [deg/s].
TARGETS = {"0.5 Hz": 0.0049, "4 Hz": 0.0035, "10 Hz": 0.0030, "mixed": 0.0071}


def table(path: Path) -> dict[tuple[str, str], dict[str, str]]:
    with path.open() as file:
        return {(row["signal"], row["name"]): row for row in csv.DictReader(file)}


@pytest.mark.slow
def test_one_parameter_set_meets_table_ii_on_all_four_signals(tmp_path: Path) -> None:
    """Median over ten seeds at or below the paper's own column, and no seed beyond it by half; `arw_shakf` at or below
    its targets.

    SHAKF tuned at 0.5 Hz meets its own entry there and is at least ten times worse at 4 and 10 Hz.
    """
    rates = {signal: truth(signal, FusionProtocol()) for signal in SIGNALS}
    print(*table_ii(rates, 10, tmp_path, FusionProtocol()), sep="\n")
    rows = table(tmp_path / "table_ii.csv")
    assert len(rows) == len(SIGNALS) * (len(SENSORS) + len(FILTERS))
    for signal in SIGNALS:
        proposed = PAPER[signal]["arw_shakf"]
        for name in ("kalman", "arw_shakf", "arw_shakf_literal"):
            row = rows[signal, name]
            assert float(row["rmse_deg_s"]) <= proposed, row
            assert float(row["rmse_highest_deg_s"]) <= 1.5 * proposed, row
        assert float(rows[signal, "arw_shakf"]["rmse_deg_s"]) <= TARGETS[signal]
    tuned = float(rows["0.5 Hz", "shakf"]["rmse_deg_s"])
    assert tuned <= PAPER["0.5 Hz"]["shakf"]
    for signal in ("4 Hz", "10 Hz"):
        assert float(rows[signal, "shakf"]["rmse_deg_s"]) >= 10 * tuned


def test_the_signals_are_the_papers() -> None:
    """1 deg/s each; mixed: 5.555 mrad at 0.5 Hz and 50 urad at 10 Hz, 1 and 0.18 deg/s."""
    t = np.arange(200_000) / BASE_RATE_HZ
    rng = np.random.default_rng()
    for signal, peaks in (("0.5 Hz", [1.0]), ("4 Hz", [1.0]), ("10 Hz", [1.0]), ("mixed", [1.0, 0.18])):
        found = [float(np.rad2deg(np.max(np.abs(sine.start(10.0, rng)(t))))) for sine in SIGNALS[signal]]
        # 5.555 mrad at 0.5 Hz is 0.99991 deg/s, 50 urad at 10 Hz is 0.18000: the paper's own rounding.
        assert found == pytest.approx(peaks, abs=1e-3)


def test_sensors_alone_follow_their_transfer_functions() -> None:
    """At 10 Hz the closed form of a sine through equation (39): A |G - 1| / sqrt(2), phase included."""
    rate = DEG * np.sin(2 * np.pi * 10.0 * np.arange(round(2 * BASE_RATE_HZ)) / BASE_RATE_HZ)
    found = errors(outputs(rate, 1, presets()), rate, "10 Hz", SHORT)
    s = 2j * np.pi * 10.0
    gyro = (154.537 * s + 15.626) / (5.2175 * s**2 + 148.0 * s + 15.444)
    mhd = 2200.0 * s / (0.255 * s**2 + 2178.0 * s + 33900.0)
    # The gyro's pole at 0.1 rad/s still settles and its noise is 0.01 deg/s rms; sx300 meets (39) within 0.2 %.
    assert found["mems_gyro"][0] == pytest.approx(abs(gyro - 1) / np.sqrt(2), abs=0.02)
    assert found["mhd_ars"][0] == pytest.approx(abs(mhd - 1) / np.sqrt(2), abs=0.003)


def test_the_truth_is_the_table_under_its_servo() -> None:
    """It follows the command but for the platform's recoil, 0.11 % of the rate (I_rotor / I_platform = 0.05 / 45)."""
    rate = truth("10 Hz", SHORT)
    terms = [sine.start(2.0, np.random.default_rng()) for sine in SIGNALS["10 Hz"]]
    command = MotionProfile(terms, 0.5, BASE_RATE_HZ).process(rate.size).rate[:-1]
    off = np.max(np.abs(rate - command)[20_000:]) / np.deg2rad(1.0)
    assert 5e-4 < off < 3e-3


def test_one_command_writes_both_tables_and_every_figure_with_its_numbers(tmp_path: Path) -> None:
    lines = list(report(1, tmp_path, SHORT))
    rows = table(tmp_path / "table_ii.csv")
    assert float(rows["4 Hz", "shakf"]["paper_rmse_deg_s"]) == 0.1831
    assert rows["mixed", "mhd_ars"]["paper_rmse_deg_s"] == ""
    assert rows["mixed", "mhd_ars"]["optimum_rmse_deg_s"] == rows["mixed", "mhd_ars"]["floor_rmse_deg_s"] == ""
    (line,) = [line for line in lines if line.startswith("10 Hz   kalman")]
    row = rows["10 Hz", "kalman"]
    for text, bound in zip(line.split()[-2:], ("floor_rmse_deg_s", "optimum_rmse_deg_s"), strict=True):
        assert float(text) == pytest.approx(float(row["rmse_deg_s"]) / float(row[bound]), abs=0.06)
    # A faster line of the same amplitude costs more; the fast one of the mixed signal is weaker than that at 10 Hz
    # alone.
    best = {signal: float(rows[signal, "kalman"]["optimum_rmse_deg_s"]) for signal in SIGNALS}
    assert best["0.5 Hz"] < best["4 Hz"] < best["10 Hz"]
    assert best["0.5 Hz"] < best["mixed"] < best["10 Hz"]
    figures = {f"figure_{i}.{kind}" for i in (2, *range(6, 16)) for kind in ("csv", "svg", "png")}
    assert {p.name for p in tmp_path.iterdir()} == figures | {
        "table_ii.csv",
        "table_ii_defects.csv",
        "figure_6_measured.csv",
        "figure_7_measured.csv",
    }
    assert sum(line.startswith("figure_") for line in lines) == 11
    assert sum(any(case in line for case in CASES) for line in lines) >= len(SIGNALS) * len(CASES)
    with (tmp_path / "table_ii_defects.csv").open() as file:
        assert len(list(csv.DictReader(file))) == len(CASES) * len(SIGNALS) * len(FILTERS)
