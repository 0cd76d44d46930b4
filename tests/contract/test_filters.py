"""Every registered filter keeps the contract of the fusion room."""

from __future__ import annotations

import inspect
from itertools import pairwise

import numpy as np
import pytest

from testbed.fusion import FILTERS
from testbed.fusion.belief import load_belief
from testbed.parts import resolve

RATES = {"mhd_ars": 20_000.0, "mems_gyro": 2_000.0}

pytestmark = pytest.mark.contract


def readings(n=4_000, seed=2):
    """Plausible readings: a sine with white noise, a tenth as many from the gyro."""
    rng = np.random.default_rng(seed)
    t = np.arange(n) / RATES["mhd_ars"]
    rate = 0.017 * np.sin(2 * np.pi * 10 * t)
    arrays = {
        "mhd_ars": rate + 1.4e-5 * rng.standard_normal(n),
        "mems_gyro": (0.4 * rate + 1e-4 * rng.standard_normal(n))[::10],
    }
    for array in arrays.values():
        array.flags.writeable = False
    return arrays


def built(name):
    factory = resolve("filter", name, FILTERS)
    return factory(load_belief("eq39"), RATES, factory.Parameters())


@pytest.mark.parametrize("name", FILTERS)
def test_estimates_are_finite_complete_and_repeatable(name):
    first, again = built(name).process(readings()), built(name).process(readings())
    assert first.rate.shape == first.std.shape == (4_000,)
    assert np.isfinite(first.rate).all()
    assert np.isfinite(first.std).all()
    assert np.all(first.std > 0)
    assert np.array_equal(first.rate, again.rate)
    assert np.array_equal(first.std, again.std)
    assert all(values.shape == (4_000,) and values.dtype == np.float64 for values in first.diagnostics.values())


@pytest.mark.parametrize("name", FILTERS)
@pytest.mark.parametrize("sizes", [[1, 9, 13, 1977, 2000], [777] * 5 + [115]], ids=["uneven", "odd"])
def test_any_blocks_give_the_same_bits(name, sizes):
    whole, parts = built(name).process(readings()), built(name)
    cuts = np.cumsum([0, *sizes])
    arrays = readings()
    blocks = [
        parts.process({"mhd_ars": arrays["mhd_ars"][a:b], "mems_gyro": arrays["mems_gyro"][-(-a // 10) : -(-b // 10)]})
        for a, b in pairwise(cuts)
    ]
    assert np.array_equal(np.concatenate([b.rate for b in blocks]), whole.rate)
    assert np.array_equal(np.concatenate([b.std for b in blocks]), whole.std)
    for key, values in whole.diagnostics.items():
        assert np.array_equal(np.concatenate([b.diagnostics[key] for b in blocks]), values, equal_nan=True), key


@pytest.mark.parametrize("name", FILTERS)
def test_a_nan_reading_means_predict_only(name):
    """Without readings the uncertainty grows and nothing breaks; with them again the filter recovers."""
    arrays = {key: values.copy() for key, values in readings().items()}
    arrays["mhd_ars"][2000:2400] = np.nan
    arrays["mems_gyro"][200:240] = np.nan
    block = built(name).process(arrays)
    assert np.isfinite(block.rate).all()
    assert np.all(np.diff(block.std[2000:2400]) > 0)
    assert block.std[2400] < block.std[2399]


@pytest.mark.parametrize("name", FILTERS)
def test_readings_of_nothing_but_nan_give_the_prior(name):
    block = built(name).process({"mhd_ars": np.full(100, np.nan), "mems_gyro": np.full(10, np.nan)})
    assert not block.rate.any()
    assert np.isfinite(block.std).all()


@pytest.mark.parametrize("name", FILTERS)
def test_a_wrong_number_of_readings_is_refused(name):
    arrays = readings()
    with pytest.raises(ValueError, match="readings: expected"):
        built(name).process({"mhd_ars": arrays["mhd_ars"], "mems_gyro": arrays["mems_gyro"][:-1]})
    with pytest.raises(ValueError, match="readings: expected"):
        built(name).process({"mhd_ars": arrays["mhd_ars"]})


@pytest.mark.parametrize("name", FILTERS)
def test_filter_cites_its_source(name):
    assert "References" in (inspect.getdoc(resolve("filter", name, FILTERS)) or "")


@pytest.mark.parametrize("name", FILTERS)
def test_parameters_survive_the_round_trip_through_their_resolved_form(name):
    model = resolve("filter", name, FILTERS).Parameters
    written = model().model_dump(mode="json", context={"border": True}, exclude_none=True)
    assert model.model_validate(written, context={"border": True}) == model()
