"""What `testbed allan` says beside the coefficients: other people's words, rounding, lines, lost samples."""

from __future__ import annotations

import json
import re

import numpy as np
import pytest

from testbed.errors import ScenarioError
from testbed.judging.allan_analysis import analyse
from testbed.judging.allan_records import RateRecord, read
from testbed.judging.allan_words import data_sheet, remarks_on, write_imu
from testbed.judging.rounding import is_rounding
from testbed.metrics.lines import spectral_lines
from testbed.sensors.noise import GyroNoise
from tests.shell import call

N = np.deg2rad(0.15) / 60.0
FS = 200.0


def noise(n=20_000, seed=1, word=0.0, mean=0.0, **terms):
    rate = GyroNoise(**(terms or {"angle_random_walk": N})).sample(n, FS, seed) + mean
    return RateRecord("noise", np.rint(rate / word) * word if word else rate, FS, "noise", word=word)


@pytest.mark.oracle
def test_data_sheet_words_are_the_conversions_by_hand():
    B, K = np.deg2rad(100.0) / 3600.0, np.deg2rad(3000.0) / 3600.0 / 60.0
    found = analyse(noise(100_000, bias_instability=B))
    sheet, value = data_sheet(found), found.fit.bias_instability.value
    assert sheet["B"]["allan_floor_deg_h"] == pytest.approx(0.664282 * np.degrees(value) * 3600.0, rel=1e-6)
    # B^2 / (2 pi f) two-sided.
    assert sheet["B"]["one_sided_density"] == pytest.approx(np.degrees(value) * 3600.0 * np.sqrt(1.0 / np.pi))
    found = analyse(noise(100_000, angle_random_walk=N, rate_random_walk=K))
    sheet, fit = data_sheet(found), found.fit
    # sqrt(2) N in deg/s/sqrt(Hz), and K^2 / (2 pi f)^2 two-sided.
    assert sheet["N"]["one_sided_density"] == pytest.approx(np.sqrt(2.0) * np.degrees(fit.angle_random_walk.value))
    K_deg_h = np.degrees(fit.rate_random_walk.value) * 3600.0
    assert sheet["K"]["one_sided_density"] == pytest.approx(np.sqrt(2.0) * K_deg_h / (2.0 * np.pi))


def test_json_has_all_of_it(tmp_path):
    path = tmp_path / "log.csv"
    np.savetxt(path, np.degrees(noise().rate), header="w [deg/s]", comments="", fmt="%.8f")
    result = call("allan", path, "--rate", "200", "--json", cwd=tmp_path)
    (one,) = json.loads(result.stdout)["records"]
    assert one["coefficients"]["N"]["lower"] < 0.15 < one["coefficients"]["N"]["upper"]
    assert one["coefficients"]["N"]["density_unit"] == "deg/s/sqrt(Hz)"
    assert (one["n_missing"], one["remarks"]) == (0, [])
    result = call("allan", path, "--rate", "200", "--imu", "imu.yaml", cwd=tmp_path)
    assert "N as a one-sided density: 0.0035" in result.stdout
    # What Kalibr's own parser needs: plain numbers under its names.
    text = (tmp_path / "imu.yaml").read_text()
    values = {name: float(value) for name, value in re.findall(r"^(\w+): (\S+)", text, re.MULTILINE)}
    assert values["gyroscope_noise_density"] == pytest.approx(N, rel=0.03)
    assert values["update_rate"] == 200.0
    assert "upper limit" in text


def test_imu_yaml_takes_the_noisiest_axis_and_needs_coefficients(tmp_path):
    two = [analyse(noise(seed=1)), analyse(noise(seed=2, angle_random_walk=3.0 * N))]
    write_imu(tmp_path / "imu.yaml", two)
    assert f"{two[1].fit.angle_random_walk.value:.6g}" in (tmp_path / "imu.yaml").read_text()
    with pytest.raises(ScenarioError, match="--imu"):
        write_imu(tmp_path / "other.yaml", [analyse(noise(word=np.deg2rad(0.08)))])


@pytest.mark.oracle
@pytest.mark.parametrize("share", [0.45, 0.3, 0.2])
@pytest.mark.parametrize("place", [0.0, 0.5, 0.31])
def test_a_record_that_is_rounding_is_named_and_no_interval_excludes_the_truth(share, place):
    word = N * np.sqrt(FS) / share
    record = noise(word=word, mean=place * word)
    assert is_rounding(record)
    verdict = analyse(record).verdict()
    limit = float(re.search(r"below ([\d.]+) deg/sqrt", verdict)[1])
    assert "is rounding" in verdict
    assert limit > 0.15
    assert analyse(record).summary()["coefficients"] is None


@pytest.mark.oracle
@pytest.mark.parametrize("share", [0.6, 1.0, 3.0])
def test_finer_rounding_is_taken_off_so_that_the_interval_holds_the_truth(share):
    """Of 60 records 95 % hold it; without that rounding of one word at noise of one would add 4 % to N."""
    word, inside = N * np.sqrt(FS) / share, 0
    for seed in range(60):
        found = analyse(noise(4000, seed, word=word, mean=0.2 * word)).fit.angle_random_walk
        inside += found.lower <= N <= found.upper
    # 99.9 % binomial band.
    assert inside >= 50


def test_a_constant_record_is_named():
    with pytest.raises(ScenarioError, match="rounded to words above the noise, or not moving at all"):
        analyse(RateRecord("still", np.zeros(5000), FS, "still"))


@pytest.mark.oracle
def test_a_line_is_named_with_frequency_and_amplitude():
    t = np.arange(20_000) / FS
    found = spectral_lines(noise().rate + 3e-4 * np.sin(2.0 * np.pi * 31.77 * t), FS)
    assert len(found) == 1
    assert found[0].frequency_hz == pytest.approx(31.77, abs=FS / 20_000)
    assert found[0].amplitude == pytest.approx(3e-4, rel=0.2)


@pytest.mark.slow
def test_no_finding_is_printed_for_100_clean_logs(tmp_path):
    """Noise of every kind, lengths, roundings and stamps of a good logger."""
    kinds = [{}, {"angle_random_walk": N, "bias_instability": 3 * N}, {"rate_random_walk": N}, {"quantization": 1e-6}]
    for seed in range(100):
        n = (1000, 4000, 20_000)[seed % 3]
        record = noise(n, seed, **kinds[seed % 4])
        scale = record.rate.std()
        t = np.rint(np.arange(n) * 1e6 / FS).astype(np.int64) * 1000 + 1_700_000_000_000_000_000
        path = tmp_path / "log.csv"
        rows = "".join(f"{a},{b:.6f}\n" for a, b in zip(t.tolist(), (record.rate / scale).tolist(), strict=True))
        path.write_text("t [ns],w [rad/s]\n" + rows)
        (read_back,) = read(path)
        assert read_back.notes == ()
        assert not is_rounding(read_back)
        if n == 20_000 and seed % 4 == 0:
            assert remarks_on(analyse(read_back)) == []
        else:
            assert spectral_lines(read_back.rate, FS) == []
