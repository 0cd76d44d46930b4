"""Logarithmic axes: a label at every power of ten, and a mark at each of its multiples."""

from __future__ import annotations

from typing import TYPE_CHECKING

import matplotlib as mpl
import numpy as np
from matplotlib.artist import Artist
from matplotlib.axis import YAxis
from matplotlib.lines import Line2D
from matplotlib.ticker import FuncFormatter, LogLocator, NullFormatter, NullLocator

from testbed.pages.numbers import decade, plain

if TYPE_CHECKING:
    from collections.abc import Callable

    from matplotlib.axes import Axes
    from matplotlib.axis import Axis
    from matplotlib.backend_bases import RendererBase

    from testbed.signals import FloatArray

# From one end of an axis to the other, over ten powers of ten, marks between them would be a bar.
_MOST = 1e10
_MULTIPLES = np.arange(2.0, 10.0)


class Multiples(Artist):
    """Marks at 2 to 9 times the powers of ten of an axis, wherever its limits are when it is drawn.

    They are drawn as one line: matplotlib's own ticks are five objects each, and a report has hundreds of them.

    Parameters
    ----------
    axis : Axis
        The x or y axis of some axes.
    """

    zorder = 2.01

    def __init__(self, axis: Axis) -> None:
        super().__init__()
        self._axis, axes = axis, axis.axes
        upright = isinstance(axis, YAxis)
        # Both axes have the same ticks in every style of ours.
        size, width, color = (mpl.rcParams[key] for key in ("xtick.minor.size", "xtick.minor.width", "xtick.color"))
        self._line = Line2D([], [], linestyle="none", markersize=size, markeredgewidth=width, color=color)
        self._line.set_marker(0 if upright else 3)  # to the left, down
        self._line.set_transform(axes.get_yaxis_transform("tick1") if upright else axes.get_xaxis_transform("tick1"))
        self._line.set_figure(axes.figure)
        axes.add_artist(self)
        self.set_in_layout(False)

    def places(self) -> FloatArray:
        """Return where on the axis they are now, shape (n_mark,)."""
        low, high = sorted(self._axis.get_view_interval())
        if high > low * _MOST:
            return np.empty(0)
        powers = 10.0 ** np.arange(np.floor(np.log10(low)), np.ceil(np.log10(high)))
        along = np.outer(powers, _MULTIPLES).ravel()
        return along[(along >= low) & (along <= high)]

    def draw(self, renderer: RendererBase) -> None:
        """Draw them."""
        along = self.places()
        across = np.zeros(along.size)
        self._line.set_data(*((across, along) if isinstance(self._axis, YAxis) else (along, across)))
        self._line.draw(renderer)


def label_powers(axis: Axis, words: Callable[[float], str] | None = None, *, most: int | None = None) -> None:
    """Label the powers of ten of a logarithmic axis, and mark what lies between them.

    Not by matplotlib's own formatter, which typesets every power as a formula.

    Parameters
    ----------
    axis : Axis
        The x or y axis of some axes; what shares it is marked too.
    words : callable, optional
        What a power is called; else all are in one way of writing.
    most : int, optional
        Labels.
    """
    called = words or (lambda value: decade(value, axis.get_view_interval()))
    axis.set_major_formatter(FuncFormatter(lambda value, _: called(value)))
    axis.set_minor_locator(NullLocator())
    axis.set_minor_formatter(NullFormatter())
    if most is not None:
        axis.set_major_locator(LogLocator(numticks=most))
    upright, axes = isinstance(axis, YAxis), axis.axes
    for each in (axes.get_shared_y_axes() if upright else axes.get_shared_x_axes()).get_siblings(axes):
        Multiples(each.yaxis if upright else each.xaxis)


def frequency_axis(axes: Axes, words: Callable[[float], str] = plain) -> None:
    """Label every power of ten of a logarithmic x axis.

    Parameters
    ----------
    axes : Axes
        Whose x axis it is.
    words : callable, optional
        What a power is called.
    """
    label_powers(axes.xaxis, words, most=20)


def decade_axis(axes: Axes) -> None:
    """Label the powers of ten of a logarithmic y axis whose limits stand, and 2 and 5 times them where fewer than two
    are seen.

    Parameters
    ----------
    axes : Axes
        Whose y axis it is.
    """
    low, high = np.log10(axes.get_ylim())
    label_powers(axes.yaxis)
    if np.floor(high) - np.ceil(low) < 1.0:
        axes.yaxis.set_minor_locator(LogLocator(subs=(2.0, 5.0)))
        axes.yaxis.set_minor_formatter(axes.yaxis.get_major_formatter())
