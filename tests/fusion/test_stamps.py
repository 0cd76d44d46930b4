"""Readings with stamps and rates in any ratio: exact at their times, the same bits for any blocks, or a refusal."""

from __future__ import annotations

from functools import partial
from itertools import pairwise
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest
from scipy.linalg import expm

from testbed.fusion import FILTERS, EstimateBlock
from testbed.fusion import estimate as judged
from testbed.fusion.belief import default_belief
from testbed.fusion.kernels.covariance import NODES
from testbed.fusion.model import FusionModel, build_model
from testbed.fusion.stamps import Stamps, rates_of, regular
from testbed.fusion.transitions import N_NODE, steps_of, transition_nodes
from testbed.parts import resolve
from testbed.signals import FloatArray, random_stream

if TYPE_CHECKING:
    from numpy.typing import NDArray

DEG = np.pi / 180.0
STEPPING = [name for name in FILTERS if resolve("filter", name, FILTERS).any_clock]
REGULAR_ONLY = [name for name in FILTERS if name not in STEPPING]

estimate = partial(judged, verdict=False)
Stamped = tuple[dict[str, FloatArray], dict[str, "NDArray[np.int64]"]]


def record(
    fast_hz: float, slow_hz: float, n: int, *, jitter: float = 0.0, offset: float = 0.3, seed: int = 1
) -> Stamped:
    """Return readings of 4 Hz, 1 deg/s with white noise and their stamps [ns]; `jitter` and `offset` in fast steps."""
    random = random_stream(seed, "stamps")
    times = {"mhd_ars": np.arange(n) / fast_hz, "mems_gyro": np.arange(int(n * slow_hz / fast_hz)) / slow_hz}
    times["mems_gyro"] += offset / fast_hz
    times = {name: np.sort(t + jitter / fast_hz * random.uniform(-0.5, 0.5, t.size)) for name, t in times.items()}
    rate = {name: DEG * np.sin(2.0 * np.pi * 4.0 * t) for name, t in times.items()}
    noise = {"mhd_ars": 1e-5, "mems_gyro": 1e-3}
    readings = {name: w + noise[name] * random.standard_normal(w.size) for name, w in rate.items()}
    return readings, {name: 5_000_000_000 + np.rint(1e9 * t).astype(np.int64) for name, t in times.items()}


def built(name: str, rates: dict[str, float], **parameters: Any) -> Any:
    kind = resolve("filter", name, FILTERS)
    return kind(default_belief(), rates, kind.Parameters(**parameters))


def same(a: EstimateBlock, b: EstimateBlock) -> bool:
    keys = set(a.diagnostics) & set(b.diagnostics)
    pairs = [(a.rate, b.rate), (a.std, b.std), *((a.diagnostics[key], b.diagnostics[key]) for key in keys)]
    return all(np.array_equal(x, y, equal_nan=True) for x, y in pairs)


def exact(model: FusionModel, readings: dict[str, FloatArray], stamps: dict[str, Any]) -> tuple[FloatArray, FloatArray]:
    """Return rate and std of the Kalman filter at the stamps of the MHD ARS: Van Loan at each exact time, Joseph."""
    at: dict[int, dict[int, float]] = {}
    for i, name in enumerate(model.sensors):
        for t, z in zip(stamps[name].tolist(), readings[name].tolist(), strict=True):
            at.setdefault(t, {})[i] = z
    n, shown = len(model.A), set(stamps["mhd_ars"].tolist())
    block = np.block([[-model.A, model.Qc], [np.zeros((n, n)), model.A.T]])
    x, P, before, out = np.zeros(n), model.P0.copy(), None, []
    for t in sorted(at):
        if before is not None:
            power = expm(block * 1e-9 * (t - before))
            F = power[n:, n:].T
            x, P = F @ x, F @ P @ F.T + F @ power[:n, n:]
        for i in sorted(at[t]):
            if np.isfinite(at[t][i]):
                h = model.H[i]
                K = P @ h / (h @ P @ h + model.R[i])
                keep = np.eye(n) - np.outer(K, h)
                x, P = x + K * (at[t][i] - h @ x), keep @ P @ keep.T + model.R[i] * np.outer(K, K)
        before = t
        if t in shown:
            out.append((x[0], np.sqrt(P[0, 0])))
    rate, std = np.array(out).T
    return rate, std


