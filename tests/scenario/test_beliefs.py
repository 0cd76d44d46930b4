"""What filters are told of the sensors: what a data sheet supports, what the simulator is, never another preset's."""

from __future__ import annotations

import json

import numpy as np
import pytest
from ruamel.yaml import YAML

import testbed
from testbed.fusion import estimate
from testbed.fusion.belief import SensorBelief, load_belief
from testbed.parts import preset as preset_of
from testbed.parts import preset_names
from testbed.scenario.beliefs import belief_of, believed, exact_belief
from testbed.scenario.loader import load_scenario
from testbed.sensors import load_preset
from testbed.sensors.base import Sensor
from tests.scenes import SHORT, short

SUPPORTED = {
    "sx300": "eq39",
    "adis16505_filtered": "eq39",
    "adis16505_filtered_noisy": "eq39",
    "adis16505": "adis16505",
    "crs03": "paper2",
    "mhd03": "paper2",
    "fog_paper3": "fog_paper3",
}
PRESETS = preset_names("testbed.sensors")


@pytest.mark.parametrize(("preset", "name"), SUPPORTED.items())
def test_a_preset_names_the_belief_that_its_data_sheet_supports(preset, name):
    kind = preset_of("testbed.sensors", preset)["type"]
    assert belief_of(preset) == load_belief(name)[kind]
    assert belief_of(preset).source == name


def test_the_data_sheet_of_the_unfiltered_gyro_is_its_own():
    """480 Hz and damping 0.707 are what the simulated instrument has; its angle random walk is 0.15 deg/sqrt(h)."""
    freq = np.logspace(-2, 3, 51)
    response = belief_of("adis16505").realisation().response(freq)
    # Eight digits of the coefficients are written down.
    np.testing.assert_allclose(response, load_preset("adis16505").response(freq), rtol=1e-6)
    assert belief_of("adis16505").input_noise == load_preset("adis16505").angle_random_walk


def test_the_belief_of_the_fibre_optic_gyro_is_its_data_sheet():
    """Its file has the low-pass times the mean over the interval, and the noise, that the instrument's sheet gives."""
    fog, belief, freq = load_preset("fog_paper3"), belief_of("fog_paper3"), np.logspace(-2, 2.3, 51)
    sheet = SensorBelief(**fog.sheet_belief())
    # Sixteen digits of the coefficients are written down.
    np.testing.assert_allclose(belief.response(freq), sheet.response(freq), rtol=1e-12)
    for name in ("output_noise", "bias_instability", "lowest_frequency", "range"):
        assert getattr(belief, name) == pytest.approx(getattr(sheet, name), rel=1e-12, abs=0.0)
    # The mean is that of 50 samples, 25 us later than believed, and its square (s T)^4 / 720 apart: 0.1 % at 40 Hz.
    np.testing.assert_allclose(belief.response(freq[freq < 40.0]), fog.response(freq[freq < 40.0]), rtol=8e-3)


def test_no_data_sheet_no_belief(monkeypatch):
    content = {key: value for key, value in preset_of("testbed.sensors", "fog_paper3").items() if key != "belief"}
    monkeypatch.setattr("testbed.scenario.beliefs.preset", lambda *_: content)
    with pytest.raises(ValueError, match=r"fog_paper3: .* exact=True"):
        belief_of("fog_paper3")


@pytest.mark.parametrize("preset", PRESETS)
def test_the_exact_belief_is_the_simulators_own_response_and_noise(preset):
    sensor, belief = load_preset(preset), belief_of(preset, exact=True)
    assert belief.source == "exact"
    # Between the points of the fit, up to half the sample rate; twice the misfit that the fit allows at its points.
    freq = np.logspace(-2, np.log10(sensor.sample_rate / 2), 333)
    response = belief.realisation().response(freq)
    np.testing.assert_allclose(response, sensor.response(freq), rtol=2e-3)
    # White from 1 Hz up: at 10 Hz 1/f with its knee at 0.1 Hz adds a hundredth, rounding less.
    band = (freq > 10.0) & (freq < 100.0)
    density = belief.input_noise**2 + belief.output_noise**2 / np.abs(response[band]) ** 2
    np.testing.assert_allclose(density, sensor.input_noise_psd(freq[band]), rtol=0.1)


@pytest.mark.slow
def test_a_delay_of_two_samples_is_believed_by_eight_poles():
    """0.1 ms is a whole turn of phase at half of 20 kHz."""
    late = load_preset("sx300").model_copy(update={"delay": 1e-4})
    freq = np.logspace(-2, 4, 77)
    np.testing.assert_allclose(exact_belief(late).realisation().response(freq), late.response(freq), rtol=2e-3)


class Delayed(Sensor):
    """A sensor that is late by tens of its samples: no few poles do that."""

    sample_rate: float = 1000.0

    def response(self, freq_hz):
        return np.exp(-2j * np.pi * np.asarray(freq_hz) * 0.05)

    def full_scale(self):
        return 1.0

    def input_noise_psd(self, freq_hz):
        return np.full(np.shape(freq_hz), 1e-12)

    def start(self, input_rate_hz, seed, name):
        raise NotImplementedError


