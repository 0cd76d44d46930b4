"""Keys of data sheets: what they become, what is refused, and the noise that they make."""

from __future__ import annotations

import math
from importlib import resources
from typing import Any

import numpy as np
import pytest
from pydantic import ValidationError

from testbed.errors import ScenarioError
from testbed.parts import preset, preset_names
from testbed.scenario.loader import load_scenario
from testbed.sensors import load_preset, with_preset
from testbed.sensors.data_sheet import butterworth
from testbed.sensors.fog import Fog
from testbed.sensors.mems_gyro import MemsGyro
from testbed.sensors.mhd_ars import MhdArs
from testbed.signals import transfer

DEG = math.pi / 180.0
SHEET = {
    "output_rate": "200 Hz",
    "full_scale": "500 dps",
    "rate_noise_density": "5 mdps/√Hz",
    "bandwidth": "98 Hz",
    "in_run_bias_stability": "5 °/h",
}


def read(model: Any = MemsGyro, **keys: Any) -> Any:
    return model.model_validate({**SHEET, **keys}, context={"border": True})


@pytest.mark.oracle
def test_words_become_parameters() -> None:
    gyro = read()
    assert gyro.sample_rate == 200.0
    assert gyro.range == pytest.approx(500.0 * DEG, rel=1e-14)
    # One-sided over sqrt(2): 0.0035355 deg/s/sqrt(Hz) = 0.212132 deg/sqrt(h).
    assert gyro.angle_random_walk == pytest.approx(0.005 * DEG / math.sqrt(2.0), rel=1e-12)
    # The floor of the Allan deviation is sqrt(2 ln 2 / pi) B = 0.664 B.
    assert gyro.bias_instability == pytest.approx(5.0 / 3600.0 * DEG / 0.66428, rel=1e-5)
    assert (gyro.corner, gyro.damping) == (98.0, math.sqrt(0.5))


@pytest.mark.oracle
def test_noise_of_the_readings_is_one_sided_density_times_root_bandwidth() -> None:
    """0.005 deg/s/sqrt(Hz) through two Butterworth poles at 98 Hz: n sqrt(1.1107 f) = 0.0522 deg/s, not 0.0750."""
    gyro = read(in_run_bias_stability="0 deg/h")
    made = 0.005 * math.sqrt(math.pi / (2.0 * math.sqrt(2.0)) * 98.0)
    assert made == pytest.approx(0.0522, abs=5e-5)
    readings = np.rad2deg(gyro.start(200.0, 1, "gyro").process(np.zeros(400_000)))
    # 400 000 values of a process 109 Hz wide at 200 Hz: at least half are independent.
    assert np.std(readings) == pytest.approx(made, rel=5.0 * math.sqrt(0.5 / 200_000))
    assert np.rad2deg(gyro.output_rms()) == pytest.approx(made, rel=2e-3)


@pytest.mark.oracle
@pytest.mark.parametrize("order", range(1, 9))
def test_bandwidth_is_where_half_the_power_is_left(order: int) -> None:
    gyro = read(order=order)
    freq = np.array([1e-3, 98.0, 196.0])
    # Butterworth: |H|^2 = 1 / (1 + (f/fc)^2n).
    np.testing.assert_allclose(np.abs(gyro.response(freq)) ** 2, 1.0 / (1.0 + (freq / 98.0) ** (2 * order)), rtol=1e-9)
    fields = butterworth(98.0, order)
    assert ("corner" in fields) == (order == 2)
    if order != 2:
        got = transfer(list(fields["numerator"]), list(fields["denominator"]), freq)
        np.testing.assert_allclose(got, gyro.response(freq), rtol=1e-12)


def test_python_takes_the_same_words_in_si() -> None:
    gyro = MemsGyro(output_rate=200.0, full_scale=1.0, rate_noise_density=1e-4, bandwidth=98.0)  # type: ignore[call-arg]
    assert gyro.angle_random_walk == pytest.approx(1e-4 / math.sqrt(2.0), rel=1e-15)
    assert MemsGyro.model_validate(gyro) is gyro


