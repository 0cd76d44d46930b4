"""Error against frequency does not drift unseen: 0.5 dB against the stored baseline."""

from __future__ import annotations

import copy
import json
import math

import pytest

from tests.regression.error_vs_frequency import BASELINE, FREQUENCIES_HZ, measure

LIMIT_DB = 0.5
# The same relative change, 5.9 %, turned by 90 degrees.
LIMIT_DEG = math.degrees(10 ** (LIMIT_DB / 20) - 1)

pytestmark = pytest.mark.regression


def drifts(now, before):
    """Return every quantity that moved by more than the limit, as text."""
    found = []
    for name in sorted(now.keys() | before.keys()):
        if name not in now or name not in before:
            found.append(f"{name}: only in {'the baseline' if name in before else 'this run'}")
            continue
        for new, old in zip(now[name], before[name], strict=True):
            where = f"{name} at {old['frequency_hz']:g} Hz"
            for key in ("gain", "rmse_deg_s"):
                change = 20 * math.log10(new[key] / old[key])
                if abs(change) > LIMIT_DB:
                    found.append(f"{where}: {key} moved by {change:+.2f} dB")
            turn = (new["phase_deg"] - old["phase_deg"] + 180) % 360 - 180
            if abs(turn) > LIMIT_DEG:
                found.append(f"{where}: phase moved by {turn:+.2f} deg")
    return found


@pytest.fixture(scope="module")
def baseline():
    return json.loads(BASELINE.read_text())


def test_error_against_frequency_equals_the_baseline(baseline):
    assert drifts(measure(), baseline) == [], "if the change is meant, run 'make baseline' and say why in the commit"


def test_baseline_covers_the_grid(baseline):
    assert all([row["frequency_hz"] for row in rows] == list(FREQUENCIES_HZ) for rows in baseline.values())


@pytest.mark.parametrize(("key", "change"), [("gain", 1.06), ("rmse_deg_s", 0.94), ("phase_deg", None)])
def test_a_planted_drift_is_seen(baseline, key, change):
    moved = copy.deepcopy(baseline)
    moved["kalman"][1][key] = moved["kalman"][1][key] * change if change else moved["kalman"][1][key] + 3.5
    (finding,) = drifts(moved, baseline)
    assert finding.startswith("kalman at 2 Hz")


def test_a_missing_filter_is_seen(baseline):
    assert drifts({k: v for k, v in baseline.items() if k != "shakf"}, baseline) == ["shakf: only in the baseline"]
