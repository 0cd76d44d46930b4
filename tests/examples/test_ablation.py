"""The ablation: forms are what their names say, and on short runs they work and fail where docs/ablation.md says."""

from __future__ import annotations

import csv
import importlib.util
import sys
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest

from testbed.fusion.analysis.runaway import critical_q

if TYPE_CHECKING:
    from types import ModuleType

ROOT = Path(__file__).parents[2]
DEG = np.pi / 180.0
TABLE_II = {"0.5 Hz": 0.0098, "4 Hz": 0.0071, "10 Hz": 0.0039}


@pytest.fixture(scope="module")
def ablation() -> Any:
    """Load the example with its neighbour in reach, as if run from the command line."""
    sys.path.insert(0, str(ROOT / "examples"))
    try:
        spec = importlib.util.spec_from_file_location("ablation", ROOT / "examples" / "ablation.py")
        assert spec is not None
        assert spec.loader is not None
        module: ModuleType = importlib.util.module_from_spec(spec)
        spec.loader.exec_module(module)
    finally:
        sys.path.pop(0)
    return module


@pytest.fixture(scope="module")
def found(ablation: Any) -> dict[str, dict[str, tuple[float, float]]]:
    """Error [deg/s] and error over std of every form at three frequencies, last 6 s of 12 s, one seed."""
    table: dict[str, dict[str, tuple[float, float]]] = {name: {} for name in ablation.FORMS}
    for label in TABLE_II:
        rate = ablation.sine(float(label.split()[0]), 1.0, 12.0)
        z = ablation.readings(rate, 31)
        for name, (kind, own) in ablation.FORMS.items():
            table[name][label] = ablation.run(z, rate, rate.size // 2, kind, **own)
    return table


def test_each_correction_alone_changes_one_thing(ablation: Any) -> None:
    base = dict(ablation.FORMS["literal, q 0.0056"][1])
    for name, changed in (
        ("literal + fading N_k", {"memory"}),
        ("literal + gyro noise in Q", {"use_input_noise"}),
        ("literal + clamp 3", {"clamp"}),
        ("literal + freeze", {"clamp"}),
        ("literal + differences", {"innovation"}),
        ("S alone, R fixed", {"bands", "adapt"}),
    ):
        kind, own = ablation.FORMS[name]
        assert kind == "arw_shakf_literal"
        assert {key for key in own if own[key] != base.get(key)} == changed, name
        assert own["q"] == base["q"]


@pytest.mark.slow
def test_shakf_tuned_at_half_a_hertz_is_ten_times_worse_at_4_and_10_hz(found: Any) -> None:
    error = {label: value[0] for label, value in found["`shakf`, q 0.0056 (tuned)"].items()}
    assert error["0.5 Hz"] < TABLE_II["0.5 Hz"]
    assert min(error["4 Hz"], error["10 Hz"]) > 10.0 * error["0.5 Hz"]


@pytest.mark.slow
def test_what_meets_table_ii_and_what_does_not(found: Any) -> None:
    """As docs/ablation.md says; 1.5 times Table II, since one short run still holds some of the start."""
    passes = {name: all(row[label][0] < 1.5 * TABLE_II[label] for label in TABLE_II) for name, row in found.items()}
    for name in ("`kalman`", "`arw_shakf`, q 0.1", "`arw_shakf`, no bands, no S", "`shakf`, q 0.3"):
        assert passes[name], (name, found[name])
    for name in ("`shakf`, q 0.0056 (tuned)", "literal, q 0.0056", "literal + fading N_k", "literal + clamp 3"):
        assert not passes[name], (name, found[name])
    # Fading alone changes nothing on a steady signal, and S alone is a second way to run away.
    for label in ("4 Hz", "10 Hz"):
        assert found["literal + fading N_k"][label][0] == pytest.approx(found["literal, q 0.0056"][label][0], rel=0.02)
    assert found["S alone, R fixed"]["10 Hz"][0] > 3.0 * found["`shakf`, R fixed"]["10 Hz"][0]


@pytest.mark.slow
def test_the_law_says_which_shakf_fails(ablation: Any) -> None:
    """Beyond Table II too: lost (an error above a tenth of the line) exactly where q is below q_crit."""
    for freq, amplitude in ((0.5, 5.0), (4.0, 1.0), (4.0, 10.0), (25.0, 1.0)):
        rate = ablation.sine(freq, amplitude, 10.0)
        z = ablation.readings(rate, 32)
        needed = critical_q([(freq, amplitude * DEG)], 20_000.0)
        for q in (0.0056, 0.1, 0.3, 3.0):
            error, _ = ablation.run(z, rate, rate.size // 2, "shakf", q=q * DEG**2)
            # 0.0056 is a tenth below q_crit at 0.5 Hz, 5 deg/s: on the edge, where both may be.
            if not 0.7 < q * DEG**2 / needed < 1.1:
                assert (error > 0.1 * amplitude / np.sqrt(2.0)) == (q * DEG**2 < needed), (freq, amplitude, q)


@pytest.mark.slow
def test_reported_std_is_honest_in_the_corrected_form_only(found: Any) -> None:
    """Slow errors of one run of 6 s scatter by half; the dishonest ones are off by far more."""
    assert all(0.5 < ratio < 1.7 for _, ratio in found["`arw_shakf`, q 0.1"].values())
    for name in ("`shakf`, q 0.0056 (tuned)", "literal, q 0.0056", "literal + clamp 3"):
        assert found[name]["10 Hz"][1] > 5.0, name


@pytest.mark.slow
def test_the_shipped_q_is_what_tuning_gives(ablation: Any) -> None:
    """The optimum is flat, so its place is loose and its height is not."""
    objective = ablation.objective_at_half_a_hertz(ablation.sine(0.5, 1.0, 14.0), (101, 102))
    q, error, _ = ablation.tune_q(objective)
    assert 5e-4 < q < 0.05
    assert objective() < 1.03 * error


def test_stored_edges_are_those_of_the_law() -> None:
    with (ROOT / "docs" / "images" / "runaway_edge.csv").open() as file:
        rows = list(csv.DictReader(file))
    assert {(row["order"]) for row in rows} == {"1", "2", "3"}
    assert len({row["frequency_hz"] for row in rows}) == 8
    assert len({row["amplitude_deg_s"] for row in rows}) == 5
    for row in rows:
        line = (float(row["frequency_hz"]), float(row["amplitude_deg_s"]) * DEG)
        wanted = critical_q([line], 20_000.0, int(row["order"])) / DEG**2
        assert float(row["q_crit"]) == pytest.approx(wanted, rel=1e-5, abs=0.0)
        assert 0.8 < float(row["q_observed"]) / wanted < 1.1


@pytest.mark.slow
def test_edges_are_found_and_drawn(ablation: Any, tmp_path: Path) -> None:
    law = ablation.runaway_edge
    edges = [law.edge(10.0, 1.0, 1), law.edge(4.0, 0.3, 2)]
    assert all(0.8 < e.ratio < 1.1 for e in edges)
    law.draw(edges).savefig(tmp_path / "edges.png")
    assert (tmp_path / "edges.png").read_bytes().startswith(b"\x89PNG")
