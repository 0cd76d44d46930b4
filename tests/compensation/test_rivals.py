"""Methods of Table 2 take noise and leave what is slow; each is found by its name."""

import numpy as np
import pytest

from testbed.compensation import LITERATURE, rivals
from testbed.compensation.record import GyroRecord
from testbed.parts import resolve

# A slow sine of five times the white noise at 1 Hz, over two and a half hours.
N_TIME = 9000
SLOW = 5.0 * np.sin(2.0 * np.pi * np.arange(N_TIME) / 4500.0)
RECORD = GyroRecord(
    1e-7 * (SLOW + np.random.default_rng(7).standard_normal(N_TIME)), np.linspace(290, 300, N_TIME), 1.0
)


@pytest.mark.parametrize("name", ["akf22", "olmd_kpca", "ceemdan_lwt"])
def test_noise_falls_and_the_slow_part_stays(name):
    options = {"trials": 10, "threads": 1} if name == "ceemdan_lwt" else {}
    found = resolve("method", name, LITERATURE)(RECORD, seed=1, **options) / 1e-7
    # Differences are noise alone: the sine moves by 0.007 a sample.
    assert np.diff(found).std() < 0.3 * np.diff(RECORD.rate / 1e-7).std()
    phase = np.exp(-2j * np.pi * np.arange(N_TIME) / 4500.0)
    assert abs(np.mean(found * phase)) == pytest.approx(2.5, rel=0.05, abs=0.0)


def test_without_mixed_modes_the_slow_group_is_all_that_is_left():
    """A record of noise faster than 21 s and a slow line."""
    found = rivals.olmd_kpca(GyroRecord(1e-7 * SLOW, np.linspace(290, 300, N_TIME), 1.0))
    np.testing.assert_allclose(found, 1e-7 * SLOW, atol=1e-8)


def test_every_name_says_what_it_is_in_its_first_line():
    for name in LITERATURE:
        assert (resolve("method", name, LITERATURE).__doc__ or "").splitlines()[0].endswith(".")
