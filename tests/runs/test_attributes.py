"""What run.nc says of itself: after CF, in units that UDUNITS reads, a lost reading as a gap."""

from __future__ import annotations

import re

import matplotlib.pyplot as plt
import numpy as np
import pytest
import xarray as xr

import testbed
from testbed.fusion import FILTERS
from testbed.runs.attributes import unit_of
from tests.scenes import short

# All of what is written, as UDUNITS has it; cf_units.Unit, once asked, knows each.
UNITS = {"s", "rad", "rad/s", "rad^2/s^2", "K", "Hz", "1"}
NAME = re.compile(r"[A-Za-z][A-Za-z0-9_]*")


@pytest.fixture(scope="module")
def stored(tmp_path_factory):
    """Store a run of the covariance filters, with a tenth of the gyro's readings lost."""
    folder = tmp_path_factory.mktemp("attributes")
    scenario = short(
        folder,
        ("duration: 0.5 s", "duration: 0.3 s"),
        ("preset: adis16505_filtered", "preset: adis16505_filtered, dropped: 10 %"),
    )
    names = [name for name in FILTERS if name != "allan_srkf"]  # it takes sensors of one rate
    return testbed.run(scenario.with_(fusion={name: {} for name in names}, expect=None), out=folder / "run")


def test_every_signal_has_a_unit_of_udunits_and_a_long_name(stored):
    with xr.open_datatree(stored.folder / "run.nc", engine="h5netcdf") as tree:
        for node in tree.leaves:
            for name, variable in node.dataset.variables.items():
                assert NAME.fullmatch(name)
                assert variable.attrs["units"] in UNITS, (node.path, name)
                assert variable.attrs["units"] == stored.groups[node.path[1:]].units[name]
                assert len(variable.attrs["long_name"]) > len("rate")


def test_the_file_says_its_conventions_and_names_of_attributes_are_of_cf(stored):
    with xr.open_datatree(stored.folder / "run.nc", engine="h5netcdf") as tree:
        assert tree.attrs["Conventions"] == "CF-1.12"
        assert tree.attrs["title"] == tree.attrs["scenario"] == "short"
        assert [name for name in tree.attrs if not NAME.fullmatch(name)] == []
        assert tree["fusion/kalman/rate"].attrs["ancillary_variables"] == "std"


def test_time_has_its_standard_name_and_stays_a_number(stored):
    with xr.open_datatree(stored.folder / "run.nc", engine="h5netcdf") as tree:
        for node in tree.leaves:
            assert node.time.dtype == np.float64
            assert node.time.attrs["standard_name"] == "time"


def test_a_lost_reading_plots_as_a_gap(stored):
    lost = np.isnan(stored.sensors["mems_gyro"].rate)
    assert lost.any()
    with xr.open_datatree(stored.folder / "run.nc", engine="h5netcdf") as tree:
        (line,) = tree["sensors/mems_gyro/rate"].plot(ax=plt.figure().subplots())
    assert np.array_equal(np.isnan(line.get_ydata()), lost)
    plt.close("all")


@pytest.mark.parametrize("sensor", ["slow_rate", "slow_drift", "rate", "drift"])
@pytest.mark.parametrize(("diagnostic", "unit"), [("R", "rad^2/s^2"), ("band", "1"), ("frequency", "Hz")])
def test_a_diagnostic_keeps_its_unit_whatever_its_sensor_is_called(sensor, diagnostic, unit):
    assert unit_of("fusion/kalman", f"{diagnostic}_{sensor}") == unit
    assert unit_of("truth", f"{sensor}_rate") == "rad/s"