def test_a_word_without_sensitivity_spans_the_range() -> None:
    gyro = read(word_bits=16)
    assert gyro.full_scale() == pytest.approx(gyro.range, rel=1e-12)
    assert gyro.range * gyro.sensitivity == pytest.approx(32767.0, rel=1e-12)
    assert read(sensitivity="131 LSB/dps").sensitivity == pytest.approx(131.0 / DEG, rel=1e-12)


def test_the_other_instruments_have_words_too() -> None:
    keys = {key: value for key, value in SHEET.items() if key != "bandwidth"}
    fog = Fog.model_validate({**keys, "bandwidth": "400 Hz"}, context={"border": True})
    assert (fog.bandwidth, fog.angle_random_walk) == (400.0, read().angle_random_walk)
    base = {key: value for key, value in with_preset("sx300", {}).items() if key not in {"type", "belief"}}
    base |= {"rate_noise_density": "100 nrad/s/sqrt(Hz)"}
    with pytest.raises(ValidationError, match="says the same as 'noise_density'"):
        MhdArs.model_validate(base, context={"border": True})
    del base["noise_density"]
    # The MHD ARS's own key is two-sided.
    assert MhdArs.model_validate(base, context={"border": True}).noise_density == pytest.approx(
        1e-7 / math.sqrt(2.0), rel=1e-12
    )


@pytest.mark.parametrize(
    ("keys", "place", "message"),
    [
        # An angle random walk is two-sided: taken for a one-sided density it would lose sqrt(2).
        ({"rate_noise_density": "0.3 deg/sqrt(h)"}, "rate_noise_density", "wrong dimension"),
        ({"rate_noise_density": "5 mdps"}, "rate_noise_density", "wrong dimension"),
        ({"rate_noise_density": "-5 mdps/sqrt(Hz)"}, "rate_noise_density", "at least 0"),
        ({"rate_noise_density": 0.005}, "rate_noise_density", "the unit is missing"),
        ({"output_rate": "200 dps"}, "output_rate", "wrong dimension"),
        ({"full_scale": "0 dps"}, "full_scale", "more than 0"),
        ({"order": 9}, "order", "from 1 to 8"),
        ({"order": "2"}, "order", "from 1 to 8"),
        ({"sample_rate": "200 Hz"}, "output_rate", "says the same as 'sample_rate'"),
        ({"angle_random_walk": "0.2 deg/sqrt(h)"}, "rate_noise_density", "says the same as 'angle_random_walk'"),
        ({"corner": "98 Hz"}, "bandwidth", "says the same as 'corner'"),
    ],
)
def test_words_are_refused_at_their_place(keys: dict[str, Any], place: str, message: str) -> None:
    with pytest.raises(ValidationError, match=message) as caught:
        read(**keys)
    # Nothing is told that only follows, such as a parameter that is missing because its word was refused.
    assert {error["loc"] for error in caught.value.errors()} == {(place,)}


def test_everything_wrong_is_told_at_once() -> None:
    with pytest.raises(ValidationError) as caught:
        read(output_rate="200 dps", order=0, dampin=3, word_bits=99)
    places = {error["loc"] for error in caught.value.errors()}
    assert places == {("output_rate",), ("order",), ("dampin",), ("word_bits",)}


def test_order_needs_its_bandwidth() -> None:
    keys = {key: value for key, value in SHEET.items() if key != "bandwidth"}
    with pytest.raises(ValidationError, match="expected beside bandwidth"):
        MemsGyro.model_validate({**keys, "order": 2}, context={"border": True})


@pytest.mark.parametrize(
    ("stated", "doubt"),
    [
        ("0.0522 dps", None),
        ("0.05 dps", None),
        ("0.0738 dps", "may be two-sided"),
        ("0.0369 dps", "may be sqrt(2) too large"),
        ("0.2 dps", "see bandwidth and order"),
    ],
)
def test_a_total_noise_that_does_not_fit_is_doubted(stated: str, doubt: str | None) -> None:
    doubts = read(total_rms_noise=stated).doubts()
    assert len(doubts) == (doubt is not None)
    assert doubt is None or doubt in doubts[0]


