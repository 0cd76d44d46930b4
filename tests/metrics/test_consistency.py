"""Sums of squared errors and innovations against closed forms, and the verdict of a run."""

from __future__ import annotations

import json
import re
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest
from scipy.stats import chi2, norm
from typer.testing import CliRunner

import testbed
from testbed.cli.app import app
from testbed.metrics.consistency import LAGS, MISS, Consistency, Whiteness
from testbed.signals import random_stream
from tests.scenes import short, short_file

if TYPE_CHECKING:
    from pathlib import Path

    from testbed.signals import FloatArray


def found(error: float, std: float, innovation: FloatArray, variance: float) -> dict[str, Any]:
    """Return what is said of a constant error and of innovations of one sensor."""
    one = Consistency()
    diagnostics = {
        "innovation_a": innovation,
        "innovation_variance_a": np.full(innovation.size, variance),
        "band_a": innovation,
    }
    one.add(np.full(innovation.size, error), np.full(innovation.size, std), diagnostics)
    return one.result()


def white(n: int = 4000) -> FloatArray:
    return random_stream(3, "white").standard_normal(n)


def test_ratios_are_those_of_the_squares() -> None:
    signs = np.where(np.arange(1000) % 4 < 2, 1.0, -1.0)
    result = found(3e-3, 2e-3, 5e-3 * signs, 1e-5)
    assert result["nees"] == pytest.approx(2.25, rel=1e-12)
    assert result["nis_a"] == pytest.approx(2.5, rel=1e-12)
    # Two up, two down: the correlation is -1 at lag 2, of the 998 products out of 1000.
    assert result["whiteness_a"] == pytest.approx(-0.998, rel=1e-12)


def test_bounds_are_the_quantiles() -> None:
    sums = Whiteness()
    sums.add(white(), np.ones(4000))
    low, high = sums.nis_bounds()
    assert [4000 * low, 4000 * high] == pytest.approx(list(chi2.ppf([MISS / 2, 1 - MISS / 2], 4000)), rel=1e-9)
    assert sums.correlation_bound() == pytest.approx(norm.isf(MISS / 2 / LAGS) / np.sqrt(4000), rel=1e-9)
    assert low < (sums.nis() or 0.0) < high
    assert abs(sums.correlation() or 1.0) < sums.correlation_bound()


def test_a_first_order_process_has_its_correlation() -> None:
    """x+ = a x + w: correlation a at lag 1; its standard error is sqrt((1 - a^2)/n) (Bartlett)."""
    n, a = 100_000, 0.3
    x = np.zeros(n)
    for k, w in enumerate(random_stream(5, "ar").standard_normal(n)):
        x[k] = a * x[k - 1] + w
    sums = Whiteness()
    sums.add(x, np.full(n, 1.0 / (1.0 - a**2)))
    assert sums.correlation() == pytest.approx(a, rel=0, abs=4.0 * np.sqrt((1 - a**2) / n))
    assert abs(sums.correlation() or 0.0) > sums.correlation_bound()


@pytest.mark.parametrize("size", [1, 7, 999])
def test_any_division_into_blocks_gives_the_same_values(size: int) -> None:
    error, std, e = 1e-3 * white(), np.full(4000, 2e-3), white()
    e[::9] = np.nan
    whole, parts = Consistency(), Consistency()
    whole.add(error, std, {"innovation_a": e, "innovation_variance_a": np.ones(4000)})
    for at in range(0, 4000, size):
        cut = slice(at, at + size)
        parts.add(error[cut], std[cut], {"innovation_a": e[cut], "innovation_variance_a": np.ones(4000)[cut]})
    for key, value in whole.result().items():
        # Sums in another order: 4000 roundings.
        assert parts.result()[key] == (
            value if value is None or isinstance(value, str) else pytest.approx(value, rel=1e-9, abs=1e-12)
        )


@pytest.mark.parametrize(
    ("error", "scale", "verdict"),
    [
        (1.0, 1.0, "consistent"),
        (1.5, 1.0, "optimistic"),
        (0.6, 1.0, "pessimistic"),
        (1.0, 1.3, "consistent"),
        (1.0, 0.8, "consistent"),
        (1.0, 1.7, "innovations too large"),
        (1.0, 0.5, "innovations too small"),
        (np.nan, 1.0, None),
    ],
)
def test_the_verdict_allows_a_factor_of_two_in_the_variance(error: float, scale: float, verdict: str | None) -> None:
    assert found(error, 1.0, scale * white(), 1.0)["verdict"] == verdict


def test_what_is_undefined_is_null() -> None:
    assert Consistency().result() == {"nees": None, "verdict": None}
    silent = found(1.0, 1.0, np.full(100, np.nan), 1.0)
    assert silent["nis_a"] is silent["nis_bounds_a"] is silent["whiteness_a"] is silent["whiteness_bound_a"] is None
    assert silent["verdict"] == "consistent"
    # A claim of no error at all, and its error: JSON has no infinity.
    json.dumps(found(1.0, 0.0, white(), 0.0), allow_nan=False)


def test_a_run_states_the_verdict_in_metrics_report_and_terminal(tmp_path: Path) -> None:
    done = CliRunner().invoke(app, ["run", str(short_file(tmp_path)), "--out", str(tmp_path / "run")])
    assert done.exit_code == 0
    fusion = json.loads((tmp_path / "run" / "metrics.json").read_text())["fusion"]
    page = (tmp_path / "run" / "report.html").read_text()
    for name in ("kalman", "arw_shakf"):
        claims = fusion[name]["consistency"]
        assert {"nees", "nis_mhd_ars", "nis_mems_gyro", "whiteness_mhd_ars", "whiteness_mems_gyro"} < set(claims)
        assert re.search(rf"{name} {claims['verdict']} \(NEES", done.output)
        row = page.split(f'<tr data-kind="claims" data-name="{name}">')[1].split("</tr>")[0]
        assert claims["verdict"] in row
        assert f'value="{claims["nees"]}"' in row
        assert f'value="{claims["nis_mhd_ars"]}"' in row


def test_a_run_judges_what_comes_after_settle_in_any_blocks(tmp_path: Path) -> None:
    run, parts = testbed.run(short(tmp_path)), testbed.run(short(tmp_path), block=0.013)
    claims = run.metrics["fusion"]["kalman"]["consistency"]
    error, std = run.fusion["kalman"].rate - run.truth.rate, run.fusion["kalman"].std
    assert claims["nees"] == pytest.approx(np.mean((error / std)[4000:] ** 2), rel=1e-9)
    e, C = (run.fusion["kalman"][f"{key}_mems_gyro"] for key in ("innovation", "innovation_variance"))
    assert claims["nis_mems_gyro"] == pytest.approx(np.nanmean((e**2 / C)[4000:]), rel=1e-9)
    for key, value in parts.metrics["fusion"]["kalman"]["consistency"].items():
        assert value == (claims[key] if isinstance(value, str) else pytest.approx(claims[key], rel=1e-9))
