"""What the fuzz has found, each as one case by hand."""

from __future__ import annotations

import numpy as np
import pytest
from pydantic import ValidationError

from testbed.errors import MOST_QUOTED
from testbed.fusion.filters.self_calibrating import SelfCalibratingParameters
from testbed.logs.values import ValueScan


@pytest.mark.parametrize(
    "inner", [{"x" * 300: {}}, {"wideband": {"x" * 300: 1}}, {"wideband": dict.fromkeys("abcdefghij", 1)}]
)
def test_names_inside_a_nested_filter_are_not_echoed_whole(inner):
    with pytest.raises(ValidationError) as refused:
        SelfCalibratingParameters(filter=inner)
    (found,) = refused.value.errors()
    assert "x" * (MOST_QUOTED + 1) not in found["msg"]
    assert found["msg"].count("Extra inputs") <= 5


@pytest.mark.parametrize("size", [1e160, 1e300])
def test_a_channel_of_numbers_whose_squares_overflow_has_no_finite_scatter(size):
    scan = ValueScan()
    scan.add(np.array([0.0, size, -size, np.nan, 1.0]))
    found = scan.result()
    assert (found.low, found.high, found.n_missing) == (-size, size, 1)
    assert found.std == np.inf