def test_what_the_user_says_in_other_words_replaces_the_preset() -> None:
    merged = with_preset("adis16505", {"rate_noise_density": "5 mdps/√Hz", "bandwidth": "98 Hz"})
    assert not {"angle_random_walk", "corner", "damping"} & set(merged)
    assert "angle_random_walk" in with_preset("mpu6050", {"angle_random_walk": "0.3 deg/sqrt(h)"})
    assert "rate_noise_density" not in with_preset("mpu6050", {"angle_random_walk": "0.3 deg/sqrt(h)"})
    # A word that goes with one of the preset stays beside it.
    assert with_preset("mpu6050", {"order": 4})["bandwidth"] == "98 Hz"


SCENARIO = """\
name: sheet
duration: 1 s
turntable: {{mode: fixed}}
motion:
  - sine: {{frequency: 2 Hz, rate: 1 deg/s}}
sensors:
  mems_gyro:
{keys}
fusion:
  kalman: {{belief: exact}}
"""


def test_a_scenario_takes_them_and_survives_its_resolved_form(tmp_path: Any) -> None:
    path = tmp_path / "sheet.yaml"
    path.write_text(SCENARIO.format(keys="\n".join(f"    {key}: {value}" for key, value in SHEET.items())))
    scenario = load_scenario(path)
    assert scenario.sensors["mems_gyro"] == read()
    again = MemsGyro.model_validate(
        {key: value for key, value in scenario.resolved()["sensors"]["mems_gyro"].items() if key != "type"},
        context={"border": True},
    )
    assert again == read()


def test_a_scenario_names_the_line_and_the_nearest_word(tmp_path: Any) -> None:
    path = tmp_path / "sheet.yaml"
    keys = {**SHEET, "output_rate": "fast", "rate_noise_densty": "1 dps/√Hz"}
    path.write_text(SCENARIO.format(keys="\n".join(f"    {key}: {value}" for key, value in keys.items())))
    with pytest.raises(ScenarioError) as caught:
        load_scenario(path)
    text = str(caught.value)
    assert ":8:" in text or "line 8" in text
    assert "sensors.mems_gyro.output_rate" in text
    assert "did you mean 'rate_noise_density'" in text


def test_the_translation_is_told_step_by_step() -> None:
    steps = MemsGyro.sheet({**SHEET, "order": 3}, border=True).steps
    told = {step.key: (step.written, step.rule, step.becomes) for step in steps}
    assert told["rate_noise_density"] == (
        "5 mdps/√Hz",
        "one-sided: over sqrt(2)",
        "angle_random_walk: 0.212132 deg/sqrt(h)",
    )
    assert told["in_run_bias_stability"][1:] == (
        "floor of the Allan deviation: over 0.664",
        "bias_instability: 7.52692 deg/h",
    )
    assert "order 3" in told["bandwidth"][1]
    assert MemsGyro.sheet({"sample_rate": "2 kHz"}, border=True).steps == []


REAL = [
    name for name in preset_names("testbed.sensors") if preset("testbed.sensors", name).get("belief") == "data_sheet"
]


def test_there_are_twelve_parts_in_the_words_of_their_sheets() -> None:
    assert len(REAL) >= 12
    folder = resources.files("testbed.sensors") / "presets"
    heads = [(folder / f"{name}.yaml").read_text(encoding="utf-8").splitlines()[0] for name in REAL]
    for kind in ("consumer", "industrial", "tactical", "Fibre-optic", "Ring-laser"):
        assert any(kind in head for head in heads)


