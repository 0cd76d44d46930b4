"""The same file gives the same samples through every command that reads one."""

from __future__ import annotations

import numpy as np
import pytest

from testbed.drift.columns import Columns
from testbed.drift.records import read_file
from testbed.judging.allan_records import read
from testbed.judging.density import densities
from testbed.logs import read_log
from testbed.logs.formats import open_table
from testbed.logs.inspection import inspect
from testbed.logs.proposal import propose
from testbed.logs.selection import Selection, TextOptions
from testbed.models.motions.recorded import Recorded
from tests.logs.kinds import DEG, ISO, RATE, SECONDS, STAMPS, TIME_US, comma, lines

WARM = np.round(20.0 + np.arange(RATE.size) / 1000.0, 3)
HEAT = [f"{warm:.3f}" for warm in WARM]
NAMES = "t;rate [deg/s];temperature [degC]\n"
LOGS = {
    "semicolons": (lines(SECONDS, DEG, HEAT, head=NAMES, separator=";"), "t", "s"),
    "a leading comment": (lines(SECONDS, DEG, HEAT, head="# by x\nt,rate [deg/s],temperature [degC]\n"), "t", "s"),
    "decimal comma": (
        lines(comma(SECONDS), comma(DEG), comma(HEAT), head="t;rate;temperature\ns;deg/s;degC\n", separator=";"),
        "t",
        "s",
    ),
    "epoch nanoseconds": (lines(STAMPS, DEG, HEAT, head="#t [ns],rate [deg/s],temperature [degC]\n"), "t", "ns"),
    "iso times": (lines(ISO, DEG, HEAT, head="t,rate [deg/s],temperature [degC]\n"), "t", "s"),
    "units behind numbers": (
        lines(SECONDS, [f"{w} deg/s" for w in DEG], HEAT, head="t;rate;temperature [degC]\n", separator=";"),
        "t",
        "s",
    ),
    "brackets": (
        lines([f"[{t}" for t in SECONDS], DEG, [f"{k}]" for k in HEAT], head=NAMES.replace(";", ",")),
        "t",
        "s",
    ),
}


def hdf5(path):
    import h5py

    with h5py.File(path, "w") as file:
        for name, values, unit in (("t", TIME_US, "us"), ("rate", RATE, "deg/s"), ("temperature", WARM, "degC")):
            file[name] = values
            file[name].attrs["units"] = unit


def parquet(path):
    import pyarrow as pa
    from pyarrow import parquet as pq

    pq.write_table(pa.table({"t [us]": TIME_US, "rate [deg/s]": RATE, "temperature [degC]": WARM}), path)


def matlab(path):
    from scipy.io import savemat

    savemat(path, {"t": TIME_US, "rate": RATE, "temperature": WARM}, appendmat=False)


WRITERS = {
    **{kind: (lambda path, text=text: path.write_text(text), t, unit) for kind, (text, t, unit) in LOGS.items()},
    "hdf5": (hdf5, "t", "us"),
    "parquet": (parquet, "t", "us"),
    "matlab": (matlab, "t", "us"),
}


@pytest.mark.contract
@pytest.mark.parametrize("kind", WRITERS)
def test_every_command_takes_the_same_samples(tmp_path, kind):
    """`read_log`, `allan`, `psd`, `log inspect`, `compensate`, and a recorded motion, to the last bit."""
    write, clock, unit = WRITERS[kind]
    path = tmp_path / "log.csv"
    write(path)
    said = {"column": "rate", "unit": "deg/s"}
    channel = read_log(path, map={"channels": {"rate": {**said, "time": {"column": clock, "unit": unit}}}}).channels[
        "rate"
    ]
    wanted = Selection(column=["rate"], unit="deg/s", time=clock, time_unit=unit)
    (record,) = read(path, wanted)
    (estimate,) = densities(path, wanted, TextOptions(), None, method="welch", segment=None, two_sided=False)
    thermal = read_file(path, Columns(time=clock, time_unit=unit, rate_unit="deg/s", temperature_unit="degC")).record
    recorded = {"file": path, "time": {"column": clock, "unit": unit}, "rate": said}
    _, motion = Recorded.model_validate(recorded)._read()
    for other in (record.rate, estimate.record.rate, thermal.rate, motion):
        assert np.array_equal(channel.values, other)
    assert channel.rate_hz == record.sample_rate_hz == estimate.record.sample_rate_hz == thermal.sample_rate_hz
    seen = next(report.values for report in inspect(propose(open_table(path)).plans) if report.plan.name == "rate")
    assert (seen.n_time, seen.low, seen.high) == (RATE.size, RATE.min(), RATE.max())


@pytest.mark.parametrize(("rate_hz", "digits"), [(1000.0, 6), (3333.3, 6), (6664.0, 6), (8000.0, 6), (8000.0, 9)])
@pytest.mark.parametrize("epoch", [0, 1_403_715_273])
def test_even_logs_with_rounded_stamps_are_recorded_motions(tmp_path, rate_hz, digits, epoch):
    t = np.arange(3000) / rate_hz
    ticks = [epoch * 10**digits + round(x * 10**digits) for x in t.tolist()]
    stamps = [f"{tick // 10**digits}.{tick % 10**digits:0{digits}d}" for tick in ticks]
    rows = lines(stamps, [f"{np.sin(20 * x):.6f}" for x in t], head="t_s,rate\n")
    path = tmp_path / "log.csv"
    path.write_text(rows)
    said = {"file": path, "time": {"column": "t_s", "unit": "s"}, "rate": {"column": "rate", "unit": "deg/s"}}
    time, rate = Recorded.model_validate(said)._read()
    assert rate.size == 3000
    # The first and the last stamp are rounded.
    assert time[-1] == pytest.approx(t[-1], abs=10.0**-digits)
