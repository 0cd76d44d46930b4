"""The figure of the recipe in CONTRIBUTING.md."""

from __future__ import annotations

import numpy as np
import pytest

import testbed
from tests.examples.test_examples import load
from tests.scenes import short

own_figure = load("own_figure")


@pytest.mark.oracle
def test_rms_below_a_frequency_is_the_integral_of_both_halves():
    """Densities 1 and f are integrated to sqrt(2 (f - f0)) and sqrt(f^2 - f0^2), exactly by trapezoids."""
    freq = np.array([1.0, 2.0, 5.0, 30.0])
    np.testing.assert_allclose(own_figure.rms_below(freq, np.ones(4)), np.sqrt(2.0 * (freq - 1.0)), rtol=1e-14)
    np.testing.assert_allclose(own_figure.rms_below(freq, freq), np.sqrt(freq**2 - 1.0), rtol=1e-14)


def test_the_figure_has_a_line_for_each_filter(tmp_path):
    run = testbed.run(short(tmp_path), out=tmp_path / "run")
    own_figure.main(str(run.folder), str(tmp_path / "own.svg"))
    text = (tmp_path / "own.svg").read_text()
    assert text.startswith("<svg")
    assert "NaN" not in text