@pytest.mark.oracle
@pytest.mark.parametrize(
    ("fast_hz", "slow_hz", "jitter"),
    [(20e3, 2003.704, 0.0), (20e3, 6664.0, 0.0), (1e3, 400.0, 0.0), (20e3, 2003.704, 0.2), (1e3, 400.0, 0.6)],
)
@pytest.mark.parametrize("order", [1, 3])
def test_kalman_is_that_of_the_exact_times(fast_hz: float, slow_hz: float, jitter: float, order: int) -> None:
    """With a gap of 37 fast readings and a reading that is none. The gyro's pole of 8.5 krad/s moves between nodes of
    1 kHz by 6.7 %, whose square over 8 is 6e-4.
    """
    readings, stamps = record(fast_hz, slow_hz, 900, jitter=jitter)
    kept = np.r_[:400, 437:900]
    readings["mhd_ars"], stamps["mhd_ars"] = readings["mhd_ars"][kept], stamps["mhd_ars"][kept]
    readings["mems_gyro"][20] = np.nan
    rates, q = {"mhd_ars": fast_hz, "mems_gyro": slow_hz}, {1: 0.3 * DEG**2, 3: 1e10 * DEG**2}[order]
    found = estimate("kalman", readings, time_ns=stamps, sample_rate_hz=rates, order=order, gate=False)
    model = build_model(default_belief(), rates, order=order, q=q, coloured=True, any_ratio=True)
    rate, std = exact(model, readings, stamps)
    assert np.array_equal(found.time_ns, stamps["mhd_ars"])
    np.testing.assert_array_less(np.abs(found.rate - rate), 6e-4 * std)
    np.testing.assert_allclose(found.std, std, rtol=6e-4)


@pytest.mark.oracle
def test_transitions_between_nodes_are_as_close_as_said() -> None:
    """The pole at the Nyquist rate of the step, where the bound is largest, and a slow one."""
    step = 1e-3
    for rate, bound in ((np.pi / step, (np.pi / NODES) ** 2 / 8.0), (10.0, (10.0 * step / NODES) ** 2 / 8.0)):
        A, Qc = np.array([[0.0, 0.0], [rate, -rate]]), np.diag([1.0, 0.0])
        F, Q = transition_nodes(A, Qc, step)
        assert F.shape == Q.shape == (N_NODE, 2, 2)
        for where in (0.5, 63.5, 127.5, 191.5):
            j, exact_F = int(where), expm(A * step * where / NODES)
            assert np.abs(0.5 * (F[j] + F[j + 1]) - exact_F).max() <= bound + 1e-14
        assert np.linalg.eigvalsh(0.5 * (Q[0] + Q[1])).min() >= -1e-18


@pytest.mark.parametrize("name", STEPPING)
def test_regular_stamps_give_the_bits_of_regular_steps(name: str) -> None:
    """The two ways of computing, side by side, through readings that are none."""
    readings, stamps = record(20e3, 2e3, 5000, offset=0.0)
    readings["mhd_ars"][3000:3050], readings["mems_gyro"][400] = np.nan, np.nan
    rates = {"mhd_ars": 20e3, "mems_gyro": 2e3}
    even, timed = built(name, rates).process(readings), built(name, rates).process(readings, stamps)
    assert same(even, timed)
    assert set(timed.diagnostics) - set(even.diagnostics) == {"late_mhd_ars", "late_mems_gyro"}


