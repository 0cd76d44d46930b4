"""`testbed psd`: densities against what noise and sines must give, through gaps, of differences, of runs."""

from __future__ import annotations

import json
from dataclasses import replace

import numpy as np
import pytest

from testbed.errors import ScenarioError
from testbed.judging.allan_records import RateRecord
from testbed.judging.density import band_edges, difference, estimate_density
from testbed.judging.density_figure import density_figure
from testbed.pages.palette import color_of
from testbed.sensors.noise import GyroNoise
from tests.shell import assert_clear, call

N, FS = 1e-4, 500.0


def white(n=40_000, seed=1):
    return RateRecord("noise", GyroNoise(angle_random_walk=N).sample(n, FS, seed), FS, "noise")


@pytest.mark.oracle
@pytest.mark.parametrize("method", ["welch", "multitaper"])
@pytest.mark.parametrize("two_sided", [False, True])
def test_white_noise_has_its_density_and_its_rms(method, two_sided):
    record = white()
    found = estimate_density(record, method, two_sided=two_sided)
    # Two-sided N^2; the mean over all bins has the spread of the record's variance, 2 / n; five of them.
    expected = N**2 * (1 if two_sided else 2)
    assert found.density.mean() == pytest.approx(expected, rel=5.0 * np.sqrt(2.0 / record.rate.size))
    total = found.bands([found.freq_hz[0], FS])[0].rate
    assert total == pytest.approx(record.rate.std(), rel=0.02)
    assert found.cumulative()[0][-1] == pytest.approx(total)


@pytest.mark.oracle
@pytest.mark.parametrize("method", ["welch", "multitaper"])
def test_95_per_cent_of_the_intervals_hold_the_density(method):
    """Every eighth bin of 40 records, so that neighbours are as good as independent."""
    inside = []
    for seed in range(40):
        found = estimate_density(white(4000, seed), method)
        low, high = found.limits
        density = found.density[20:-20:8]
        inside.append((density * low < 2.0 * N**2) & (density * high > 2.0 * N**2))
    share = np.concatenate(inside)
    # 99.9 % band of a share of 0.95 of so many.
    margin = 3.3 * np.sqrt(0.95 * 0.05 / share.size)
    assert abs(share.mean() - 0.95) < margin + 0.005


@pytest.mark.oracle
def test_a_sine_has_its_rms_as_rate_and_as_angle_in_its_band():
    amplitude, freq = 2e-3, 12.5
    rate = white().rate + amplitude * np.sin(2.0 * np.pi * freq * np.arange(40_000) / FS)
    found = estimate_density(RateRecord("sine", rate, FS, "sine"))
    low, mid, high = found.bands([1.0, 10.0, 20.0, 200.0])
    # The noise of the band, N sqrt(2 x 10 Hz), is 5 % of the power.
    assert mid.rate == pytest.approx(np.hypot(amplitude / np.sqrt(2.0), N * np.sqrt(20.0)), rel=0.02)
    assert mid.angle == pytest.approx(amplitude / np.sqrt(2.0) / (2.0 * np.pi * freq), rel=0.05)
    assert max(low.rate, high.rate) < N * np.sqrt(2.0 * 200.0)
    assert any("12.5 Hz" in note for note in found.notes)


