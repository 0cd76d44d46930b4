"""Filters side by side have the bits that each has alone."""

from __future__ import annotations

import subprocess
import sys
from copy import deepcopy

import numpy as np
import pytest

from testbed.fusion import FILTERS
from testbed.fusion.belief import default_belief
from testbed.fusion.kernels.covariance import EVERY, MODE, RECURSION, SETTLED
from testbed.fusion.lanes import module
from testbed.fusion.lanes.pack import Buffers
from testbed.fusion.lanes.source import LANES
from testbed.fusion.lanes.together import Together
from testbed.parts import resolve

RATES = {"mhd_ars": 20_000.0, "mems_gyro": 2_000.0}
SLOW = {"bias_instability": 5e-6, "rate_random_walk": 1e-7}


def belief():
    """Return one with slow noise, which `coloured` gives states of its own."""
    found = default_belief()
    return {**found, "mems_gyro": found["mems_gyro"].model_copy(update=SLOW)}


def filters(name, n, **parameters):
    kind = resolve("filter", name, FILTERS)
    first = kind(belief(), RATES, kind.Parameters(**parameters))
    return [deepcopy(first) for _ in range(n)]


def readings(rng, n_time, start=0):
    t = np.arange(start, start + n_time) / RATES["mhd_ars"]
    rate = 0.02 * np.sin(2.0 * np.pi * 5.0 * t)
    ratio = 10
    slow = rate[-start % ratio :: ratio]
    return {
        "mhd_ars": rate + 1e-4 * rng.standard_normal(rate.size),
        "mems_gyro": slow + 1e-3 * rng.standard_normal(slow.size),
    }


def in_blocks(n, rng, lengths):
    start = 0
    for length in lengths:
        yield [readings(rng, length, start) for _ in range(n)]
        start += length


def process(together, lanes, given):
    return [*together.process(lanes, [one.received(values) for one, values in zip(lanes, given, strict=True)])]


def assert_same(alone, ours):
    for signal in ("rate", "std"):
        assert np.array_equal(getattr(alone, signal), getattr(ours, signal), equal_nan=True), signal
    for key, values in ours.diagnostics.items():
        assert np.array_equal(alone.diagnostics[key], values, equal_nan=True), key
    innovations = {key for key in alone.diagnostics if key.startswith(("innovation", "gated"))}
    assert innovations <= ours.diagnostics.keys()


CASES = [
    ("kalman", {"coloured": False}),
    ("kalman", {"coloured": True, "order": 2}),
    ("kalman", {"form": "square_root"}),
    ("kalman", {"precision": "single"}),
    ("shakf", {}),
    ("shakf", {"adapt": ("R", "Q")}),
    ("arw_shakf", {}),
    ("arw_shakf_literal", {}),
    ("steady_state", {"frequency": 2.0}),
    ("complementary", {}),
]


@pytest.mark.parametrize(("name", "parameters"), CASES, ids=str)
@pytest.mark.parametrize("n", [1, LANES + 3])
def test_lanes_have_the_bits_of_the_kernel(name, parameters, n, rng):
    """Through blocks of any length, among them one of a single sample; the lanes of a pack do not touch each other."""
    alone, lanes = filters(name, n, **parameters), filters(name, n, **parameters)
    together = Together(lanes[0])
    for given in in_blocks(n, rng, (700, 1, 333)):
        expected = [one.process(values) for one, values in zip(alone, given, strict=True)]
        for a, b in zip(expected, process(together, lanes, given), strict=True):
            assert_same(a, b)


@pytest.mark.parametrize("name", ["kalman", "arw_shakf", "shakf", "steady_state"])
def test_a_lane_of_its_own_fate_is_computed_alone(name, rng):
    """Lost readings, a spike beyond the gate, a sensor at its rail: in some lanes, in one block."""
    alone, lanes = filters(name, 5, gate=False), filters(name, 5, gate=False)
    together = Together(lanes[0])
    for number, given in enumerate(in_blocks(5, rng, (400, 400, 400, 400))):
        if number == 1:
            given[1]["mhd_ars"][50:60] = np.nan
            given[2]["mems_gyro"][7] = np.nan
            given[3]["mhd_ars"][100] = 5e3
        expected = [one.process(values) for one, values in zip(alone, given, strict=True)]
        for a, b in zip(expected, process(together, lanes, given), strict=True):
            assert_same(a, b)