@pytest.mark.parametrize("name", STEPPING)
def test_a_gap_in_the_stamps_is_one_in_the_readings(name: str) -> None:
    """To the bit: what is not there is stepped over as what is no reading, with slow readings inside and without."""
    readings, stamps = record(20e3, 2e3, 3000, offset=0.0)
    rates, gap = {"mhd_ars": 20e3, "mems_gyro": 2e3}, np.r_[1001:1008, 2001:2143]
    holed = readings | {"mhd_ars": readings["mhd_ars"].copy()}
    holed["mhd_ars"][gap] = np.nan
    even = built(name, rates).process(holed)
    less = {"mhd_ars": np.delete(stamps["mhd_ars"], gap), "mems_gyro": stamps["mems_gyro"]}
    timed = built(name, rates).process(readings | {"mhd_ars": np.delete(readings["mhd_ars"], gap)}, less)
    assert np.array_equal(np.delete(even.rate, gap), timed.rate)
    assert np.array_equal(np.delete(even.std, gap), timed.std)


@pytest.mark.parametrize("name", STEPPING)
def test_any_division_of_stamps_into_blocks_gives_the_same_bits(name: str) -> None:
    readings, stamps = record(20e3, 6664.0, 3000, jitter=0.3)
    readings["mhd_ars"], stamps["mhd_ars"] = (np.delete(x["mhd_ars"], np.s_[900:990]) for x in (readings, stamps))
    rates = {"mhd_ars": 20e3, "mems_gyro": 6664.0}
    whole, stage, blocks = built(name, rates).process(readings, stamps), built(name, rates), []
    ends = np.array([0.0, 1e-6, 0.01, 0.0101, 0.0466, 0.0467, 0.1, 1.0]) * 1e9 + 5_000_000_000 - 1e6
    for begin, end in pairwise(ends):
        cut = {key: slice(*np.searchsorted(one, [begin, end])) for key, one in stamps.items()}
        blocks.append(stage.process(*({key: one[cut[key]] for key, one in x.items()} for x in (readings, stamps))))
    joined = EstimateBlock(
        np.concatenate([one.rate for one in blocks]),
        np.concatenate([one.std for one in blocks]),
        {key: np.concatenate([one.diagnostics[key] for one in blocks]) for key in whole.diagnostics},
    )
    assert same(joined, whole)
    assert whole.rate.size == stamps["mhd_ars"].size
    assert np.all(np.isfinite(whole.rate) & (whole.std > 0.0))
    # Each reading of the gyro that is not struck out is judged at the next stamp that is shown.
    shown = np.isfinite(whole.diagnostics["innovation_mems_gyro"]).sum()
    assert stamps["mems_gyro"].size - 31 <= shown <= stamps["mems_gyro"].size


def test_late_readings_are_dropped_and_counted() -> None:
    readings, stamps = record(1e3, 400.0, 400)
    rates = {"mhd_ars": 1e3, "mems_gyro": 400.0}
    stage = built("kalman", rates)
    first = stage.process(
        {"mhd_ars": readings["mhd_ars"][:200], "mems_gyro": readings["mems_gyro"][:77]},
        {"mhd_ars": stamps["mhd_ars"][:200], "mems_gyro": stamps["mems_gyro"][:77]},
    )
    assert first.diagnostics["late_mems_gyro"].tolist() == [0.0] * 200
    second = stage.process(
        {"mhd_ars": readings["mhd_ars"][198:], "mems_gyro": readings["mems_gyro"][77:]},
        {"mhd_ars": stamps["mhd_ars"][198:], "mems_gyro": stamps["mems_gyro"][77:]},
    )
    # Three of the gyro and one of the MHD ARS before its last, 199, which is as old as the last step.
    assert second.diagnostics["late_mems_gyro"].tolist() == [3.0] * 201
    assert second.diagnostics["late_mhd_ars"].tolist() == [1.0] * 201
    assert second.time_ns is not None
    assert second.time_ns.tolist() == stamps["mhd_ars"][199:].tolist()
    kept = {key: np.delete(one["mems_gyro"], np.s_[77:80]) for key, one in (("z", readings), ("t", stamps))}
    z, t = readings | {"mems_gyro": kept["z"]}, stamps | {"mems_gyro": kept["t"]}
    z["mhd_ars"], t["mhd_ars"] = (np.insert(one["mhd_ars"], 199, one["mhd_ars"][199]) for one in (z, t))
    without = built("kalman", rates).process(z, t)
    assert np.array_equal(np.concatenate([first.rate, second.rate]), without.rate)


