"""The same file gives the same samples through every command that reads one."""

from __future__ import annotations

import numpy as np
import pytest

from testbed.drift.columns import Columns
from testbed.drift.records import read_file
from testbed.judging.allan_records import read
from testbed.logs import read_log
from testbed.models.motions.recorded import Recorded
from tests.logs.kinds import DEG, SECONDS, STAMPS, comma, lines

HEAT = [f"{20 + k / 1000:.3f}" for k in range(len(DEG))]
LOGS = {
    "semicolons": (lines(SECONDS, DEG, HEAT, head="t;rate [deg/s];temperature [degC]\n", separator=";"), "t", "s"),
    "a leading comment": (lines(SECONDS, DEG, HEAT, head="# by x\nt,rate [deg/s],temperature [degC]\n"), "t", "s"),
    "decimal comma": (
        lines(comma(SECONDS), comma(DEG), comma(HEAT), head="t;rate;temperature\ns;deg/s;degC\n", separator=";"),
        "t",
        "s",
    ),
    "epoch nanoseconds": (lines(STAMPS, DEG, HEAT, head="#t [ns],rate [deg/s],temperature [degC]\n"), "t", "ns"),
}


@pytest.mark.contract
@pytest.mark.parametrize("kind", LOGS)
def test_every_reader_gives_the_same_samples(tmp_path, kind):
    text, clock, unit = LOGS[kind]
    path = tmp_path / "log.csv"
    path.write_text(text)
    channel = read_log(path).channels["rate"]
    (record,) = read(path)
    thermal = read_file(path, Columns(time=clock, rate_unit="deg/s", temperature_unit="degC")).record
    said = {"file": path, "time": {"column": clock, "unit": unit}, "rate": {"column": "rate", "unit": "deg/s"}}
    _, motion = Recorded.model_validate(said)._read()
    for other in (record.rate, thermal.rate, motion):
        assert np.array_equal(channel.values, other)
    assert channel.rate_hz == record.sample_rate_hz == thermal.sample_rate_hz


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
