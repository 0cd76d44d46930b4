"""The filters on the four signals of paper 1, sensors of equation (39) with the presets' noise, phase included, last 10
s of 20 s.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
import pytest

from testbed.fusion import FILTERS, estimate

if TYPE_CHECKING:
    from testbed.signals import FloatArray

DEG = np.pi / 180.0
SIGNALS = {"0.5 Hz": [(0.5, 1.0)], "4 Hz": [(4.0, 1.0)], "10 Hz": [(10.0, 1.0)], "mixed": [(0.5, 1.0), (10.0, 0.18)]}
# "Proposed" column of Table II and the mixed signal from the text [deg/s].
TABLE_II = np.array([0.0098, 0.0071, 0.0039, 0.0143])
SEEDS = range(41, 43)
# The papers' filters; the others have tests of their own.
PAPER = [name for name in FILTERS if name in {"kalman", "shakf", "arw_shakf", "arw_shakf_literal"}]

pytestmark = pytest.mark.slow


@pytest.fixture(scope="module")
def rmse(reference: Any) -> dict[str, FloatArray]:
    """RMSE [deg/s], shape (n_seed, n_signal), by filter."""
    found = {name: np.empty((len(SEEDS), len(SIGNALS))) for name in [*PAPER, "literal at the q of shakf"]}
    for column, lines in enumerate(SIGNALS.values()):
        rate = reference.sines(*lines)
        for row, seed in enumerate(SEEDS):
            readings = reference.readings(rate, seed)
            for label, table in found.items():
                own = {} if label in FILTERS else {"q": "0.0056 (deg/s)^2/s"}
                name = label if label in FILTERS else "arw_shakf_literal"
                error = estimate(name, readings, sample_rate_hz=reference.rates, **own).rate - rate
                table[row, column] = np.sqrt(np.mean(error[rate.size // 2 :] ** 2)) / DEG
    return found


@pytest.mark.parametrize("name", ["kalman", "arw_shakf", "arw_shakf_literal"])
def test_one_parameter_set_meets_table_ii(rmse: dict[str, FloatArray], name: str) -> None:
    assert np.all(np.median(rmse[name], axis=0) <= TABLE_II), rmse[name]
    assert np.all(rmse[name] <= 1.5 * TABLE_II), rmse[name]


def test_shakf_tuned_at_half_a_hertz_fails_at_4_and_10_hz(rmse: dict[str, FloatArray]) -> None:
    slow, mid, fast, mixed = np.median(rmse["shakf"], axis=0)
    assert slow < TABLE_II[0]
    assert min(mid, fast) > 10.0 * slow
    # Notable and not as in the paper (0.1482): at this q the mixed signal is followed.
    assert mixed < TABLE_II[3]


def test_the_literal_form_does_not_repair_the_q_of_shakf(rmse: dict[str, FloatArray]) -> None:
    assert np.all(np.median(rmse["literal at the q of shakf"], axis=0)[1:3] > 10.0 * TABLE_II[1:3])


def test_bands_lie_where_the_paper_has_them(reference: Any) -> None:
    found = {}
    for label, lines in SIGNALS.items():
        readings = reference.readings(reference.sines(*lines, duration=5.0), 50)
        block = estimate("arw_shakf", readings, sample_rate_hz=reference.rates)
        bands = (block.diagnostics[f"band_{name}"] for name in reference.rates)
        found[label] = tuple(band[np.isfinite(band)][-1] for band in bands)
    assert found == {"0.5 Hz": (0, 0), "4 Hz": (1, 1), "10 Hz": (2, 2), "mixed": (0, 1)}


def test_wideband_is_better_than_the_table_by_far(reference: Any) -> None:
    """One parameter set on all four; last 6 s of 12 s, median of two seeds."""
    targets = {"0.5 Hz": 0.0030, "4 Hz": 0.0030, "10 Hz": 0.0025, "mixed": 0.0035}
    for label, lines in SIGNALS.items():
        rate = reference.sines(*lines, duration=12.0)
        errors = [
            estimate("wideband", reference.readings(rate, seed), sample_rate_hz=reference.rates, start="rest").rate
            - rate
            for seed in (41, 42)
        ]
        found = np.median([np.sqrt(np.mean(error[rate.size // 2 :] ** 2)) / DEG for error in errors])
        assert found <= targets[label], (label, found)
