"""What people bring: the noise of 24 recordings of as many kinds, and a hundred clean ones without a finding."""

from __future__ import annotations

import numpy as np
import pytest

from testbed.errors import ScenarioError
from testbed.judging.allan_analysis import analyse
from testbed.judging.allan_records import read
from testbed.logs.formats import open_table
from testbed.logs.inspection import inspect
from testbed.logs.proposal import propose
from tests.logs.brought import SHAPED, UNSEEN, clean_log
from tests.logs.test_texts import chosen


def told(path, said):
    """Return the analysis of the first record, and what is said if there is none or it gives no coefficient."""
    try:
        analysis = analyse(read(path, *chosen(said))[0])
    except ScenarioError as error:
        return None, str(error)
    return (analysis, "") if analysis.given else (None, analysis.verdict())


@pytest.mark.oracle
def test_of_24_recordings_22_give_their_noise_and_the_rest_their_true_cause(tmp_path):
    """The interval is one of 95 %: of 24 it may miss two. What is refused says why, and with what it is read."""
    inside = 0
    for make in (*SHAPED, *UNSEEN):
        brought = make()
        path = tmp_path / f"{make.__name__}.log"
        path.write_bytes(brought.content)
        analysis, why = told(path, brought.said)
        if brought.refused:
            assert analysis is None, make.__name__
            assert brought.refused in why, make.__name__
        if brought.then:
            analysis, why = told(path, brought.then)
        if analysis is not None:
            found = analysis.fit.angle_random_walk
            inside += found.lower < brought.noise.si < found.upper
            assert analysis.record.sample_rate_hz == pytest.approx(brought.noise.fs, rel=2e-5), make.__name__
        else:
            # Words far above the noise hold nothing that an option could bring out.
            assert make.__name__ == "coarse_words", why
    assert inside >= 22


@pytest.mark.property
def test_a_hundred_clean_logs_have_no_finding(tmp_path):
    """All separators, decimal marks, encodings, times, units, rates and words; noise alone, and with motion."""
    for seed in range(100):
        path = tmp_path / f"{seed}.log"
        clean_log(seed, path)
        proposed = propose(open_table(path))
        assert proposed.open == (), seed
        for report in inspect(proposed.plans):
            assert report.findings == (), seed
        (record,) = read(path)
        assert record.notes == (), seed
        assert np.isfinite(record.rate).all(), seed
