from __future__ import annotations

from itertools import combinations

import numpy as np
import pytest

from testbed.pages.palette import COMMANDED, FILTERS, SENSORS, TRUTH, mix, rgb, series_colors

COLORS = (COMMANDED, TRUTH, *SENSORS, *FILTERS)


def luminance(color):
    """Relative luminance of WCAG 2.2, https://www.w3.org/TR/WCAG22/#dfn-relative-luminance."""
    share = np.array(rgb(color)) / 255
    linear = np.where(share <= 0.04045, share / 12.92, ((share + 0.055) / 1.055) ** 2.4)
    return float(linear @ [0.2126, 0.7152, 0.0722])


@pytest.mark.oracle
@pytest.mark.parametrize("color", COLORS)
def test_colors_stand_out_on_white_and_on_the_viewers_dark_background(color):
    # 3:1 is what WCAG 2.2, criterion 1.4.11, asks of graphics.
    assert 1.05 / (luminance(color) + 0.05) >= 3.0
    assert (luminance(color) + 0.05) / (luminance("#0d1011") + 0.05) >= 3.0


def test_colors_of_the_usual_run_are_far_apart():
    used = (COMMANDED, TRUTH, *SENSORS[:2], *FILTERS[:3])
    for one, other in combinations(used, 2):
        assert np.linalg.norm(np.subtract(rgb(one), rgb(other))) > 35, (one, other)


def test_series_colors_go_by_order_and_start_again():
    filters = [f"f{i}" for i in range(len(FILTERS) + 1)]
    colors = series_colors(["a", "b"], filters)
    assert colors["commanded"] == COMMANDED
    assert colors["truth"] == TRUTH
    assert colors["sensors/b"] == SENSORS[1]
    assert colors["fusion/f0"] == colors[f"fusion/{filters[-1]}"] == FILTERS[0]
    assert len(colors) == 2 + 2 + len(filters)


def test_mix_ends_at_its_two_colors():
    assert mix("#102030", "#405060", 0.0) == "#102030"
    assert mix("#102030", "#405060", 1.0) == "#405060"
    assert mix("#000000", "#ff8000", 0.5) == "#804000"
