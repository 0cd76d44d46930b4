"""From a recording to a belief: the library, the command, and every refusal with its reason."""

from __future__ import annotations

import json

import numpy as np
import pytest

import testbed
from testbed.fusion.belief import load_belief
from tests.cli.test_grammar import say
from tests.identification.records import BASE_HZ, EXCITATIONS, OUTPUT_HZ, REFERENCE_HZ, once, record, rest

BIAS = 0.05


def written(folder, one, *, angle=False):
    """Write a record as two files of their own clocks, as two loggers do, and the map that joins them."""
    unit = "deg" if angle else "deg/s"
    for name, series in (("encoder", one.reference), ("gyro", one.output)):
        t = np.rint(1e9 * np.arange(series.values.size) / series.sample_rate_hz).astype(np.int64)
        values = np.degrees(series.values) + (BIAS if name == "gyro" else 0.0)
        rows = [f"{a},{b!r}" for a, b in zip(t.tolist(), values.tolist(), strict=True)]
        head = f"t [ns],{name} [{unit if name == 'encoder' else 'deg/s'}]"
        (folder / f"{name}.csv").write_text("\n".join([head, *rows]) + "\n")
    path = folder / "log.yaml"
    path.write_text(
        "channels:\n"
        f"  reference: {{file: encoder.csv, column: encoder, {'kind: angle, ' if angle else ''}time: {{column: t}}}}\n"
        "  mhd_ars: {file: gyro.csv, column: gyro, time: {column: t}}\n"
    )
    return path


@pytest.fixture(scope="module")
def identified(tmp_path_factory):
    folder = tmp_path_factory.mktemp("log")
    one = record(EXCITATIONS["multisine"], 11, as_angle=True)
    log = testbed.read_log(written(folder, one, angle=True))
    return one, testbed.identify_sensors(log, "reference", "mhd_ars")[0]


@pytest.mark.oracle
def test_an_encoder_of_another_clock_tells_what_a_sensor_is(identified):
    one, found = identified
    freq = np.array([2.0, 10.0, 60.0])
    # The belief has the delay by an approximation that is a milliradian off at 426 Hz.
    np.testing.assert_allclose(found.belief.realisation().response(freq), one.response(freq), rtol=2e-3)
    assert found.belief.delay == pytest.approx(one.delay, rel=0.0, abs=10e-6)
    assert np.degrees(found.belief.bias) == pytest.approx(BIAS, rel=0.2, abs=0.0)
    noise = found.belief.input_noise**2 + found.belief.output_noise**2
    # Some 130 degrees of freedom: 12 % for one standard deviation.
    assert noise == pytest.approx(1e-8 / OUTPUT_HZ, rel=0.5, abs=0.0)


def test_the_command_writes_what_the_library_says(tmp_path, monkeypatch, capsys, identified):
    one, found = identified
    path = written(tmp_path, one, angle=True)
    monkeypatch.chdir(tmp_path)
    words = ("identify", str(path), "--input", "reference", "--output", "mhd_ars", "--out", "own.yaml")
    status, out, _ = say(*words, "--json", monkeypatch=monkeypatch, capsys=capsys)
    assert status == 0
    document = json.loads(out)
    sensor = document["sensors"][0]
    assert document["written"] == "own.yaml"
    assert sensor["frequency_hz"] == pytest.approx(found.measured.response.freq_hz, rel=1e-9, abs=0.0)
    assert load_belief("own.yaml")["mhd_ars"].model_copy(update={"source": "given"}) == found.belief
    figure = (tmp_path / "runs" / "identify_log.svg").read_text()
    assert "gain" in figure
    status, out, _ = say(*words, monkeypatch=monkeypatch, capsys=capsys)
    assert "dead time: " in out
    assert "ppm" in out


def test_a_scenario_uses_the_belief(tmp_path, identified):
    from testbed.identification.belief_text import belief_text

    _, found = identified
    (tmp_path / "own.yaml").write_text(belief_text([found], "a test"))
    (tmp_path / "s.yaml").write_text(
        "name: own\nduration: 0.5 s\nsettle: 0.2 s\nturntable: {mode: fixed}\nmotion: [{static: {}}]\n"
        "sensors: {mhd_ars: {preset: sx300}}\nfusion: {kalman: {belief: own.yaml}}\n"
    )
    scenario = testbed.load_scenario(tmp_path / "s.yaml")
    assert scenario.fusion["kalman"].belief["mhd_ars"].delay == found.belief.delay
    assert scenario.fusion["kalman"].belief["mhd_ars"].source == "own.yaml"


def hum(series, freq):
    t = np.arange(series.values.size) / series.sample_rate_hz
    series.values[:] += 1e-3 * np.sin(2.0 * np.pi * freq * t)


