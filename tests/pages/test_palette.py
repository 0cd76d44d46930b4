from __future__ import annotations

from itertools import combinations

import numpy as np
import pytest

from testbed.fusion import FILTERS as REGISTERED
from testbed.pages.palette import COMMANDED, FILTERS, NAMED, SENSORS, TRUTH, color_of, mix, rgb, series_colors
from testbed.sensors import SENSORS as INSTRUMENTS

OWN = [f"{kind}/name_{i}" for kind in ("sensors", "fusion") for i in range(40)]
COLORS = sorted({COMMANDED, TRUTH, *SENSORS, *FILTERS, *NAMED.values(), *map(color_of, OWN)})


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


def test_a_colour_belongs_to_a_name_not_to_a_position():
    one = series_colors(["mhd_ars", "mine"], ["kalman", "shakf", "my_filter"])
    other = series_colors(["mine", "mems_gyro"], ["my_filter", "wideband", "kalman"])
    assert one["commanded"] == COMMANDED
    assert one["truth"] == TRUTH
    for key in set(one) & set(other):
        assert one[key] == other[key]
    assert len(one) == 2 + 2 + 3


def test_what_ships_has_a_colour_of_its_own():
    shipped = [*(f"sensors/{name}" for name in INSTRUMENTS), *(f"fusion/{name}" for name in REGISTERED)]
    colors = [color_of(key) for key in shipped]
    for one, other in combinations(colors, 2):
        assert np.linalg.norm(np.subtract(rgb(one), rgb(other))) > 30, (one, other)


def test_names_of_ones_own_are_told_apart_and_keep_to_the_hues_of_their_kind():
    assert len({color_of(key) for key in OWN}) > 0.9 * len(OWN)
    sensors = [rgb(color_of(key)) for key in OWN if key.startswith("sensors/")]
    assert all(blue > red for red, _, blue in sensors)


def test_mix_ends_at_its_two_colors():
    assert mix("#102030", "#405060", 0.0) == "#102030"
    assert mix("#102030", "#405060", 1.0) == "#405060"
    assert mix("#000000", "#ff8000", 0.5) == "#804000"
