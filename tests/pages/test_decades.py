"""Marks of logarithmic axes: where matplotlib's own would be, whatever the limits become."""

from __future__ import annotations

import matplotlib as mpl
import numpy as np
import pytest
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.ticker import LogLocator
from numpy.testing import assert_allclose, assert_array_equal

from testbed.pages.decades import Multiples, decade_axis, frequency_axis, label_powers
from testbed.pages.svg import STYLE


def marks(axes):
    """Return by name of the axis where its marks are."""
    return {one._axis.axis_name: one.places() for one in axes.get_children() if isinstance(one, Multiples)}


@pytest.mark.oracle
def test_marks_are_where_minor_ticks_would_be():
    figure = Figure()
    upper, lower = figure.subplots(2, 1, sharex=True)
    for axes in (upper, lower):
        axes.set(xscale="log", yscale="log", ylim=(3e-4, 2.0))
        decade_axis(axes)
    frequency_axis(lower)
    for limits in ((0.5, 700.0), (20.0, 90.0), (1e-6, 1e3)):
        lower.set_xlim(*limits)
        for axes in (upper, lower):
            found = marks(axes)
            for name, (low, high) in {"x": limits, "y": (3e-4, 2.0)}.items():
                expected = np.array(LogLocator(subs=np.arange(2.0, 10.0), numticks=100).tick_values(low, high))
                own = expected[(expected >= low) & (expected <= high)]
                assert_allclose(found[name], own[np.log10(own) % 1.0 > 1e-9], rtol=1e-12)


@pytest.mark.oracle
@pytest.mark.parametrize("along", ["x", "y"])
def test_the_picture_is_that_of_matplotlibs_own_ticks(along):
    """To the pixel, in the house style."""
    pictures = []
    for own in (True, False):
        with mpl.rc_context(STYLE):
            figure = Figure(figsize=(4, 3), dpi=100)
            axes = figure.subplots()
            axes.set(xscale="log", yscale="log", xlim=(0.3, 100.0), ylim=(2e-3, 1.0))
            axis = axes.xaxis if along == "x" else axes.yaxis
            label_powers(axis)
            if own:
                axis.set_minor_locator(LogLocator(subs=np.arange(2.0, 10.0)))
                next(one for one in axes.get_children() if isinstance(one, Multiples)).remove()
            canvas = FigureCanvasAgg(figure)
            canvas.draw()
            pictures.append(np.asarray(canvas.buffer_rgba()))
    assert_array_equal(*pictures)


def test_twenty_powers_of_ten_have_no_marks_between():
    axes = Figure().subplots()
    axes.set(xscale="log", xlim=(1e-10, 1e10))
    frequency_axis(axes)
    assert marks(axes)["x"].size == 0
