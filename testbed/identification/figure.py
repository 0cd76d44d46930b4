"""A measured response drawn: gain and phase with their intervals and the fit, coherence, and the noise beside it."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import matplotlib as mpl
import numpy as np
from matplotlib.figure import Figure

from testbed.pages.axes import marked
from testbed.pages.palette import color_of, series_marks
from testbed.pages.svg import STYLE
from testbed.units import DEG

if TYPE_CHECKING:
    from collections.abc import Sequence

    from matplotlib.axes import Axes

    from testbed.identification.session import Identification
    from testbed.pages.palette import Mark

_SIZE_IN = (7.0, 9.0)
_CURVE = 400


def response_figure(found: Sequence[Identification]) -> Figure:
    """Draw responses.

    Parameters
    ----------
    found : sequence of Identification
        Each in the colour, dashes and mark of its name.

    Returns
    -------
    Figure
        Gain [-], phase [deg], share of the output that does not follow [-], root density of the noise [deg/s/sqrt(Hz)];
        points with 95 % intervals, fits as lines.
    """
    with mpl.rc_context(STYLE):
        figure = Figure(figsize=_SIZE_IN, layout="constrained")
        axes = figure.subplots(4, 1, sharex=True, height_ratios=(3, 3, 1.6, 2.4))
        marks = series_marks(f"sensors/{one.name}" for one in found)
        for one in found:
            _draw(axes, one, marks[f"sensors/{one.name}"])
        gain, phase, rest, noise = axes
        gain.set(xscale="log", yscale="log", ylabel="gain [-]")
        phase.set(ylabel="phase [deg]")
        rest.set(yscale="log", ylabel="1 - coherence [-]")
        noise.set(yscale="log", ylabel="noise, two-sided\n[deg/s/√Hz]", xlabel="frequency [Hz]")
        gain.legend(loc="best", fontsize=7.5)
        for one in axes:
            one.grid(visible=True, which="major")
    return figure


def _draw(axes: Sequence[Axes], one: Identification, mark: Mark) -> None:
    gain, phase, rest, noise = axes
    response, color = one.measured.response, color_of(f"sensors/{one.name}")
    freq = response.freq_hz
    half_gain, half_phase = response.half_widths
    name = one.name.replace("$", "")
    points: dict[str, Any] = {"color": color, **marked(mark, color), "linestyle": "none"}
    bars: dict[str, Any] = {"fmt": "none", "elinewidth": 0.9, "ecolor": color}
    line: dict[str, Any] = {"color": color, "linewidth": 0.9, "alpha": 0.6, "linestyle": mark.dash}
    gain.errorbar(freq, response.gain, half_gain, **bars)
    gain.plot(freq, response.gain, label=f"{name}, points with 95 %", **points)
    curve = np.geomspace(freq[0], freq[-1], _CURVE)
    fitted = one.model.response(curve)
    gain.plot(curve, np.abs(fitted), label=f"{name}, fit", **line)
    turned = np.unwrap(response.phase)
    phase.errorbar(freq, turned / DEG, half_phase / DEG, **bars)
    phase.plot(freq, turned / DEG, **points)
    # The fit turns with the points, by whole turns at the most.
    followed = np.unwrap(np.angle(fitted))
    followed += 2.0 * np.pi * np.rint((turned[0] - followed[0]) / (2.0 * np.pi))
    phase.plot(curve, followed / DEG, **line)
    rest.plot(freq, np.maximum(1.0 - response.coherence, 1e-16), **points)
    floor = one.floor
    known = floor.density > 0.0
    noise.plot(floor.freq_hz[known], np.sqrt(floor.density[known]) / DEG, **points)
    at = np.geomspace(floor.freq_hz[0], floor.freq_hz[-1], _CURVE)
    density = one.noise.density(at, np.abs(one.model.response(at)))
    noise.plot(at, np.sqrt(density) / DEG, **line)
