"""The short form of the standard campaign: as its baseline has it, and as closed forms have it.

The baseline is an alarm and no proof, its numbers come from this code; what they should be is judged beside it.
"""

from __future__ import annotations

import numpy as np
import pytest

import testbed
from testbed.campaigns.regression.history import essence, latest, read_history
from testbed.campaigns.regression.regress import run_regression
from testbed.campaigns.regression.standard import SHORT
from testbed.fusion import FILTERS
from testbed.sensors import load_preset

pytestmark = [pytest.mark.regression, pytest.mark.slow]

PRESETS = {"mhd_ars": "sx300", "mems_gyro": "adis16505_filtered"}
LINES = ("0.5 Hz", "2 Hz", "4 Hz", "10 Hz", "25 Hz", "100 Hz")


@pytest.fixture(scope="module")
def found(tmp_path_factory):
    return run_regression(short=True, out=tmp_path_factory.mktemp("regress") / "short")


@pytest.fixture(scope="module")
def rows(found):
    return essence(testbed.open_sweep(found.folder).to_pylist())


def test_nothing_has_moved(found):
    remedy = "if the change is meant: testbed regress --short --update 'what changed the numbers'"
    assert not found.failures
    assert [one.words() for one in found.moves] == [], remedy


def test_the_baseline_has_every_case_of_this_version(found, rows):
    stored = latest(read_history(), SHORT)
    assert {row["source"] for row in stored} <= {row["source"] for row in rows}
    assert {row["signal"] for row in stored} == {*LINES, "mixed"}
    assert not [words for words in found.incomparable if ", " in words]


def of(rows, source, signal):
    usual = {"begin": "rest", "fault": "none", "calibration": "exact"}
    return [
        row
        for row in rows
        if (row["source"], row["signal"]) == (source, signal) and all(row[key] == usual[key] for key in usual)
    ]


@pytest.mark.oracle
@pytest.mark.parametrize("signal", LINES)
@pytest.mark.parametrize("sensor", PRESETS)
def test_gain_and_phase_of_a_sensor_are_those_of_its_closed_form(rows, sensor, signal):
    """Noise of density S moves the complex gain of a line of amplitude A, fitted over T, by sqrt(2 S / T) / A in each
    part; below a period per T slow noise adds to that, and the fit of half a sine is worse by two.
    """
    freq = float(signal.split()[0])
    instrument = load_preset(PRESETS[sensor])
    expected = instrument.response(np.array([freq]))[0]
    density = instrument.input_noise_psd(np.array([freq]))[0] * abs(expected) ** 2
    spread = np.sqrt(2.0 * density / 1.0) / np.radians(1.0) * (2.0 if freq < 1.0 else 1.0)
    for row in of(rows, sensor, signal):
        gain = row["gain"] * np.exp(1j * np.radians(row["phase_deg"]))
        # The table makes 1 deg/s within a per cent or so; what is left of the ramp-in dies with the fluid's 64 ms.
        assert abs(gain - expected) < 5.0 * spread + 1e-4 + np.exp(-0.5 / 0.064)


@pytest.mark.oracle
@pytest.mark.parametrize("signal", LINES)
def test_error_of_a_sensor_is_what_its_response_leaves_of_the_line(rows, signal):
    """A |G - 1| / sqrt(2), where that is above the noise: over whole periods."""
    freq = float(signal.split()[0])
    if freq < 1.0:
        pytest.skip("half a period")
    for sensor, name in PRESETS.items():
        lag = abs(load_preset(name).response(np.array([freq]))[0] - 1.0) / np.sqrt(2.0)
        for row in of(rows, sensor, signal):
            if lag > 0.05:
                # Amplitude of the truth within 3 %, noise in squares.
                assert row["rmse_deg_s"] == pytest.approx(lag, rel=0.04)


@pytest.mark.oracle
def test_no_filter_is_better_than_the_best_of_each_signal(found):
    """The optimum is a bound of the mean square over all noise: three seeds leave the geometric mean of nine cases
    within a factor of two of it.
    """
    assert {one.name for one in found.standings} <= set(FILTERS)
    assert all(one.n_case == 9 for one in found.standings)
    assert min(one.over_optimum for one in found.standings) > 1.0