@pytest.mark.parametrize("name", ["kalman", "wideband", "complementary"])
def test_a_clock_that_all_share_may_be_off(name: str) -> None:
    """So the fastest sensor of a scenario stays on the run's: what its clock is off by, the others' are the other way.
    Every step is longer by e, and with it each mode's phase over it and each variance: an estimate moves by a few e.
    """
    e, rates = 20e-6, {"mhd_ars": 20e3, "mems_gyro": 2003.704}
    readings, stamps = record(20e3, 2003.704, 4000)
    begin = 5_000_000_000
    late = {key: begin + np.rint((one - begin) * (1.0 + e)).astype(np.int64) for key, one in stamps.items()}
    true, off = (built(name, rates).process(readings, one).rate for one in (stamps, late))
    assert np.abs(off - true).max() < 10.0 * e * np.abs(true).max()
    assert np.any(off != true)


def test_a_file_is_sorted_first() -> None:
    readings, stamps = record(1e3, 400.0, 300)
    order = {name: random_stream(3, name).permutation(one.size) for name, one in stamps.items()}
    mixed = [{name: one[order[name]] for name, one in each.items()} for each in (readings, stamps)]
    found = estimate("kalman", mixed[0], time_ns=mixed[1])
    assert same(found, estimate("kalman", readings, time_ns=stamps))
    assert not found.diagnostics["late_mems_gyro"].any()


@pytest.mark.parametrize("name", ["kalman", "wideband"])
def test_rates_in_any_ratio_are_the_stamps_that_they_imply(name: str) -> None:
    readings, _ = record(1e3, 400.0, 300)
    rates = {"mhd_ars": 1e3, "mems_gyro": 400.0}
    stamps = {key: np.rint(np.arange(one.size) / rates[key] * 1e9).astype(np.int64) for key, one in readings.items()}
    whole = estimate(name, readings, sample_rate_hz=rates)
    assert same(whole, estimate(name, readings, sample_rate_hz=rates, time_ns=stamps))
    stage, parts = built(name, rates), []
    for a, b in ((0, 7), (7, 8), (8, 151), (151, 300)):
        cut = slice(-(-a * 2 // 5), -(-b * 2 // 5))
        parts.append(stage.process({"mhd_ars": readings["mhd_ars"][a:b], "mems_gyro": readings["mems_gyro"][cut]}))
    assert np.array_equal(np.concatenate([one.rate for one in parts]), whole.rate)
    with pytest.raises(ValueError, match=r"expected 2 of 'mems_gyro' in 0\.005 s, got 3"):
        built(name, rates).process({"mhd_ars": np.zeros(5), "mems_gyro": np.zeros(3)})


@pytest.mark.parametrize("name", REGULAR_ONLY)
def test_a_method_of_regular_steps_refuses_other_clocks_by_name(name: str) -> None:
    kind = resolve("filter", name, FILTERS).__name__
    readings, stamps = record(20e3, 2e3, 200)
    refusal = f"time_ns: {kind} takes readings at regular steps only, no stamps; resample them, or take `kalman`"
    with pytest.raises(ValueError, match=f"^{refusal}$"):
        estimate(name, readings, time_ns=stamps)
    with pytest.raises(ValueError, match=f"integer multiple of 'mems_gyro' for {kind}, got 2003.7 Hz; `kalman`"):
        built(name, {"mhd_ars": 20e3, "mems_gyro": 2003.7})


@pytest.mark.parametrize("name", list(FILTERS))
def test_stamps_that_are_regular_are_no_other_clock(name: str) -> None:
    """So that a recording of a run gives what the run did, of methods that take no stamps too."""
    readings, stamps = record(20e3, 2e3, 200, offset=0.0)
    found = estimate(name, readings, time_ns=stamps)
    rates = {"mhd_ars": 20e3, "mems_gyro": 2e3}
    assert rates_of(stamps) == rates
    assert regular(stamps, rates)
    assert same(found, estimate(name, readings, sample_rate_hz=rates))
    assert np.array_equal(found.time_ns, stamps["mhd_ars"])


def test_q_that_adapts_takes_regular_steps_only() -> None:
    readings, stamps = record(1e3, 400.0, 100)
    with pytest.raises(ValueError, match="adapt: Shakf adapts Q at regular steps only"):
        estimate("shakf", readings, time_ns=stamps, adapt=["R", "Q"])


def test_a_filter_of_ones_own_gets_stamps_only_if_it_says_so() -> None:
    class Mean:
        def __init__(self, _belief: Any, _rates: Any, _parameters: Any) -> None: ...

        def process(self, readings: dict[str, FloatArray]) -> EstimateBlock:
            n = readings["mhd_ars"].size
            return EstimateBlock(np.zeros(n), np.ones(n), {})

    readings, stamps = record(1e3, 400.0, 100)
    with pytest.raises(ValueError, match="takes readings at regular steps only"):
        estimate(Mean, readings, time_ns=stamps)
    assert not estimate(Mean, readings, sample_rate_hz={"mhd_ars": 1e3, "mems_gyro": 400.0}).rate.any()


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"mems_gyro": np.arange(40.0)}, "whole number of nanoseconds for each of the readings of 'mems_gyro'"),
        ({"mems_gyro": np.arange(39)}, r"'mems_gyro', shape \(40,\), got int64 of shape \(39,\)"),
        ({"mems_gyro": np.arange(40) + 2**62}, "within 146 years"),
        ({"mems_gyro": np.zeros(40, int)}, "at least two different stamps of 'mems_gyro'"),
        ({"other": np.arange(40)}, "expected the sensors"),
    ],
)
def test_bad_stamps_are_refused(change: dict[str, Any], message: str) -> None:
    readings, stamps = record(1e3, 400.0, 100)
    with pytest.raises(ValueError, match=message):
        estimate("kalman", readings, time_ns=stamps | change)