@pytest.mark.slow
def test_what_no_few_poles_meet_has_no_exact_belief():
    assert believed(Delayed()) is None
    with pytest.raises(ValueError, match="few poles"):
        exact_belief(Delayed())


def test_a_scenario_believes_what_its_presets_say(tmp_path):
    scenario = short(tmp_path, ("mems_gyro: {preset: adis16505_filtered}", "mems_gyro: {preset: adis16505}"))
    for spec in scenario.fusion.values():
        assert spec.belief == {"mhd_ars": belief_of("sx300"), "mems_gyro": belief_of("adis16505")}
    changed = short(tmp_path, ("{preset: sx300}", "{preset: sx300, noise_density: 200 nrad/s/sqrt(Hz)}"))
    assert changed.fusion["kalman"].belief["mhd_ars"] == belief_of("sx300"), "a changed sensor, an unchanged data sheet"


def test_never_another_presets_belief(tmp_path):
    scenario = short(tmp_path, ("mhd_ars: {preset: sx300}", "mhd_ars: {preset: sx300}\n  mhd_b: {preset: mhd03}"))
    assert scenario.fusion["kalman"].belief["mhd_b"] == belief_of("mhd03")


def test_a_sensor_of_which_nothing_is_believed_is_an_error_with_its_remedy(tmp_path):
    plain = {k: v for k, v in _preset_text("sx300").items() if k not in ("type", "belief")}
    entry = f"{{type: mhd_ars, {_flow(plain)}}}"
    edits = [("mhd_ars: {preset: sx300}", f"mhd_ars: {{preset: sx300}}\n  other: {entry}")]
    with pytest.raises(testbed.ScenarioError) as caught:
        short(tmp_path, *edits)
    found = [problem for problem in caught.value.problems if problem.key == "fusion.kalman.belief"]
    assert [problem.line for problem in found] == [14]
    assert "'other'" in found[0].message
    assert "'belief: exact'" in found[0].message
    exact = short(tmp_path, *edits, ("{}", "{belief: exact}"))
    assert exact.fusion["kalman"].belief["other"].source == "exact"


def test_the_exact_belief_is_declared_and_loads_again(tmp_path):
    scenario = short(tmp_path, ("kalman: {}", "kalman: {belief: exact}"))
    assert scenario.fusion["kalman"].belief == {
        "mhd_ars": belief_of("sx300", exact=True),
        "mems_gyro": belief_of("adis16505_filtered", exact=True),
    }
    written = scenario.resolved()["fusion"]
    YAML().dump(scenario.resolved(), tmp_path / "scenario.yaml")
    assert written["kalman"]["belief"] == "exact"
    assert written["arw_shakf"]["belief"]["mhd_ars"]["source"] == "eq39"
    again = load_scenario(tmp_path / "scenario.yaml")
    assert again.fusion["kalman"].belief == scenario.fusion["kalman"].belief
    assert again.fusion["arw_shakf"].belief == scenario.fusion["arw_shakf"].belief


def test_every_output_declares_the_belief(tmp_path, capsys):
    from testbed.cli.terminal import print_metrics

    edits = [("mems_gyro: {preset: adis16505_filtered}", "mems_gyro: {preset: adis16505}")]
    run = testbed.run(short(tmp_path, *edits, ("kalman: {}", "kalman: {belief: exact}")), out=tmp_path / "run")
    own = "mhd_ars: eq39, mems_gyro: adis16505"
    assert run.metrics["fusion"]["kalman"]["belief"] == "exact"
    assert run.metrics["fusion"]["arw_shakf"]["belief"] == own
    report = (tmp_path / "run" / "report.html").read_text(encoding="utf-8")
    assert f"kalman – exact; arw_shakf – {own}." in report
    print_metrics(run.metrics, tmp_path / "run")
    printed = capsys.readouterr().out
    assert "belief of kalman: exact\n" in printed
    assert f"belief of arw_shakf: {own}\n" in printed


def test_a_belief_as_written_bears_no_name_but_its_own(tmp_path):
    """The exact belief of another instrument is not exact, and a changed number makes a shipped belief another."""
    gyro = belief_of("adis16505_filtered")
    for source, numerator, wanted in (
        ("eq39", gyro.numerator, "eq39"),
        ("eq39", (150.0, 15.0), "given"),
        ("exact", gyro.numerator, "given"),
        ("nobody", gyro.numerator, "given"),
    ):
        changed = gyro.model_copy(update={"source": source, "numerator": numerator})
        # JSON is YAML.
        written = json.dumps(changed.model_dump(mode="json", context={"border": True}, exclude_none=True))
        own = f"kalman: {{belief: {{mems_gyro: {written}, mhd_ars: {written}}}}}"
        assert short(tmp_path, ("kalman: {}", own)).fusion["kalman"].belief["mems_gyro"].source == wanted


