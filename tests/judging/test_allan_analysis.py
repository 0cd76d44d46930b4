"""`testbed allan`: what it prints, refuses and draws, judged on noise whose coefficients are known."""

from __future__ import annotations

import re
import subprocess
import sys
from types import SimpleNamespace

import numpy as np
import pytest

import testbed
from testbed.errors import RunError, ScenarioError
from testbed.judging.allan_analysis import TERMS, allan_figure, analyse, write_figure
from testbed.judging.allan_records import RateRecord, read_run
from testbed.sensors.noise import GyroNoise
from tests.scenes import short_file
from tests.shell import assert_clear, call

# Data-sheet values of the ADIS16505 in SI: 0.15 deg/sqrt(h) and 2.7 deg/h.
N = np.deg2rad(0.15) / 60.0
B = np.deg2rad(2.7) / 3600.0


def record(n=50_000, fs=100.0, seed=1, **terms):
    return RateRecord("record", GyroNoise(**terms).sample(n, fs, seed), fs, "noise")


@pytest.fixture(scope="module")
def white_file(tmp_path_factory):
    path = tmp_path_factory.mktemp("records") / "static.csv"
    rate = np.degrees(record(angle_random_walk=N).rate)
    np.savetxt(
        path, np.stack([np.arange(rate.size) / 100.0, rate], axis=1), delimiter=",", header="t,rate", comments=""
    )
    return path


@pytest.fixture(scope="module")
def still_run(tmp_path_factory):
    """Return a run whose table moves by 1 deg/s at 10 Hz, with a gyro that lags: its dynamics must not show."""
    folder = tmp_path_factory.mktemp("runs")
    path = short_file(folder, ("duration: 0.5 s", "duration: 1.5 s"))
    testbed.run(testbed.load_scenario(path), out=folder / "run")
    return folder / "run"


def test_table_shows_estimates_intervals_and_limits(tmp_path, white_file):
    result = call("allan", white_file, "--column", "rate", "--unit", "deg/s", "--rate", "100", cwd=tmp_path)
    assert result.returncode == 0, result.stderr
    cells = [[cell.strip() for cell in line.split("│")[1:-1]] for line in result.stdout.splitlines() if "│" in line]
    rows = {name: rest for name, *rest in cells}
    name, value, interval, unit, si, si_unit = rows["N"]
    low, high = map(float, interval.split(" to "))
    # 50 000 white samples: N is known to about 1/sqrt(2 n) = 0.3 %; five times that.
    assert float(value) == pytest.approx(0.15, rel=0.016)
    assert low < float(value) < high
    assert high / low < 1.03
    assert (name, unit, si_unit) == ("angle random walk", "deg/sqrt(h)", "rad*s^-0.5")
    assert float(si) == pytest.approx(np.deg2rad(float(value)) / 60.0, rel=1e-3)
    for letter in "QBKR":
        assert rows[letter][1].startswith("< ")
        assert rows[letter][2] == "not identified"
        assert rows[letter][4].startswith("< ")
    assert "The five terms describe the curve from 0.01 s to 125 s" in result.stdout
    assert "wrote runs/allan_static.svg" in result.stdout
    assert [path.name for path in (tmp_path / "runs").iterdir()] == ["allan_static.svg"]


@pytest.mark.parametrize("suffix", ["svg", "PNG", "pdf"])
def test_time_column_and_format(tmp_path, white_file, suffix):
    out = f"plots/a.{suffix}"
    result = call("allan", white_file, "--column", "2", "--unit", "deg/s", "--time", "t", "--out", out, cwd=tmp_path)
    assert result.returncode == 0, result.stderr
    head = {"svg": b"<?xml", "PNG": b"\x89PNG", "pdf": b"%PDF"}[suffix]
    assert (tmp_path / out).read_bytes().startswith(head)
    assert not list((tmp_path / "plots").glob(".*"))


@pytest.mark.parametrize(
    "options",
    [
        (),
        ("--unit", "deg/s", "--rate", "10", "--time", "t"),
        ("--unit", "m", "--rate", "1"),
        ("--unit", "deg/s", "--rate", "100", "--column", "rat"),
        ("--unit", "deg/s", "--rate", "100", "--column", "rate", "--out", "a.jpg"),
        ("--unit", "deg/s", "--rate", "100", "--column", "rate", "--min-tau", "100"),
        ("--sensor", "gyro"),
    ],
    ids=" ".join,
)
def test_bad_calls_end_with_2_and_leave_nothing(tmp_path, white_file, options):
    assert_clear(call("allan", white_file, *options, cwd=tmp_path), 2)
    assert not list(tmp_path.iterdir())