@pytest.mark.oracle
def test_bridging_takes_off_the_top_of_the_density_what_it_says():
    r"""A lost share p, bridged, has the mean of its neighbours: at half the sample rate -1 instead of 1 of their sign,
    so that the mean amplitude is 1 - 2 p of it and the rest of the lost power spreads evenly.
    """
    found = []
    for seed in range(8):
        record = white(seed=seed)
        rate = np.where(np.random.default_rng(seed).random(record.rate.size) < 0.1, np.nan, record.rate)
        one = estimate_density(replace(record, rate=rate))
        found.append(one.density[-one.density.size // 20 :].mean() / (2.0 * N**2))
        (said,) = [note for note in one.notes if "bridged" in note]
        assert f"up to {200.0 * np.isnan(rate).mean():.2g} % is missing" in said
    # Above 1 - 0.2 by the spread of four hundredths of power that ends elsewhere; the mean scatters by 1 %.
    assert 0.77 < np.mean(found) < 0.87


def test_lost_samples_are_left_out_or_bridged_and_told():
    record = white()
    rate = record.rate.copy()
    rate[20_000:20_100] = np.nan
    found = estimate_density(RateRecord("gap", rate, FS, "gap"))
    assert found.notes == ("100 of 40000 samples are missing, left out with their segments",)
    assert found.density.mean() == pytest.approx(2.0 * N**2, rel=0.05)
    rate[::97] = np.nan
    bridged = estimate_density(RateRecord("gaps", rate, FS, "gaps"))
    assert "bridged by straight lines: near half the sample rate up to" in bridged.notes[0]
    assert bridged.density.mean() == pytest.approx(2.0 * N**2, rel=0.05)


@pytest.mark.oracle
def test_a_difference_of_channels_has_the_sum_of_the_noises_and_no_common_signal():
    common = 1e-2 * np.sin(2.0 * np.pi * 3.0 * np.arange(40_000) / FS)
    first, second = (RateRecord(name, white(seed=s).rate + common, FS, name) for s, name in ((1, "a"), (2, "b")))
    found = estimate_density(difference(first, second))
    assert found.density.mean() == pytest.approx(4.0 * N**2, rel=0.05)
    fast = RateRecord("fast", np.repeat(second.rate, 4), 4.0 * FS, "fast")
    assert np.array_equal(difference(first, fast).rate, first.rate - second.rate)
    with pytest.raises(ScenarioError, match="rates of a whole ratio"):
        difference(first, RateRecord("odd", second.rate, 333.0, "odd"))


@pytest.mark.parametrize(
    ("text", "message"), [("1", "edges that increase"), ("2, 1", "edges that"), ("a,b", "--bands")]
)
def test_bad_edges_are_refused(text, message):
    with pytest.raises(ScenarioError, match=message):
        band_edges(text)


def test_the_command_prints_bands_writes_a_figure_and_json(tmp_path):
    path = tmp_path / "log.csv"
    columns = np.stack([np.arange(8000) / FS, *(np.degrees(white(8000, s).rate) for s in (1, 2))], axis=1)
    np.savetxt(path, columns, delimiter=",", header="t [s],a [deg/s],b [deg/s]", comments="", fmt="%.9g")
    result = call("psd", path, "--bands", "1, 10, 100 Hz", cwd=tmp_path)
    assert result.returncode == 0, result.stderr
    assert "density one-sided, Welch" in result.stdout
    assert (tmp_path / "runs" / "psd_log.svg").is_file()
    result = call("psd", path, "--column", "a", "--minus", "b", "--json", "--method", "multitaper", cwd=tmp_path)
    (one,) = json.loads(result.stdout)["densities"]
    assert one["sides"] == 1
    total = np.degrees(2.0 * N * np.sqrt(FS / 2.0))
    assert one["cumulative_rate_deg_s"][-1] == pytest.approx(total, rel=0.05)
    for words in (("--method", "x"), ("--segment", "1 h"), ("--column", "c"), ("--out", "a.jpg")):
        assert_clear(call("psd", path, *words, cwd=tmp_path), 2)


def test_a_curve_has_the_colour_of_its_name_wherever_it_stands():
    rng = np.random.default_rng(1)
    records = [RateRecord(name, rng.standard_normal(4000), 100.0, name) for name in ("gx", "gy", "gz", "heading")]
    estimates = [estimate_density(record) for record in records]
    estimates.append(estimate_density(replace(records[0], name="kalman", signal="fusion/kalman")))

    def colors(chosen):
        lines = density_figure(chosen).axes[0].get_lines()
        return {line.get_label(): line.get_color() for line in lines}

    forward, alone = colors(estimates), colors(estimates[::-1][:2])
    assert len({forward[name] for name in ("gx", "gy", "gz", "heading")}) == 4
    assert alone.items() <= forward.items()
    assert forward["kalman"] == color_of("fusion/kalman")


def test_a_difference_that_is_nothing_is_named():
    record = white(4000)
    with pytest.raises(ScenarioError, match="expected a rate that changes, all are 0 deg/s"):
        estimate_density(difference(record, record))