@pytest.mark.parametrize(
    ("what", "message"),
    [
        ("noise", "nothing of mhd_ars follows reference; both are noise"),
        ("hum of the output", r"mhd_ars has a line at 50 Hz, of which reference has nothing: no excitation"),
        ("hum of the reference", r"reference has a line at 37 Hz, of which mhd_ars has nothing"),
        ("hum of both", r"both have a line at 50 Hz, the mains' frequency"),
        ("once", "passes each frequency once.*--one-clock"),
    ],
)
def test_what_is_no_excitation_is_refused_with_the_reason(tmp_path, what, message):
    one = record(once if what == "once" else rest, 5, reference_std=1e-5)
    if what in ("hum of the output", "hum of both"):
        hum(one.output, 50.0)
    if what in ("hum of the reference", "hum of both"):
        hum(one.reference, 50.0 if what == "hum of both" else 37.0)
    log = testbed.read_log(written(tmp_path, one))
    with pytest.raises(testbed.ScenarioError, match=message):
        testbed.identify_sensors(log, "reference", "mhd_ars")


def test_channels_of_the_same_rows_have_one_clock(tmp_path):
    one = record(once, 2, clock=0.0)
    n = min(one.reference.values.size, one.output.values.size)
    assert REFERENCE_HZ == OUTPUT_HZ < BASE_HZ
    table = np.column_stack([one.reference.values[:n], one.output.values[:n]])
    np.savetxt(tmp_path / "bench.csv", table, header="laser [rad/s],gyro [rad/s]", comments="", delimiter=",")
    time = {"rate": REFERENCE_HZ}
    channels = {name: {"column": name, "time": time} for name in ("laser", "gyro")}
    log = testbed.read_log(tmp_path / "bench.csv", {"channels": channels})
    found = testbed.identify_sensors(log, "laser", ["gyro"])[0]
    assert found.measured.response.clock.std == 0.0
    assert found.belief.delay == pytest.approx(one.delay, rel=0.0, abs=20e-6)


def test_noise_that_is_too_small_beside_the_references_is_said(tmp_path, rng):
    """Of an output without noise, and of one with some, beside a reference that is as noisy as that one."""
    n, lines = 10_000, (3.0, 7.0, 19.0, 43.0, 97.0, 151.0)
    rate = sum(np.sin(2.0 * np.pi * freq * np.arange(n) / 500.0) for freq in lines)
    columns = rate + np.array([[1e-2], [1e-6], [1e-2]]) * rng.standard_normal((3, n))
    head = "laser [rad/s],quiet [rad/s],loud [rad/s]"
    np.savetxt(tmp_path / "bench.csv", columns.T, header=head, comments="", delimiter=",")
    channels = {name: {"column": name, "time": {"rate": 500.0}} for name in ("laser", "quiet", "loud")}
    log = testbed.read_log(tmp_path / "bench.csv", {"channels": channels})
    quiet, loud = testbed.identify_sensors(log, "laser", ["quiet", "loud"])
    said = "its own noise is too small beside that of the reference"
    assert any(note.startswith(said) for note in quiet.notes)
    assert not any(note.startswith(said) for note in loud.notes)
    # Between the lines the reference's is none of theirs. Hundreds of degrees of freedom: some per cent.
    for sensor, std in ((quiet, 1e-6), (loud, 1e-2)):
        found = np.hypot(sensor.belief.input_noise, sensor.belief.output_noise)
        assert found == pytest.approx(std / np.sqrt(500.0), rel=0.2, abs=0.0)


@pytest.mark.parametrize("outputs", [("laser",), ("gyro", "gyro")])
def test_a_channel_that_is_named_twice_is_refused(tmp_path, monkeypatch, capsys, outputs):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "log.csv").write_text("t [s],laser [deg/s],gyro [deg/s]\n0,1,1\n")
    words = [word for name in outputs for word in ("--output", name)]
    status, _, err = say("identify", "log.csv", "--input", "laser", *words, monkeypatch=monkeypatch, capsys=capsys)
    assert status == 2
    assert f"--output: expected each channel once, got '{outputs[0]}' 2 times" in err


def test_what_a_recordings_words_leave_open_a_map_says(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "log.csv").write_text("t [s],laser,gyro\n" + "".join(f"{k / 10},{k % 7},{k % 5}\n" for k in range(50)))
    words = ("identify", "log.csv", "--input", "laser", "--output", "gyro")
    status, _, err = say(*words, monkeypatch=monkeypatch, capsys=capsys)
    assert status == 2
    assert "testbed log inspect log.csv --out log.yaml writes a map" in err
