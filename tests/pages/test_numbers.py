from __future__ import annotations

import re

import pytest

from testbed.pages.numbers import bounded, decimals_for


@pytest.mark.parametrize(
    ("value", "half", "text"),
    [
        (1.00163, 0.00042, "1.0016 ± 0.0004"),
        (1.00163, 0.00142, "1.0016 ± 0.0014"),
        (0.02, 0.53, "0.0 ± 0.5"),
        (-66.13, 12.2, "−66 ± 12"),
        (123.4, 56.0, "123 ± 56"),
        (0.98312, 3e-9, "0.983120"),
        (0.98312, None, "0.9831"),
        (None, 0.1, "—"),
        (0.5, float("inf"), "0.5000"),
    ],
)
def test_the_digits_of_a_number_follow_its_interval(value, half, text):
    assert bounded(value, half) == text


@pytest.mark.parametrize(
    ("half", "decimals"), [(0.1, 2), (0.2, 1), (0.99, 1), (1.0, 1), (2.0, 0), (37.0, 0), (1e-9, 6)]
)
def test_the_first_digit_of_the_half_width_is_the_last_shown_and_two_where_it_is_a_one(half, decimals):
    assert decimals_for(half) == decimals


def test_no_template_types_the_number_of_a_figure():
    from pathlib import Path

    import testbed.pages

    templates = (Path(testbed.pages.__file__).parent / "templates").glob("*.j2")
    assert [path.name for path in templates if re.search(r"Figure \d", path.read_text(encoding="utf-8"))] == []
