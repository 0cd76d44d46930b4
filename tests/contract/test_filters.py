"""What every registered filter keeps to, and the example of one's own."""

from __future__ import annotations

import inspect
from dataclasses import replace
from itertools import pairwise
from typing import TYPE_CHECKING

import numpy as np
import pytest
from pydantic import ValidationError

from testbed.errors import UnknownNameError
from testbed.fusion import FILTERS, estimate
from testbed.fusion.analysis.indicator import FREQUENCY
from testbed.fusion.base import BlockFilter, diagnostic_unit
from testbed.fusion.model_filter import ModelFilter
from tests.contract.records import BELIEF, METHODS, NAMES, RATES, built, joined, named, readings_of, sines

if TYPE_CHECKING:
    from testbed.fusion.base import EstimateBlock
    from testbed.signals import FloatArray

N_TIME = 6007  # not a multiple of the stride, so blocks may end between gyro samples

pytestmark = [pytest.mark.contract, pytest.mark.parametrize("name", NAMES)]


def same(a: EstimateBlock, b: EstimateBlock) -> bool:
    arrays = [(a.rate, b.rate), (a.std, b.std), *((a.diagnostics[key], b.diagnostics[key]) for key in b.diagnostics)]
    return set(a.diagnostics) == set(b.diagnostics) and all(np.array_equal(x, y, equal_nan=True) for x, y in arrays)


def bare(block: EstimateBlock) -> EstimateBlock:
    """Return a block without the frequencies that `estimate` puts beside what the filter says of itself."""
    own = {key: value for key, value in block.diagnostics.items() if not key.startswith(FREQUENCY)}
    return replace(block, diagnostics=own)