def test_stamps_come_in_every_block_or_in_none() -> None:
    readings, stamps = record(20e3, 2e3, 100)
    stage = built("kalman", {"mhd_ars": 20e3, "mems_gyro": 2e3})
    stage.process(readings)
    with pytest.raises(ValueError, match="in every block or in none"):
        stage.process(readings, stamps)
    with pytest.raises(ValueError, match="sample_rate_hz: expected the rate of each sensor, or time_ns"):
        estimate("kalman", readings)


def test_rates_are_found_through_gaps_and_coarse_stamps() -> None:
    """Stamps in milliseconds of 700 Hz lie 1 or 2 apart; a tenth of a second is missing."""
    exact_ns = np.delete(np.arange(7000) / 700.0 * 1e9, np.s_[3000:3070])
    assert rates_of({"a": np.rint(exact_ns).astype(np.int64)})["a"] == pytest.approx(700.0, rel=1e-6)
    coarse = 1_000_000 * np.rint(exact_ns / 1e6).astype(np.int64)
    assert rates_of({"a": coarse})["a"] == pytest.approx(700.0, rel=0.03)


def test_a_step_without_a_reading_is_marked_where_a_sensor_is_silent() -> None:
    """Once, 1.5 periods after its last reading; a gap of all sensors has a step of its own."""
    stamps = {"a": np.array([0, 10, 20, 30, 40, 100]), "b": np.array([0, 20])}
    Z, timing = Stamps({"a": 1e8, "b": 5e7}).spread({"a": np.ones(6), "b": np.ones(2)}, stamps)
    assert np.isinf(Z[0]).tolist() == [False] * 5 + [True, False]
    assert np.isinf(Z[1]).tolist() == [False] * 5 + [True, False]
    steps = steps_of(timing.length)
    assert steps.whole.tolist() == [0] * 6 + [4]
    assert steps.node.tolist() == [NODES] * 7
    assert timing.shown.tolist() == [True] * 5 + [False, True]