@pytest.mark.parametrize("name", REAL)
def test_a_part_has_no_contradiction_and_a_belief_of_its_own_sheet(name: str) -> None:
    from testbed.scenario.beliefs import preset_belief

    sensor, belief = load_preset(name), preset_belief(name)
    assert sensor.doubts() == []
    assert belief is not None
    freq = np.geomspace(0.01, 0.2 * sensor.sample_rate, 30)
    got, made = belief.realisation().response(freq), sensor.response(freq)
    # Exact for a low-pass of poles. Of the mean over an interval x^4 / 720 is left, and the half sample of 50 us by
    # which the mean of samples is younger than that of a continuous rate; a scale factor's error is not believed.
    turn = 2.0 * np.pi * freq
    mean = (turn / sensor.sample_rate) ** 4 / 720.0 + turn * 25e-6 if isinstance(sensor, Fog) else 1e-9
    left = mean + abs(sensor.scale_factor_error)  # type: ignore[attr-defined]
    assert np.all(np.abs(got / made - 1.0) < 1.1 * left)
    slow = ("bias_instability", "rate_random_walk", "lowest_frequency")
    assert [getattr(belief, key) for key in slow] == [getattr(sensor, key) for key in slow]
    assert belief.range == sensor.full_scale()
    # Its white noise is the sheet's: 1/f of 10 deg/h beside 3.8 mdps/sqrt(Hz) is 3.9 % of it at 10 Hz and less above.
    power = np.abs(belief.realisation().response(freq)) ** 2
    claimed = belief.input_noise**2 * power + belief.output_noise**2
    made = sensor.input_noise_psd(freq) * np.abs(sensor.response(freq)) ** 2
    above = freq > 10.0
    assert np.abs(claimed / made - 1.0)[above].max() < 0.04


def test_the_schema_knows_the_words() -> None:
    from testbed.scenario.schema import schema

    entries = schema()["properties"]["sensors"]["additionalProperties"]["anyOf"]
    properties = {entry["properties"]["type"]["const"]: entry["properties"] for entry in entries}
    assert {*SHEET, "order", "total_rms_noise", "sensitivity"} <= set(properties["mems_gyro"])
    assert {"output_rate", "full_scale", "rate_noise_density"} <= set(properties["fog"])
    assert "one-sided" in properties["mems_gyro"]["rate_noise_density"]["description"]


def test_list_parts_shows_their_figures(capsys: Any) -> None:
    from testbed.cli.part_figures import part_figures, print_part_figures

    figures = part_figures()
    assert set(REAL) <= set(figures)
    mpu = figures["mpu6050"]
    assert (mpu["noise_density_mdps_sqrt_hz"], mpu["angle_random_walk_deg_sqrt_h"]) == (5.0, 0.212)
    assert mpu["bandwidth_hz"] == pytest.approx(98.0, rel=5e-3)
    assert (mpu["bias_floor_deg_h"], mpu["output_rate_hz"], mpu["belief"]) == (10.0, 1000.0, "data_sheet")
    print_part_figures(figures)
    printed = capsys.readouterr().out
    assert all(name in printed for name in figures)


def test_the_rms_sees_a_planted_two_sided_density(monkeypatch: pytest.MonkeyPatch) -> None:
    from dataclasses import replace

    from testbed.sensors import data_sheet

    words = tuple(replace(word, factor=1.0) for word in data_sheet.GYRO_WORDS)
    monkeypatch.setattr(MemsGyro, "words", words)
    with pytest.raises(AssertionError):
        test_noise_of_the_readings_is_one_sided_density_times_root_bandwidth()


def test_the_belief_of_an_optical_gyro_knows_its_delay() -> None:
    """Half an output interval of 5 ms is 0.31 rad at 20 Hz: a filter that does not know errs by 0.03 of 1 deg/s."""
    import testbed

    scenario = testbed.Scenario.from_dict(
        {
            "name": "optical",
            "seed": 1,
            "duration": "3 s",
            "settle": "1 s",
            "turntable": {"preset": "air_bearing", "mode": "ideal", "engine": "modal"},
            "motion": [{"sine": {"frequency": "20 Hz", "rate": "1 deg/s"}}],
            "sensors": {"mhd_ars": {"preset": "sx300"}, "gyro": {"type": "fog", "preset": "hg9900"}},
            "fusion": {"kalman": {}},
        }
    )
    # The table begins at rest and reaches its speed in 0.5 s; 0.0027 deg/s is the figure of the page over 4 s.
    assert testbed.run(scenario).metrics["fusion"]["kalman"]["rmse_deg_s"] < 0.005