def test_gains_that_settle_on_the_way_are_those_of_the_kernel(rng):
    """Recursion, the cycle that is kept, settled gains, and the recursion again behind a gap."""
    alone, lanes = (filters("steady_state", 3, frequency=2.0, coloured=False) for _ in range(2))
    for one in (*alone, *lanes):
        # A look at the gains with every cycle: they change little from one to the next.
        one._progress[EVERY] = 1
    together, seen = Together(lanes[0]), []
    for number, given in enumerate(in_blocks(3, rng, [4000] * 5)):
        if number == 3:
            given[1]["mems_gyro"][9] = np.nan
        expected = [one.process(values) for one, values in zip(alone, given, strict=True)]
        for a, b in zip(expected, process(together, lanes, given), strict=True):
            assert_same(a, b)
        for one, other in zip(alone, lanes, strict=True):
            assert np.array_equal(one._progress, other._progress)
            assert np.array_equal(one._last, other._last)
        seen.append(int(lanes[0]._progress[MODE]))
    assert {RECURSION, SETTLED} <= set(seen)


def test_kinds_that_share_their_buffers_each_have_their_own_bits(rng):
    """One after the other, over the same readings: what one leaves is gone once the next one works."""
    buffers, kinds = Buffers(), {}
    for name in ("arw_shakf", "kalman", "steady_state"):
        lanes = filters(name, 3)
        kinds[name] = filters(name, 3), lanes, Together(lanes[0], buffers)
    for given in in_blocks(3, rng, (300, 1, 300)):
        for alone, lanes, together in kinds.values():
            expected = [one.process(values) for one, values in zip(alone, given, strict=True)]
            for a, b in zip(expected, process(together, lanes, given), strict=True):
                assert_same(a, b)


def test_buffers_are_as_large_as_their_pack_and_hold_nothing_of_other_readings():
    due = np.ones((2, 50), dtype=np.bool_)
    buffers, names = Buffers(), {"rate": False, "innovation": True}
    first = buffers.of(due, 0, 2, names)
    assert {name: array.shape for name, array in first.items()} == {"rate": (2, 50), "innovation": (2, 2, 50)}
    first["rate"][:] = 1.0
    assert np.shares_memory(buffers.of(due, 0, 1, names)["rate"], first["rate"])
    assert buffers.of(due, 0, 3, names)["rate"].shape == (3, 50)
    assert not np.shares_memory(buffers.of(due, 1, 2, names)["rate"], buffers.of(due, 0, 2, names)["rate"])
    due[1, ::2] = False
    assert np.isnan(buffers.of(due, 0, 2, names)["rate"]).all()


@pytest.mark.parametrize("name", ["kalman", "arw_shakf", "steady_state"])
def test_most_go_in_lanes(name, rng, monkeypatch):
    """All but those of their own fate: the sequential kernel is not asked for them."""
    lanes = filters(name, 5)
    together, asked = Together(lanes[0]), []
    monkeypatch.setattr(type(lanes[0]), "estimated", lambda self, *_received: asked.append(self))
    given = [readings(rng, 200) for _ in lanes]
    given[3]["mhd_ars"][9] = np.nan
    process(together, lanes, given)
    assert asked == [lanes[3]]


def test_a_second_process_finds_the_compiled_code(tmp_path, monkeypatch):
    """The folder is the user's alone, the module has its name before numba sees it."""
    code = (
        "from testbed.fusion.lanes.module import module_of\n"
        "m = module_of('from numba import njit\\n@njit(cache=True)\\ndef run(x):\\n    return x + 1\\n')\n"
        "m.run(1)\n"
        "print(sum(m.run.stats.cache_hits.values()))"
    )
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    monkeypatch.delenv("NUMBA_CACHE_DIR", raising=False)
    runs = [subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True) for _ in range(2)]
    assert [run.stdout.strip() for run in runs] == ["0", "1"]
    folder = tmp_path / "testbed" / "kernels"
    assert folder.stat().st_mode & 0o777 == 0o700
    assert len(list(folder.glob("*.py"))) == 1


def test_a_changed_file_is_written_anew(tmp_path, monkeypatch):
    monkeypatch.setattr(module, "_folder", lambda: tmp_path)
    source = "value = 41 + 1\n"
    assert module.module_of(source).value == 42
    (path,) = tmp_path.glob("*.py")
    path.write_text("value = 0\n")
    sys.modules.pop(path.stem)
    assert module.module_of(source).value == 42


def test_a_folder_that_cannot_be_had_is_replaced(tmp_path, monkeypatch):
    (tmp_path / "testbed").write_text("in the way")
    monkeypatch.setattr(module.platformdirs, "user_cache_path", lambda name: tmp_path / name)
    assert module.module_of("value = 7\n").value == 7


def test_a_module_that_was_interrupted_is_made_anew(tmp_path, monkeypatch):
    monkeypatch.setattr(module, "_folder", lambda: tmp_path)
    source = "import os\nif 'INTERRUPTED' in os.environ:\n    raise KeyboardInterrupt\nvalue = 7\n"
    monkeypatch.setenv("INTERRUPTED", "")
    with pytest.raises(KeyboardInterrupt):
        module.module_of(source)
    monkeypatch.delenv("INTERRUPTED")
    assert module.module_of(source).value == 7
