"""The examples do what they say, and the defaults that come from them still do."""

from __future__ import annotations

import importlib.util
from pathlib import Path

import numpy as np
import pytest

from testbed.fusion.arw_shakf import ArwShakf
from testbed.fusion.belief import load_belief

EXAMPLES = Path(__file__).parents[1] / "examples"


def example(name):
    spec = importlib.util.spec_from_file_location(name, EXAMPLES / f"{name}.py")
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


@pytest.mark.slow
def test_default_thresholds_are_those_of_the_calibration_sweep():
    """Two digits were kept: 5 %. The scatter of N_k over n = 20000 readings, sqrt(3/n) = 1.2 %, is inside that."""
    calibrated = example("calibrate_bands").thresholds()
    for name, bands in ArwShakf.Parameters().bands.items():
        assert np.allclose(calibrated[name], bands.thresholds, rtol=0.05, atol=0.0), name


def test_calibration_sweep_leaves_the_judged_signals_out():
    sweep = example("calibrate_bands").SWEEP_HZ
    assert not set(sweep) & {0.5, 4.0, 10.0}
    assert sweep[0] == 0.1
    assert sweep[-1] == 25.0


def test_identified_belief_is_what_the_example_writes():
    """The file keeps nine digits; the search itself repeats to far less than the misfit of 1e-4, on which the filters depend."""
    from testbed.fusion.belief import load_belief

    program = example("identify_beliefs")
    shipped, freq = load_belief("identified"), program.FREQ_HZ
    for name, fit in program.identified().items():
        assert np.allclose(
            shipped[name].realisation().response(freq), fit.belief().realisation().response(freq), rtol=1e-6, atol=0.0
        ), name
        assert fit.worst < 2e-4
        for key, (value, _) in program.NOISE[name].items():
            assert f"  {key}: {value}" in program.belief_file()


def test_the_shipped_belief_of_paper2_is_the_fit_to_its_sensor():
    found, believed = example("identify_paper2").fit(), load_belief("paper2")["mhd_ars"]
    assert found.worst < 0.0015
    # The poles follow the response to the rounding of the search.
    assert np.allclose(found.denominator, believed.denominator, rtol=1e-4, atol=0.0)
    assert np.allclose(found.numerator, believed.numerator, rtol=1e-4, atol=0.0)
