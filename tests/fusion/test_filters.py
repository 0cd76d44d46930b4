"""What every registered filter keeps to."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
import pytest
from pydantic import ValidationError

from testbed.errors import UnknownNameError
from testbed.fusion import FILTERS, estimate
from testbed.fusion.base import EstimateBlock, diagnostic_unit
from testbed.fusion.belief import default_belief
from testbed.parts import resolve

if TYPE_CHECKING:
    from testbed.signals import FloatArray

RATES = {"mems_gyro": 2000.0, "mhd_ars": 20000.0}
TWO_PATHS = {
    "complementary",
    "blending",
}  # fixed: two sensors, no covariance recursion, an innovation of the slow sensor only
N_TIME = 6007  # not a multiple of the stride, so blocks may end between gyro samples

pytestmark = [pytest.mark.contract, pytest.mark.parametrize("name", FILTERS)]


def _stage(name: str, **parameters: Any) -> Any:
    cls = resolve("filter", name, FILTERS)
    return cls(default_belief(), RATES, cls.Parameters(**parameters))


def _same(a: EstimateBlock, b: EstimateBlock) -> bool:
    arrays = [(a.rate, b.rate), (a.std, b.std), *((a.diagnostics[key], b.diagnostics[key]) for key in b.diagnostics)]
    return set(a.diagnostics) == set(b.diagnostics) and all(np.array_equal(x, y, equal_nan=True) for x, y in arrays)


def _joined(blocks: list[EstimateBlock]) -> EstimateBlock:
    diagnostics = {key: np.concatenate([b.diagnostics[key] for b in blocks]) for key in blocks[0].diagnostics}
    return EstimateBlock(np.concatenate([b.rate for b in blocks]), np.concatenate([b.std for b in blocks]), diagnostics)


@pytest.fixture(scope="module")
def readings(reference: Any) -> dict[str, FloatArray]:
    whole = reference.readings(reference.sines((10.0, 1.0), (0.5, 0.3), duration=0.5), 2)
    cut = {"mems_gyro": whole["mems_gyro"][: -(-N_TIME // 10)], "mhd_ars": whole["mhd_ars"][:N_TIME]}
    cut["mhd_ars"][3000:3050] = np.nan
    cut["mems_gyro"][400] = np.nan
    return cut


def test_estimate_is_finite_and_repeats_bit_for_bit(name: str, readings: dict[str, FloatArray]) -> None:
    before = {key: value.copy() for key, value in readings.items()}
    first, second = _stage(name).process(readings), _stage(name).process(readings)
    assert first.rate.shape == first.std.shape == (N_TIME,)
    assert all(array.shape == (N_TIME,) and array.dtype == np.float64 for array in first.diagnostics.values())
    assert np.all(np.isfinite(first.rate))
    assert np.all(first.std > 0.0)
    assert _same(first, second)
    assert all(np.array_equal(readings[key], before[key], equal_nan=True) for key in readings)


@pytest.mark.parametrize("size", [1, 7, 10, 999, 4096])
def test_any_division_into_blocks_gives_the_same_bits(name: str, size: int, readings: dict[str, FloatArray]) -> None:
    stage, blocks = _stage(name), []
    for start in range(0, N_TIME, size):
        stop = min(start + size, N_TIME)
        block = {
            "mhd_ars": readings["mhd_ars"][start:stop],
            "mems_gyro": readings["mems_gyro"][-(-start // 10) : -(-stop // 10)],
        }
        blocks.append(stage.process(block))
    assert _same(_joined(blocks), _stage(name).process(readings))


def test_read_only_inputs_and_an_empty_block_are_fine(name: str, readings: dict[str, FloatArray]) -> None:
    frozen = {key: value.copy() for key, value in readings.items()}
    for value in frozen.values():
        value.flags.writeable = False
    stage = _stage(name)
    assert stage.process({"mems_gyro": [], "mhd_ars": []}).rate.size == 0
    assert _same(stage.process(frozen), _stage(name).process(readings))


def test_missing_readings_mean_predict_only(name: str, readings: dict[str, FloatArray]) -> None:
    """Order 1 predicts the rate to stay; its variance grows by the q of the model at each step. Any order's grows."""
    stage = _stage(name)
    stage.process(readings)
    lost = {"mems_gyro": np.full(50, np.nan), "mhd_ars": np.full(493, np.inf)}
    block = stage.process({"mems_gyro": lost["mems_gyro"][:49], "mhd_ars": lost["mhd_ars"][:490]})
    assert np.all(np.isfinite(block.rate))
    assert np.all(np.diff(block.std) > 0.0)
    if getattr(stage.Parameters(), "order", None) == 1:
        assert np.unique(block.rate).size == 1
        np.testing.assert_allclose(np.diff(block.std**2), stage.model.Q[0, 0], rtol=1e-6)
    for sensor in ("mems_gyro",) if name in TWO_PATHS else RATES:
        assert np.all(np.isnan(block.diagnostics[f"innovation_{sensor}"]))
    # Not all the same: that would be a stuck sensor.
    quiet = 1e-5 * np.random.default_rng(1).standard_normal(500)
    after = stage.process({"mems_gyro": quiet[::10], "mhd_ars": quiet})
    assert np.all(np.isfinite(after.rate))
    assert after.std[-1] < block.std[-1]


