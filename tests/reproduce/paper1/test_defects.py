"""What defects of the sensors cost each filter, against closed forms of what the wrong belief forces."""

from __future__ import annotations

import numpy as np
import pytest

from testbed.reproduce.paper1.defects import CASES, Split, sensors_of, split
from testbed.reproduce.paper1.runs import FusionProtocol
from testbed.signals import BASE_RATE_HZ
from testbed.units import DEG

PROTOCOL = FusionProtocol(duration=8.0, settle=6.0)


def sine(freq_hz: float) -> np.ndarray:
    return DEG * np.sin(2 * np.pi * freq_hz * np.arange(round(PROTOCOL.duration * BASE_RATE_HZ)) / BASE_RATE_HZ)


def test_the_cases_are_what_they_say() -> None:
    """1 % and 0.5 ms in the sensors' own responses; the 1/f part equal to the white one at its knee; clean sensors have
    neither.
    """
    freq = np.array([10.0])
    clean, late = sensors_of("clean"), np.exp(-2j * np.pi * 10.0 * 0.5e-3)
    for case, name, factor in (
        ("gain +1 % (MHD)", "mhd_ars", 1.01),
        ("gain +1 % (gyro)", "mems_gyro", 1.01),
        ("delay 0.5 ms (MHD)", "mhd_ars", late),
        ("delay 0.5 ms (gyro)", "mems_gyro", late),
        ("all", "mhd_ars", 1.01 * late),
        ("all", "mems_gyro", 1.01 * late),
    ):
        ratio = sensors_of(case)[name].response(freq) / clean[name].response(freq)
        assert ratio[0] == pytest.approx(factor, rel=1e-12)
    white, pink = (sensors_of(case)["mhd_ars"].noise_psd(freq)[0] for case in ("clean", "1/f knee 10 Hz (MHD)"))
    assert pink / white == pytest.approx(2.0, rel=1e-12)
    assert not sensors_of("all", noise=False)["mhd_ars"].noise
    for case, field in (
        ("bias instability (gyro)", "bias_instability"),
        ("rate random walk (gyro)", "rate_random_walk"),
    ):
        assert getattr(clean["mems_gyro"], field) == 0.0
        assert getattr(sensors_of(case)["mems_gyro"], field) > 0.0
    assert next(iter(CASES)) == "clean"


@pytest.mark.oracle
def test_at_10_hz_the_mhd_sensors_defect_forces_its_own_error() -> None:
    """There the filter takes the rate from the MHD ARS, G d over its belief G: A |d - 1| / sqrt(2), and noise adds by
    squares.
    """
    rate = sine(10.0)
    clean = split(rate, "10 Hz", "clean", 2, PROTOCOL)
    for case, defect in (("gain +1 % (MHD)", 1.01), ("delay 0.5 ms (MHD)", np.exp(-2j * np.pi * 10.0 * 0.5e-3))):
        found = split(rate, "10 Hz", case, 2, PROTOCOL)
        forced = abs(defect - 1.0) / np.sqrt(2.0)
        for name in ("kalman", "arw_shakf"):
            # The lag and the misfit of (39), the clean belief error c, add as phasors to d - 1 as d c: d (1 + c) - 1.
            assert abs(found[name].belief - forced) <= abs(defect) * clean[name].belief
            row = dict(
                zip(
                    ("rmse", "lowest", "highest", "aligned", "belief", "noise", "closure"),
                    found[name].row(clean[name])[:7],
                    strict=True,
                )
            )
            # Over 2 s the slow part of either (crossover below 0.1 Hz) is a single draw, so that they are correlated by
            # chance.
            assert row["closure"] == pytest.approx(1.0, abs=0.1)
            assert row["lowest"] <= row["rmse"] <= row["highest"]
        # A filter that does not adapt answers to the noise alike, whatever the belief: linear, but for the rounding.
        assert found["kalman"].noise == pytest.approx(clean["kalman"].noise, rel=0.02, abs=0.0)


@pytest.mark.oracle
def test_the_loss_is_the_sum_of_its_parts_when_both_close() -> None:
    """3-4-5 and 5-12-13: loss 13 - 5 = 8, by squares 144 - 9 and 25 - 16 over 18."""
    clean = Split(np.array([5.0]), np.array([0.0]), np.array([4.0]), 3.0)
    worse = Split(np.array([13.0]), np.array([0.0]), np.array([5.0]), 12.0)
    *_, closure, loss, belief, noise = worse.row(clean)
    assert closure == pytest.approx(1.0)
    assert (loss, belief, noise) == pytest.approx((8.0, 7.5, 0.5))
