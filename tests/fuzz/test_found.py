"""What the fuzz has found, each as one case by hand."""

from __future__ import annotations

import numpy as np
import pytest
from pydantic import ValidationError

from testbed.cli.app import app
from testbed.errors import MOST_QUOTED, ScenarioError
from testbed.fusion.filters.self_calibrating import SelfCalibratingParameters
from testbed.identification.session import identify_sensors
from testbed.logs import read_log
from testbed.logs.values import ValueScan
from tests.fuzz.texts import BASE, RESPONSE, STUDY


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


def test_a_sensor_whose_readings_are_beyond_all_rates_is_refused_and_named(tmp_path):
    head, *rows = RESPONSE.splitlines()
    lines = [f"{row}e60" for row in rows]
    (tmp_path / "log.csv").write_text("\n".join([head, *lines]) + "\n")
    with pytest.raises(ScenarioError, match=r"gyro: .*a reading may be damaged"):
        identify_sensors(read_log(tmp_path / "log.csv"), "laser", "gyro")


@pytest.mark.parametrize(
    "words",
    [
        ("replay", "x.csv", "--start", "9" * 5000),
        ("replay", "x.csv", "--settle", f"-{'9' * 5000} s"),
        ("replay", "x.csv", "--filter", f"{'x' * 5000},,"),
        ("sweep", "study.yaml", "--only", f"{'9' * 5000}:1"),
    ],
    ids=["start", "settle", "filter", "only"],
)
def test_an_option_is_not_echoed_whole(tmp_path, monkeypatch, words):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "base.yaml").write_text(BASE)
    (tmp_path / "study.yaml").write_text(STUDY)
    with pytest.raises(ScenarioError) as refused:
        app(list(words), standalone_mode=False)
    assert len(str(refused.value)) < 4 * MOST_QUOTED


def test_a_response_that_no_model_can_be_fitted_to_is_refused_and_named(tmp_path):
    """One reading at the end of the numbers, whose response is infinite; and a record that ends early."""
    head, *rows = RESPONSE.splitlines()
    damaged = [*rows[:24], rows[24].rpartition(",")[0] + ",1.7e308", *rows[25:]]
    for lines in (damaged, damaged[:162]):
        (tmp_path / "log.csv").write_text("\n".join([head, *lines]) + "\n")
        # Outside of the tests NumPy goes on where a number overflows.
        with np.errstate(all="ignore"), pytest.raises(ScenarioError, match="gyro"):
            identify_sensors(read_log(tmp_path / "log.csv"), "laser", "gyro")