def test_one_sensor_alone_and_all_missing_are_fine(name: str) -> None:
    cls = resolve("filter", name, FILTERS)
    if name in TWO_PATHS:
        with pytest.raises(ValueError, match="expected two sensors"):
            cls(default_belief(), {"mhd_ars": 20000.0}, cls.Parameters())
    else:
        alone = cls(default_belief(), {"mhd_ars": 20000.0}, cls.Parameters()).process({"mhd_ars": np.zeros(100)})
        assert np.all(np.isfinite(alone.rate))
    lost = _stage(name).process({"mems_gyro": np.full(10, np.nan), "mhd_ars": np.full(100, np.nan)})
    assert np.array_equal(lost.rate, np.zeros(100))
    # Where a settled error is added it is a thousandth of that, and adds in squares.
    wanted = np.radians(1.0) if name in TWO_PATHS else np.radians(np.hypot(20.0, 2.0))
    np.testing.assert_allclose(lost.std, wanted, rtol=1e-6 if name in TWO_PATHS else 1e-12)


def test_innovations_are_given_where_readings_are(name: str, readings: dict[str, FloatArray]) -> None:
    block = _stage(name).process(readings)
    due = np.full(N_TIME, np.nan)
    due[::10] = readings["mems_gyro"]
    if name in TWO_PATHS:
        # Blending leaves its loop alone while the fast sensor is missing.
        used = np.isfinite(due) & (np.isfinite(readings["mhd_ars"]) | (name == "complementary"))
        assert np.array_equal(np.isfinite(block.diagnostics["innovation_mems_gyro"]), used)
        return
    for sensor, values in (("mems_gyro", due), ("mhd_ars", readings["mhd_ars"])):
        assert np.array_equal(np.isfinite(block.diagnostics[f"innovation_{sensor}"]), np.isfinite(values))
        assert np.array_equal(np.isfinite(block.diagnostics[f"innovation_variance_{sensor}"]), np.isfinite(values))


def test_the_number_of_readings_is_checked(name: str, readings: dict[str, FloatArray]) -> None:
    stage = _stage(name)
    with pytest.raises(ValueError, match="expected 601 of 'mems_gyro'"):
        stage.process(readings | {"mems_gyro": readings["mems_gyro"][:-1]})
    with pytest.raises(ValueError, match="expected the sensors"):
        stage.process({"mhd_ars": readings["mhd_ars"]})
    with pytest.raises(ValueError, match="expected 601 of 'mems_gyro'"):
        stage.process(readings | {"mems_gyro": readings["mems_gyro"][:, None]})
    assert _same(stage.process(readings), _stage(name).process(readings)), "a refused block left a trace"


def test_estimate_runs_the_filter(name: str, readings: dict[str, FloatArray]) -> None:
    plain = {key: value.tolist() for key, value in readings.items()}
    assert _same(estimate(name, plain, sample_rate_hz=RATES), _stage(name).process(readings))
    assert _same(estimate(name, readings, sample_rate_hz=RATES, belief="eq39"), _stage(name).process(readings))
    own = {
        "wideband": {"q": "1e5 (deg/s)^2/s^5"},
        **{fixed: {"frequency": "20 Hz"} for fixed in ("steady_state", *TWO_PATHS)},
    }
    chosen = own.get(name, {"q": "0.02 (deg/s)^2/s"})
    assert _same(estimate(name, readings, sample_rate_hz=RATES, **chosen), _stage(name, **chosen).process(readings))
    with pytest.raises(ValidationError, match="colour"):
        estimate(name, readings, sample_rate_hz=RATES, colour=1)
    with pytest.raises(UnknownNameError, match=f"did you mean '{name}'"):
        estimate(name + "x", readings, sample_rate_hz=RATES)


def test_the_order_of_the_sensors_does_not_matter(name: str, readings: dict[str, FloatArray]) -> None:
    a = estimate(name, readings, sample_rate_hz=RATES)
    b = estimate(name, readings, sample_rate_hz=dict(reversed(RATES.items())))
    # Only the order of the two scalar updates differs; P starts 1e8 above what they leave.
    np.testing.assert_allclose(a.rate, b.rate, rtol=0, atol=1e-7 * np.radians(1.0))


def test_diagnostics_have_units(name: str, readings: dict[str, FloatArray]) -> None:
    units = {"innovation": "rad/s", "variance": "rad^2/s^2", "R": "rad^2/s^2", "N": "rad^2/s^2", "Q": "rad^2/s^2"}
    for key in _stage(name).process(readings).diagnostics:
        stem = "variance" if key.startswith("innovation_variance") else key.split("_")[0]
        assert diagnostic_unit(key) == units.get(stem, "1")


def test_parameters_survive_a_yaml_round_trip(name: str) -> None:
    parameters = resolve("filter", name, FILTERS).Parameters()
    dumped = parameters.model_dump(mode="json", context={"border": True})
    assert type(parameters).model_validate(dumped, context={"border": True}) == parameters
    if hasattr(parameters, "q"):
        assert type(parameters).model_json_schema()["properties"]["q"]["type"] == "string"