def test_run_folder_gives_every_sensor_and_is_left_alone(still_run, tmp_path):
    before = sorted(path.name for path in still_run.iterdir())
    result = call("allan", still_run, cwd=tmp_path)
    assert result.returncode == 0, result.stderr
    assert "mhd_ars of short, less its noise-free reading" in result.stdout
    assert "mems_gyro of short, less its noise-free reading" in result.stdout
    assert "wrote runs/allan_run.svg" in result.stdout
    assert (tmp_path / "runs" / "allan_run.svg").is_file()
    assert sorted(path.name for path in still_run.iterdir()) == before
    assert_clear(call("allan", still_run, "--sensor", "mhd_arz", cwd=tmp_path), 2)
    assert_clear(call("allan", still_run, "--unit", "deg/s", cwd=tmp_path), 2)


def test_motion_and_dynamics_do_not_show_in_the_record_of_a_run(still_run):
    run = testbed.open_run(still_run)
    for one in read_run(still_run):
        name = one.name.removeprefix("short_")
        moving = run.sensors[name].rate - np.interp(run.sensors[name].time, run.truth.time, run.truth[f"{name}_rate"])
        line = np.exp(-2j * np.pi * 10.0 * np.arange(one.rate.size) / one.sample_rate_hz)
        left = abs(2.0 * np.mean(one.rate * line[: one.rate.size]))
        # One second of white noise: a line of it has the standard deviation 2 N / sqrt(2 T); six of them.
        assert left < 6.0 * np.sqrt(2.0) * N
        if name == "mems_gyro":
            # What subtracting the truth itself would leave: 10 Hz through a low-pass of 4.5 Hz.
            assert np.abs(moving).max() > 0.5 * np.deg2rad(1.0)


def test_white_noise_of_the_mhd_ars_is_found_in_a_run(still_run):
    found = analyse(read_run(still_run, "mhd_ars")[0]).fit
    assert found.goodness.accepted
    # 1e-7 rad/sqrt(s) assumed in the preset, and 2.3e-4 deg/s of rounding at 20 kHz: 8e-9 in quadrature.
    margin = 2.0 * (found.angle_random_walk.upper - found.angle_random_walk.lower)
    assert found.angle_random_walk.value == pytest.approx(np.hypot(1e-7, 8.2e-9), abs=margin)


def test_the_record_of_a_run_begins_after_settling(still_run):
    scenario = testbed.load_scenario(still_run / "scenario.yaml")
    seconds = scenario.frame.duration - scenario.frame.settle
    assert scenario.frame.settle > 0.0
    for one in read_run(still_run):
        assert one.rate.size == round(seconds * one.sample_rate_hz)


def test_a_sensor_with_gaps_is_analysed_beside_the_others(still_run, monkeypatch):
    run = testbed.open_run(still_run)

    def with_gaps(rate):
        return SimpleNamespace(rate=np.where(np.arange(rate.size) % 90 == 7, np.nan, rate))

    sensors = {name: with_gaps(signals.rate) for name, signals in run.sensors.items()}
    monkeypatch.setattr(
        "testbed.runs.results.RunRecord.open",
        lambda _: SimpleNamespace(sensors=sensors, truth=run.truth, metrics=run.metrics),
    )
    for record in read_run(still_run):
        assert np.isnan(record.rate).any()
        assert analyse(record).fit.angle_random_walk.upper > 0.0


@pytest.mark.oracle
@pytest.mark.parametrize(
    ("terms", "fs", "flag"),
    [
        ({"angle_random_walk": N, "markov_bias": 20.0 * B, "markov_time": 3.0}, 100.0, "--max-tau"),
        ({"markov_bias": B, "markov_time": 0.3}, 100.0, "--min-tau"),
    ],
    ids=["white and Markov", "Markov alone"],
)
def test_what_is_no_such_noise_is_refused_with_a_range_that_may_do(terms, fs, flag):
    analysis = analyse(record(fs=fs, **terms))
    assert not analysis.fit.goodness.accepted
    assert "so no coefficient is given" in analysis.verdict()
    advice = re.search(rf"{flag} ([\d.e+-]+)\.$", analysis.verdict())
    assert advice is not None, analysis.verdict()
    narrowed = analyse(record(fs=fs, **terms), **{flag[2:].replace("-", "_"): float(advice[1])})
    assert narrowed.fit.goodness.accepted


@pytest.mark.oracle
def test_low_pass_at_short_tau_is_refused_and_its_white_noise_found_beyond():
    """A gyro's white noise through its low-pass of 480 Hz: no term of the model falls towards short averaging times."""
    gyro = testbed.sensors.load_preset("adis16505")
    readings = gyro.sample(np.zeros(400_000), 20000.0, seed=3)
    whole = RateRecord("gyro", readings, 2000.0, "gyro")
    assert not analyse(whole).fit.goodness.accepted
    # Twenty times the low-pass's time constant: its share of sigma^2 is under 1.5 / 20 of what is not folded in.
    beyond = analyse(whole, min_tau=0.02)
    assert beyond.fit.goodness.accepted
    found = beyond.fit.angle_random_walk
    assert found.lower < N < found.upper


