"""Seeds of the truth and of the noise, apart from each other."""

from __future__ import annotations

import numpy as np
import pytest

import testbed
from tests.scenes import short_file

RANDOM = ("sine: {frequency: 10 Hz, rate: 1 deg/s}", "random: {psd: 1e-4 (deg/s)^2/Hz, low: 1 Hz, high: 80 Hz}")
FLOOR = (
    "{preset: air_bearing}",
    "{floor: {bands: [{axis: rz, low: 5 Hz, high: 50 Hz, angular_acceleration_psd: 1e-4 rad^2/s^4/Hz}]}}",
)


def both(folder, *edits, seed=None):
    scenario = testbed.load_scenario(short_file(folder, ("0.5 s", "0.25 s"), ("0.2 s", "0.1 s"), *edits))
    run = testbed.run(scenario, seed=seed)
    return run.truth.rate, run.sensors["mems_gyro"].rate


@pytest.mark.parametrize("edit", [RANDOM, FLOOR], ids=["motion", "floor"])
def test_truth_seed_leaves_the_noise_to_the_seed(edit, tmp_path):
    truth, readings = both(tmp_path, edit, ("seed: 11", "seed: 11\ntruth_seed: 5"))
    again, others = both(tmp_path, edit, ("seed: 11", "seed: 12\ntruth_seed: 5"))
    assert np.array_equal(truth, again)
    assert not np.array_equal(readings, others)
    alone, _ = both(tmp_path, edit, ("seed: 11", "seed: 5"))
    assert np.array_equal(truth, alone), "without it the truth follows the seed"


def test_a_seed_from_outside_moves_the_truth_only_where_it_has_none_of_its_own(tmp_path):
    truth, _ = both(tmp_path, RANDOM)
    moved, _ = both(tmp_path, RANDOM, seed=99)
    assert not np.array_equal(truth, moved)
    kept, _ = both(tmp_path, RANDOM, ("seed: 11", "seed: 3\ntruth_seed: 11"), seed=99)
    assert np.array_equal(truth, kept)