@pytest.fixture(scope="module")
def readings() -> dict[str, FloatArray]:
    whole = readings_of(sines((10.0, 1.0), (0.5, 0.3), duration=0.5), 2)
    cut = {"mems_gyro": whole["mems_gyro"][: -(-N_TIME // 10)].copy(), "mhd_ars": whole["mhd_ars"][:N_TIME].copy()}
    cut["mhd_ars"][3000:3050] = np.nan
    cut["mems_gyro"][400] = np.nan
    for values in cut.values():
        values.flags.writeable = False
    return cut


def test_estimate_is_finite_and_repeats_bit_for_bit(name: str, readings: dict[str, FloatArray]) -> None:
    before = {key: value.copy() for key, value in readings.items()}
    first, second = built(name).process(readings), built(name).process(readings)
    assert first.rate.shape == first.std.shape == (N_TIME,)
    assert all(array.shape == (N_TIME,) and array.dtype == np.float64 for array in first.diagnostics.values())
    assert np.all(np.isfinite(first.rate))
    assert np.all(np.isfinite(first.std))
    assert np.all(first.std > 0.0)
    assert same(first, second)
    assert all(np.array_equal(readings[key], before[key], equal_nan=True) for key in readings)


@pytest.mark.parametrize(
    "sizes",
    [[1, 9, 13, 1977, 4007], [1] * 100 + [5907], [7] * 858 + [1], [10] * 600 + [7], [999] * 6 + [13]],
    ids=["uneven", "1", "7", "10", "999"],
)
def test_any_division_into_blocks_gives_the_same_bits(
    name: str, sizes: list[int], readings: dict[str, FloatArray]
) -> None:
    stage, blocks = built(name), []
    for a, b in pairwise(np.cumsum([0, *sizes])):
        block = {"mhd_ars": readings["mhd_ars"][a:b], "mems_gyro": readings["mems_gyro"][-(-a // 10) : -(-b // 10)]}
        blocks.append(stage.process(block))
    assert same(joined(blocks), built(name).process(readings))


def test_an_empty_block_changes_nothing(name: str, readings: dict[str, FloatArray]) -> None:
    stage = built(name)
    assert stage.process({"mems_gyro": [], "mhd_ars": []}).rate.size == 0
    assert same(stage.process(readings), built(name).process(readings))


def test_a_blank_block_has_what_a_filled_one_has(name: str, readings: dict[str, FloatArray]) -> None:
    """What is foretold of a run, such as its size, is foretold without compiling the filter."""
    stage = built(name)
    blank, filled = stage.blank(N_TIME), stage.process(readings)
    assert list(blank.diagnostics) == list(filled.diagnostics)
    assert all(values.shape == (N_TIME,) for values in (blank.rate, blank.std, *blank.diagnostics.values()))
    assert np.isnan(blank.rate).all()
    assert 0.0 < stage.step_seconds < 1e-3
    assert same(built(name).process(readings), filled)


def test_missing_readings_mean_predict_only(name: str, readings: dict[str, FloatArray]) -> None:
    """What is claimed grows with every step, at least to 1 deg/s, never shrinks, and shrinks with readings."""
    stage = built(name)
    stage.process(readings)
    lost = {"mems_gyro": np.full(49, np.nan), "mhd_ars": np.full(490, np.inf)}
    block = stage.process(lost)
    assert np.all(np.isfinite(block.rate))
    growth = np.diff(block.std)
    assert np.all(growth[block.std[:-1] < np.radians(1.0)] > 0.0)
    assert np.all(growth > -1e-12)
    # Not all the same: that would be a stuck sensor.
    quiet = 1e-5 * np.random.default_rng(1).standard_normal(500)
    after = stage.process({"mems_gyro": quiet[::10], "mhd_ars": quiet})
    assert np.all(np.isfinite(after.rate))
    assert after.std[-1] < block.std[-1]


def test_a_random_walk_stays_where_it_was(name: str, readings: dict[str, FloatArray]) -> None:
    """Order 1 predicts the rate to stay; its variance grows by the q of the model at each step."""
    stage = built(name)
    if not isinstance(stage, ModelFilter) or stage.Parameters().order != 1:
        pytest.skip("predicts by another model")
    stage.process(readings)
    block = stage.process({"mems_gyro": np.full(49, np.nan), "mhd_ars": np.full(490, np.nan)})
    assert np.unique(block.rate).size == 1
    np.testing.assert_allclose(np.diff(block.std**2), stage.model.Q[0, 0], rtol=1e-6)


def test_without_a_reading_nothing_is_known(name: str) -> None:
    lost = built(name).process({"mems_gyro": np.full(10, np.nan), "mhd_ars": np.full(100, np.nan)})
    assert not lost.rate.any()
    # 1 deg/s at the start, to rounding.
    assert np.all(lost.std >= (1.0 - 1e-9) * np.radians(1.0))


def test_it_takes_one_sensor_alone_unless_it_needs_both(name: str) -> None:
    method, alone = METHODS[name], {"mhd_ars": 20000.0}
    if method.needs_both:
        for rates in (alone, RATES | {"third": 2000.0}):
            with pytest.raises(ValueError, match="expected two sensors"):
                method(BELIEF | {"third": BELIEF["mems_gyro"]}, rates, method.Parameters())
    else:
        block = method(BELIEF, alone, method.Parameters()).process({"mhd_ars": np.zeros(100)})
        assert np.all(np.isfinite(block.rate))


def test_innovations_are_given_where_readings_are(name: str, readings: dict[str, FloatArray]) -> None:
    """Of the sensors that it shows: nowhere without a reading, and wherever both have one."""
    block = built(name).process(readings)
    due = {key: np.full(N_TIME, np.nan) for key in RATES}
    due["mhd_ars"][:], due["mems_gyro"][::10] = readings["mhd_ars"], readings["mems_gyro"]
    other = {"mhd_ars": "mems_gyro", "mems_gyro": "mhd_ars"}
    for key, values in block.diagnostics.items():
        if key.startswith("innovation"):
            sensor = key.removeprefix("innovation_").removeprefix("variance_")
            given, there = np.isfinite(values), np.isfinite(due[sensor])
            both = there & (np.isfinite(due[other[sensor]]) | (sensor == "mhd_ars"))
            assert not np.any(given & ~there), key
            assert np.all(given[both]), key


def test_the_number_of_readings_is_checked(name: str, readings: dict[str, FloatArray]) -> None:
    stage = built(name)
    with pytest.raises(ValueError, match="expected 601 of 'mems_gyro'"):
        stage.process(readings | {"mems_gyro": readings["mems_gyro"][:-1]})
    with pytest.raises(ValueError, match="expected the sensors"):
        stage.process({"mhd_ars": readings["mhd_ars"]})
    with pytest.raises(ValueError, match="expected 601 of 'mems_gyro'"):
        stage.process(readings | {"mems_gyro": readings["mems_gyro"][:, None]})
    assert same(stage.process(readings), built(name).process(readings)), "a refused block left a trace"


def test_estimate_runs_the_filter(name: str, readings: dict[str, FloatArray]) -> None:
    wanted = built(name).process(readings)
    plain = {key: value.tolist() for key, value in readings.items()}
    assert same(bare(estimate(named(name), plain, sample_rate_hz=RATES)), wanted)
    written = METHODS[name].Parameters().model_dump(mode="json", context={"border": True}, exclude_none=True)
    assert same(bare(estimate(named(name), readings, sample_rate_hz=RATES, belief="eq39", **written)), wanted)
    with pytest.raises(ValidationError, match="colour"):
        estimate(named(name), readings, sample_rate_hz=RATES, colour=1)
    if name in FILTERS:
        with pytest.raises(UnknownNameError, match=f"did you mean '{name}'"):
            estimate(name + "x", readings, sample_rate_hz=RATES)


def test_the_order_of_the_sensors_does_not_matter(name: str, readings: dict[str, FloatArray]) -> None:
    a = estimate(named(name), readings, sample_rate_hz=RATES)
    b = estimate(named(name), readings, sample_rate_hz=dict(reversed(RATES.items())))
    # Only the order of the two scalar updates differs; P starts 1e8 above what they leave.
    np.testing.assert_allclose(a.rate, b.rate, rtol=0, atol=1e-7 * np.radians(1.0))


def test_diagnostics_have_units(name: str, readings: dict[str, FloatArray]) -> None:
    units = {"innovation": "rad/s", "variance": "rad^2/s^2", "R": "rad^2/s^2", "N": "rad^2/s^2", "Q": "rad^2/s^2"}
    units |= {"delay": "s"}
    for key in built(name).process(readings).diagnostics:
        stem = "variance" if key.startswith("innovation_variance") else key.split("_")[0]
        assert diagnostic_unit(key) == units.get(stem, "1")


def test_parameters_survive_the_round_trip_through_their_resolved_form(name: str) -> None:
    model = METHODS[name].Parameters
    for without_none in (False, True):
        written = model().model_dump(mode="json", context={"border": True}, exclude_none=without_none)
        assert model.model_validate(written, context={"border": True}) == model()
    if "q" in model.model_fields:
        assert model.model_json_schema()["properties"]["q"]["type"] == "string"


def test_it_is_a_block_filter_that_cites_its_source(name: str) -> None:
    assert issubclass(METHODS[name], BlockFilter)
    assert "References" in (inspect.getdoc(METHODS[name]) or "")
