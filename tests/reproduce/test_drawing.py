"""Figures for print: what the reader measures in them, and that equal numbers give equal files."""

from __future__ import annotations

import subprocess
import sys
from typing import TYPE_CHECKING

import matplotlib.image
import numpy as np
import pytest

from testbed.reproduce.drawing import COLUMN_IN, panels, save, smooth

if TYPE_CHECKING:
    from pathlib import Path


@pytest.mark.oracle
def test_running_mean_of_a_sine_is_the_sine_by_the_dirichlet_kernel() -> None:
    """Mean of n samples of a sine of w per sample: sin(n w / 2) / (n sin(w / 2)), without delay; undefined where it
    reaches beyond the ends.
    """
    t = np.arange(2000) / 2000.0
    mean, w = smooth(np.sin(2 * np.pi * 10.0 * t), t, 20e-3), 2 * np.pi * 10.0 / 2000.0
    inside = slice(20, -20)
    expected = np.sin(41 * w / 2) / (41 * np.sin(w / 2)) * np.sin(2 * np.pi * 10.0 * t[inside])
    assert mean[inside] == pytest.approx(expected, abs=1e-12)
    assert np.isnan(mean[:20]).all()
    assert np.isnan(mean[-20:]).all()


def test_equal_numbers_give_equal_files_as_wide_as_a_column(tmp_path: Path) -> None:
    for name in ("first", "second"):
        (tmp_path / name).mkdir()
        figure, (axes,) = panels(2.0)
        axes.plot([0, 1], [1, 0])
        save(figure, tmp_path / name, "line")
    for kind in ("svg", "png"):
        assert (tmp_path / "first" / f"line.{kind}").read_bytes() == (tmp_path / "second" / f"line.{kind}").read_bytes()
    assert matplotlib.image.imread(tmp_path / "first" / "line.png").shape[:2] == (600, 300 * COLUMN_IN)


def test_drawing_is_loaded_only_to_draw() -> None:
    code = "import testbed.reproduce.paper1, sys; sys.exit('matplotlib' in sys.modules)"
    assert subprocess.run([sys.executable, "-c", code], check=False).returncode == 0
