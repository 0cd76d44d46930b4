"""Paper 2's protocol on a reduced grid."""

from __future__ import annotations

import csv
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np
import pytest
from typer.testing import CliRunner

from testbed.cli import app
from testbed.errors import ScenarioError
from testbed.reproduce import run_paper
from testbed.reproduce.paper2 import CHANNELS, Protocol, amplitudes, mhd_response, noise_density, report

if TYPE_CHECKING:
    from pathlib import Path

FEW = Protocol(
    scale_amplitudes=(20.0, 50.0),
    scale_frequencies=(0.5, 3.0, 10.0, 60.0),
    linear_amplitudes=(1.0, 25.0, 50.0),
    linear_frequencies=(2.0, 50.0),
    observe=0.5,
    warm_up=2.0,
    standstill=4.0,
)


def test_the_protocol_is_the_papers() -> None:
    full = Protocol()
    assert list(full.scale_amplitudes) == [20, 30, 40, 50]
    assert len(full.scale_frequencies) == 9 + 20 + 8
    assert min(full.scale_frequencies) == 0.1
    assert max(full.scale_frequencies) == 60
    assert list(full.linear_amplitudes) == [1, 5, 10, 15, 20, 25, 30, 35, 40, 45, 50]
    assert list(full.linear_frequencies) == [0.2, 2, 20, 50]


@pytest.mark.oracle
def test_sensor_amplitudes_are_those_of_their_responses() -> None:
    for f in (2.0, 50.0):
        gyro, mhd, _ = amplitudes(f, 50.0, 1, Protocol())
        # Leaves the grid of the channel and the hold between samples; start-up is gone after a second.
        assert mhd / 50.0 == pytest.approx(abs(mhd_response(np.array([f]))[0]), rel=2e-4, abs=0.0)
        ratio = f / 10.0
        # Angle random walk 2.3e-4 rad/sqrt(s) over one second, before the low-pass: 0.02 deg/s, three sigma.
        assert gyro / 50.0 == pytest.approx(1.0 / np.hypot(1.0 - ratio**2, 1.4 * ratio), rel=0, abs=0.06 / 50.0)


@pytest.mark.slow
def test_tables_are_written_and_meet_the_targets(tmp_path: Path) -> None:
    lines = list(report(1, tmp_path, FEW))
    print("\n".join(lines))
    with (tmp_path / "scale_factor.csv").open(newline="") as file:
        rows = list(csv.DictReader(file))
    assert [float(row["frequency_hz"]) for row in rows] == list(FEW.scale_frequencies)
    fused = np.array([float(row["fused"]) for row in rows])
    assert np.ptp(fused) / np.mean(fused) <= 0.01
    with (tmp_path / "linearity.csv").open(newline="") as file:
        rows = list(csv.DictReader(file))
    assert list(rows[0]) == ["frequency_hz", *(f"{name}_percent" for name in CHANNELS)]
    # Both are linear to their noise: 1e-7 rad/s per root hertz over half a second is 1e-5 % of 50 deg/s.
    assert all(float(row["fused_percent"]) < 1e-3 for row in rows)
    assert (tmp_path / "noise_psd.csv").exists()
    text = "\n".join(lines)
    assert "2.5 %" in text
    assert "1 dB" in text


@pytest.mark.slow
def test_without_a_clamp_the_scale_factor_depends_on_the_amplitude() -> None:
    """R as printed holds the signal: at 60 Hz the filter slows down with the amplitude; with the clamp it does not."""

    def spread(**parameters: float | None) -> float:
        gains = [amplitudes(60.0, a, 1, replace(FEW, settle=0.3), **parameters)[2] / a for a in (5.0, 50.0)]
        return abs(gains[1] / gains[0] - 1.0)

    assert spread(clamp=None) > 10.0 * spread()


def test_noise_is_referred_to_the_rate_by_the_response() -> None:
    freq, density = noise_density(1, replace(FEW, warm_up=0.1, standstill=1.0))
    assert density.shape == (freq.size, 4)
    band = (freq > 50.0) & (freq < 500.0)
    # White 1e-7 rad/s per root hertz, its 18-bit step, 1/f below 0.1 Hz; the response is 1 within 10 % there.
    assert np.all((density[band, 3] > 0.5e-14) & (density[band, 3] < 2e-14))


def test_only_what_exists_is_promised(tmp_path: Path) -> None:
    for name, message in (("paper9", "unknown paper, there is: paper1, paper2, paper3"),):
        with pytest.raises(ScenarioError, match=message):
            list(run_paper(name, 1, tmp_path))
    taken = tmp_path / "file"
    taken.write_text("")
    with pytest.raises(ScenarioError, match="--out: expected a folder"):
        list(run_paper("paper2", 1, taken))
    assert CliRunner().invoke(app, ["reproduce", "paper2", "--seeds", "0"]).exit_code == 2
