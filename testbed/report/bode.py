"""Bode plot: what the sensors and the filters made of the truth, beside what the filters were told of the sensors."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import matplotlib as mpl
import numpy as np
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from testbed.pages.axes import WIDTH_IN, arrange, label, marked
from testbed.pages.decades import decade_axis, frequency_axis
from testbed.pages.palette import series_marks
from testbed.pages.svg import INK, STYLE

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping, Sequence

    from matplotlib.axes import Axes
    from matplotlib.patches import Patch

    from testbed.metrics.transfer import Transfer
    from testbed.pages.palette import Mark
    from testbed.runs.metrics import Response, RunMetrics

_BELIEVED = (0, (1.2, 1.6))
# Points of a response between its first and last mark, about.
_N_POINTS = 60
# Below this gain nothing is seen of a response.
_LEAST = 1e-3


def shows(metrics: RunMetrics, transfers: Mapping[str, Transfer]) -> bool:
    """Return whether there is anything to draw: a response, a line or a frequency with power."""
    lines = any(line.gain for source in metrics.sources.values() for line in source.lines or [])
    return metrics.responses is not None or lines or powered(transfers)


def powered(transfers: Mapping[str, Transfer]) -> bool:
    """Return whether the truth has power at any frequency, without which there is no coherence with it."""
    return any(one.freq_hz.size for one in transfers.values())


def bode_figure(metrics: RunMetrics, transfers: Mapping[str, Transfer], colors: Mapping[str, str]) -> Figure:
    """Draw gain and phase over the truth, and coherence with it where there is power to judge it.

    Lines are responses: of a sensor as it is built, dotted as a filter believes where that is another. Points are what
    came out: of the commanded lines by least squares, between them by spectra where the coherence is above chance.

    Parameters
    ----------
    metrics : RunMetrics
        Of the run: lines, and the responses.
    transfers : Mapping
        Group (``sensors/mhd_ars``, ...) to what its readings or estimates are of the truth.
    colors : Mapping
        Group to color.
    """
    heights = [3, 3, 2] if powered(transfers) else [3, 3]
    with mpl.rc_context(STYLE):
        figure = Figure(figsize=(WIDTH_IN, 0.875 * sum(heights)))
        panels = figure.subplots(len(heights), 1, sharex=True, height_ratios=heights)
        gain, phase = panels[:2]
        marks = series_marks(colors)
        for group, response, style in _responses(metrics):
            _draw_response(gain, phase, metrics, response, _line_style(marks[group], colors[group], style))
        for group, transfer in transfers.items():
            if transfer.freq_hz.size:
                _draw_points(panels, transfer, colors[group], marks[group].marker)
            _draw_lines(gain, phase, metrics, group, (colors[group], marks[group].marker))
        _frame(panels)
        arrange(figure, _handles(metrics, transfers, colors), gap_in=0.2)
    return figure


def _responses(metrics: RunMetrics) -> Iterator[tuple[str, Response, Any]]:
    if metrics.responses is not None:
        for name, response in metrics.responses.sensors.items():
            yield f"sensors/{name}", response, "-"
        for belief in metrics.responses.beliefs:
            for name, response in belief.sensors.items():
                yield f"sensors/{name}", response, _BELIEVED


def _line_style(mark: Mark, color: str, dash: Any) -> dict[str, Any]:
    """Return the style of a response: dashes say whose it is, built or believed, marks of which sensor."""
    return marked(mark, color, _N_POINTS) | {"color": color, "linestyle": dash, "linewidth": 1.3}


def _draw_response(gain: Axes, phase: Axes, metrics: RunMetrics, response: Response, style: dict[str, Any]) -> None:
    assert metrics.responses is not None
    freq = np.array(metrics.responses.frequency_hz)[: len(response.gain)]
    gain.plot(freq, response.gain, **style)
    phase.plot(freq, response.phase_deg, **style)


def _draw_points(panels: Sequence[Axes], transfer: Transfer, color: str, marker: str) -> None:
    gain, phase, coherence = panels
    told = transfer.coherence > transfer.chance
    style: dict[str, Any] = {"color": color, "marker": marker, "linestyle": "none", "markersize": 3.4, "alpha": 0.8}
    gain.plot(transfer.freq_hz[told], np.abs(transfer.response[told]), **style)
    phase.plot(transfer.freq_hz[told], np.degrees(np.angle(transfer.response[told])), **style)
    coherence.plot(transfer.freq_hz, transfer.coherence, **style)


def _draw_lines(gain: Axes, phase: Axes, metrics: RunMetrics, group: str, look: tuple[str, str]) -> None:
    lines = [
        one for one in metrics.sources[group.split("/", 1)[1]].lines or [] if one.gain and one.phase_deg is not None
    ]
    style: dict[str, Any] = {
        "color": look[0],
        "marker": look[1],
        "linestyle": "none",
        "markersize": 8.0,
        "fillstyle": "none",
    }
    gain.plot([one.frequency_hz for one in lines], [one.gain or 0.0 for one in lines], **style)
    phase.plot([one.frequency_hz for one in lines], [one.phase_deg or 0.0 for one in lines], **style)


def _frame(panels: Sequence[Axes]) -> None:
    gain, phase, *coherence = panels
    gain.set_xscale("log")
    gain.set_yscale("log")
    low, high = gain.get_ylim()
    gain.set_ylim(max(low, _LEAST), high)
    decade_axis(gain)
    phase.set_yticks(range(-180, 181, 90))
    phase.set_ylim(-190, 190)
    for axes in coherence:
        axes.set_ylim(-0.04, 1.06)
    panels[-1].set_xlabel("frequency [Hz]")
    for axes, words in zip(panels, ("gain", "phase [deg]", "coherence"), strict=False):
        axes.set_ylabel(words)
        axes.grid(visible=True)
    frequency_axis(panels[-1])


def _handles(metrics: RunMetrics, transfers: Mapping[str, Transfer], colors: Mapping[str, str]) -> list[Line2D | Patch]:
    marks = series_marks(colors)
    handles: list[Line2D | Patch] = [
        Line2D([], [], color=color, label=label(group), **(marked(marks[group], color) | {"linestyle": "none"}))
        for group, color in ((group, colors[group]) for group in transfers)
    ]
    if metrics.responses is not None:
        handles.append(Line2D([], [], color=INK, linewidth=1.3, label="as built"))
        if metrics.responses.beliefs:
            handles.append(Line2D([], [], color=INK, linewidth=1.3, linestyle=_BELIEVED, label="as believed"))
    return handles
