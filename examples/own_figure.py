"""A figure of one's own for the report: where in frequency the error of each filter comes from.

Drawn alone: `python examples/own_figure.py runs/mixed_0p5hz_10hz`, which writes `own_figure.svg`. CONTRIBUTING.md says
how it gets into every report.
"""

from __future__ import annotations

import sys
from pathlib import Path
from typing import TYPE_CHECKING

import matplotlib as mpl
import numpy as np
from matplotlib.figure import Figure

from testbed.pages.axes import WIDTH_IN, arrange, label
from testbed.pages.palette import series_colors
from testbed.pages.svg import STYLE, svg_text
from testbed.report.digest import Digest, digest_run
from testbed.runs.results import RunRecord

if TYPE_CHECKING:
    from collections.abc import Mapping

    from testbed.signals import FloatArray


def rms_below(freq_hz: FloatArray, density: FloatArray) -> FloatArray:
    """Return the rms of an error below each frequency, by the trapezoidal rule over both halves of its spectrum.

    Parameters
    ----------
    freq_hz : ndarray, shape (n_freq,)
        Frequencies [Hz].
    density : ndarray, shape (n_freq,)
        Two-sided density of the error [rad^2/s].

    Returns
    -------
    ndarray, shape (n_freq,)
        Rms between the first frequency and each [rad/s].
    """
    power = np.diff(freq_hz) * (density[1:] + density[:-1])
    return np.sqrt(np.concatenate([[0.0], np.cumsum(power)]))


def origin_figure(digest: Digest, colors: Mapping[str, str]) -> Figure:
    """Draw the rms of each filter's error below a frequency.

    Parameters
    ----------
    digest : Digest
        Traces of the run.
    colors : Mapping
        Group (``fusion/kalman``, ...) to color.

    Returns
    -------
    Figure
        One axes, deg/s against Hz.
    """
    with mpl.rc_context(STYLE):
        figure = Figure(figsize=(WIDTH_IN, 3.6))
        axes = figure.subplots()
        handles = []
        for name, trace in digest.filter_errors.items():
            rms = np.degrees(rms_below(trace.freq_hz, trace.density))
            handles += axes.plot(trace.freq_hz, rms, color=colors[f"fusion/{name}"], label=label(name))
        axes.set(xscale="log", xlabel="frequency [Hz]", ylabel="rms error below it [deg/s]")
        axes.grid(visible=True)
        arrange(figure, handles)
    return figure


def main(folder: str, out: str = "own_figure.svg") -> None:
    """Draw the figure of a run folder.

    Parameters
    ----------
    folder, out : str
        Run folder, and the file to write.
    """
    run = RunRecord.open(Path(folder))
    figure = origin_figure(digest_run(run), series_colors(list(run.metrics.sensors), list(run.metrics.fusion)))
    Path(out).write_text(svg_text(figure, "origin"), encoding="utf-8")


if __name__ == "__main__":
    main(*sys.argv[1:])