def test_a_belief_in_a_file_beside_the_scenario_is_used_and_written_out(tmp_path):
    own = "numerator: [1.0], denominator: [1.0e-3, 1.0], delay: 0.2 ms, bias: 1 deg/h, output_noise: 1 urad/s/sqrt(Hz)"
    (tmp_path / "own.yaml").write_text(f"mems_gyro: {{{own}}}\nmhd_ars: {{{own}}}\n")
    scenario = short(tmp_path, ("kalman: {}", "kalman: {belief: own.yaml}"))
    belief = scenario.fusion["kalman"].belief["mems_gyro"]
    assert (belief.delay, belief.source) == (2e-4, "own.yaml")
    written = scenario.resolved()["fusion"]["kalman"]["belief"]
    again = short(tmp_path, ("kalman: {}", f"kalman: {{belief: {json.dumps(written)}}}"))
    assert again.fusion["kalman"].belief == scenario.fusion["kalman"].belief


@pytest.mark.parametrize(
    ("name", "message"),
    [("none.yaml", "none.yaml"), ("../out.yaml", "expected a file in the scenario's folder")],
)
def test_a_belief_file_that_is_not_there_or_elsewhere_is_refused(tmp_path, name, message):
    with pytest.raises(testbed.ScenarioError, match=message):
        short(tmp_path, ("kalman: {}", f"kalman: {{belief: {name}}}"))


def test_a_sensor_entry_has_no_belief_of_its_own(tmp_path):
    with pytest.raises(testbed.ScenarioError, match="belief"):
        short(tmp_path, ("{preset: sx300}", "{preset: sx300, belief: eq39}"))


def test_arrays_have_no_exact_belief():
    """Fusion knows no presets, so it refuses the word and says who knows."""
    with pytest.raises(ValueError, match="belief_of"):
        estimate("kalman", {"mhd_ars": np.zeros(10)}, sample_rate_hz={"mhd_ars": 20000.0}, belief="exact")
    known = {"mhd_ars": belief_of("mhd03", exact=True), "mems_gyro": belief_of("adis16505_filtered", exact=True)}
    # A filter that compiles nothing for the size of a belief.
    rates, readings = {"mhd_ars": 20000.0, "mems_gyro": 2000.0}, {"mhd_ars": np.zeros(10), "mems_gyro": np.zeros(1)}
    found = estimate("complementary", readings, sample_rate_hz=rates, belief=known)
    assert np.isfinite(found.rate).all()


def test_a_filter_that_cannot_take_a_belief_is_refused_by_its_name(tmp_path):
    mhd = "mhd_ars: {numerator: [1, 0], denominator: [1, 60], output_noise: 100 nrad/s/sqrt(Hz)}"
    # A zero on the right: it goes the wrong way first, and its inverse runs away.
    gyro = "mems_gyro: {numerator: [-0.001, 1], denominator: [1e-6, 3e-3, 1], output_noise: 50 urad/s/sqrt(Hz)}"
    belief = f"belief: {{{mhd}, {gyro}}}"
    with pytest.raises(testbed.ScenarioError) as caught:
        short(tmp_path, ("kalman: {}", f"complementary: {{{belief}}}"), ("arw_shakf: {}", f"kalman: {{{belief}}}"))
    assert [problem.key for problem in caught.value.problems] == ["fusion.complementary"]
    assert "inverse is stable" in caught.value.problems[0].message


@pytest.mark.slow
def test_a_gyro_of_another_bandwidth_costs_little_with_its_own_belief(tmp_path):
    """With the belief of the slow gyro these three had 0.0080, 0.0077 and 0.0078 deg/s."""
    mixed = (
        SHORT.replace("0.5 s", "20 s")
        .replace("settle: 0.2 s", "settle: 10 s")
        .replace("ramp_in: 0.1 s", "ramp_in: 0.5 s")
        .replace("{preset: adis16505_filtered}", "{preset: adis16505, mounting: {position: [0 m, 0 m, 60 mm]}}")
        .replace(
            "  - sine: {frequency: 10 Hz, rate: 1 deg/s}",
            "  - sine: {frequency: 0.5 Hz, angle: 5.555 mrad}\n  - sine: {frequency: 10 Hz, angle: 50 urad}",
        )
        .replace("kalman: {}", "kalman: {}\n  shakf: {}")
    )
    (tmp_path / "mixed.yaml").write_text(mixed, encoding="utf-8")
    scenario = load_scenario(tmp_path / "mixed.yaml")
    # Most of the error is the gyro's slow noise over the window, so that one seed tells little: the worst of eight.
    runs = testbed.evaluate(scenario.with_(**{"turntable.engine": "modal"}), range(8))
    errors = {name: max(run.fusion[name].rmse_deg_s for run in runs) for name in runs[0].fusion}
    print(errors)
    assert set(errors) == {"kalman", "shakf", "arw_shakf"}
    assert max(errors.values()) <= 0.0035, errors


def _preset_text(name):
    from testbed.parts import preset

    return preset("testbed.sensors", name)


def _flow(values):
    return ", ".join(
        f"{key}: {'{' + _flow(value) + '}' if isinstance(value, dict) else value}" for key, value in values.items()
    )