def test_a_refused_fit_prints_no_coefficient(tmp_path):
    rate = record(markov_bias=B, markov_time=0.3).rate
    np.savetxt(tmp_path / "markov.txt", rate)
    result = call("allan", "markov.txt", "--unit", "rad/s", "--rate", "100", cwd=tmp_path)
    assert result.returncode == 0, result.stderr
    assert "do NOT describe the curve" in result.stdout
    assert "│" not in result.stdout
    for term in TERMS:
        assert term.unit not in result.stdout.replace("rad/s", "")
    figure = (tmp_path / "runs" / "allan_markov.svg").read_text()
    assert figure.startswith("<?xml")


@pytest.mark.parametrize(
    ("rate", "message"),
    [
        (np.ones(1000), "all readings are 57.2958 deg/s: rounded to words above"),
        (np.array([1.0, 2.0]), "at least 4 samples"),
        (np.array([1.0, 2.0, 1.0, 3.0, 2.0, 5.0, 1.0, 0.0]), "expected at least 5 averaging times, got 2"),
        (np.array([1.0, np.inf, 1.0, 3.0]), "got inf at sample 1"),
        (np.array([1.0, np.nan, np.nan, np.nan, 3.0]), "at least half of 5 samples, got 2"),
    ],
)
def test_records_without_noise_or_length_are_refused(rate, message):
    with pytest.raises(ScenarioError, match=message):
        analyse(RateRecord("x", rate, 100.0, "x"))


def test_figure_shows_band_sum_and_each_term():
    analyses = [
        analyse(record(angle_random_walk=N, rate_random_walk=5e-5)),
        analyse(record(markov_bias=B, markov_time=0.3)),
    ]
    figure = allan_figure(analyses)
    first, second = figure.axes
    labels = first.get_legend_handles_labels()[1]
    assert {"95 % band", "measured", "fitted sum"} < set(labels)
    assert any(re.fullmatch(r"N = 0\.1\d+ deg/sqrt\(h\)", label) for label in labels)
    assert any(label.startswith("K = ") for label in labels)
    # The drawn terms add in variance to the drawn sum.
    lines = {line.get_label(): line.get_ydata() for line in first.lines}
    parts = sum(np.square(values) for label, values in lines.items() if re.match("[QNBKR] [=<] ", label))
    np.testing.assert_allclose(np.sqrt(parts), lines["fitted sum"], rtol=1e-12)
    refused = second.get_legend_handles_labels()[1]
    assert "best sum of five terms: refused" in refused
    assert not any(re.match("[QNBKR] [=<] ", label) for label in refused)


def test_figure_file_is_the_same_again_and_whole_or_not_at_all(tmp_path, monkeypatch):
    one = analyse(record(n=2000, angle_random_walk=N))
    for suffix in ("svg", "png", "pdf"):
        first = write_figure(allan_figure([one]), tmp_path / f"a.{suffix}").read_bytes()
        assert write_figure(allan_figure([one]), tmp_path / f"b.{suffix}").read_bytes() == first
    before = sorted(tmp_path.iterdir())

    def full(*_):
        raise OSError(28, "No space left on device")

    monkeypatch.setattr("pathlib.Path.replace", full)
    with pytest.raises(RunError, match="the disk is full"):
        write_figure(allan_figure([one]), tmp_path / "c.svg")
    assert sorted(tmp_path.iterdir()) == before


@pytest.mark.oracle
@pytest.mark.parametrize(
    ("name", "si"),
    # One of each data-sheet unit in SI, by hand: 1 deg = pi/180 rad, 1 h = 3600 s, sqrt(h) = 60 sqrt(s).
    [
        ("quantization", 1e-6),
        ("angle_random_walk", np.pi / 180 / 60),
        ("bias_instability", np.pi / 180 / 3600),
        ("rate_random_walk", np.pi / 180 / 3600 / 60),
        ("rate_ramp", np.pi / 180 / 3600 / 3600),
    ],
)
def test_data_sheet_units_after_ieee_952(name, si):
    term = next(term for term in TERMS if term.name == name)
    assert term.in_unit(si) == pytest.approx(1.0, rel=1e-14)


def test_the_picture_library_is_loaded_only_to_draw(tmp_path):
    code = "import sys, testbed.allan.curve, testbed.judging.allan_records\nprint('matplotlib' in sys.modules)"
    result = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True, cwd=tmp_path)
    assert result.stdout.strip() == "False"
