"""The example of one's own log finds the noise that it wrote, through the gap."""

from __future__ import annotations

import numpy as np
import pytest

from tests.examples.programs import example


def test_the_noise_that_was_written_is_found(tmp_path, capsys):
    program, path = example("own_log"), tmp_path / "log.csv"
    program.write_log(path, np.radians(0.15) / 60.0)
    found = program.main(path)
    assert found["lower"] < 0.15 < found["upper"]
    # N sqrt(2) in deg/s/sqrt(Hz) from 1 to 250 Hz; the record's variance is good to a per cent.
    assert found["rms"] == pytest.approx(0.15 / 60.0 * np.sqrt(2.0 * 249.0), rel=0.04)
    assert "20 samples lost in 1 gaps" in capsys.readouterr().out
