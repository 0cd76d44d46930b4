from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from pydantic import ValidationError
from scipy.optimize import brentq

from testbed.models.mhd_channel.ring import ChannelRing
from testbed.models.mhd_channel.thermal_drift import REFERENCE
from testbed.sensors import load_preset
from testbed.sensors.analogue import OnePole
from testbed.sensors.mhd_ars import MhdArs
from testbed.sensors.noise_terms import NoiseStage
from testbed.signals import transfer

FS = 20000.0
BORDER = {"border": True}
# Every optional parameter with a value that an engineer would set, as a scenario writes it.
OPTIONS: dict[str, Any] = {
    "temperature": "45 degC",
    "ring": {"width": "0.1 mm", "radius": "0.1 mm"},
    "gain": 1.1,
    "scale_factor_error": 0.01,
    "nonlinearity": "1 %",
    "transformer": {"magnetizing_inductance": "10 uH", "source_resistance": "20 uohm"},
    "amplifier_pole": "2 kHz",
    "second_pole": "1 kHz",
    "saturation": {"limit": "1 V", "recovery_time": "2 ms"},
    "anti_alias": {"corner": "4 kHz", "order": 4},
    "delay": "120 us",
    "scale_factor": "20 mV/(deg/s)",
    "adc_range": "5 V",
    "adc_bits": 12,
    "noise_density": "1 urad/s/sqrt(Hz)",
    "noise_knee": "5 Hz",
    "lowest_frequency": "1 Hz",
    "sample_rate": "5 kHz",
    "noise": "off",
}
NESTED = {
    "channel.fluid": "galinstan",
    "channel.height": "10 mm",
    "channel.field": "0.3 T",
    "channel.nodes": 64,
    "channel.closure": "radial_field",
}


def with_option(sensor: MhdArs, **options: Any) -> MhdArs:
    """Return `sensor` as a scenario would change it."""
    written = sensor.model_dump(mode="json", context=BORDER, exclude_none=True)
    return MhdArs.model_validate({**written, **options}, context=BORDER)


def wide_sine(n: int = 20000) -> Any:
    """Return 0.1 rad/s at 50 Hz and a little at 900 Hz: 2 V at the amplifier."""
    t = np.arange(n) / FS
    return 0.1 * np.sin(2 * np.pi * 50.0 * t) + 0.01 * np.sin(2 * np.pi * 900.0 * t)


def sx300() -> MhdArs:
    sensor = load_preset("sx300")
    assert isinstance(sensor, MhdArs)
    return sensor


@pytest.mark.oracle
def test_sx300_meets_equation_39_from_physics() -> None:
    freq = np.geomspace(0.1, 1000.0, 400)
    # Su et al. 2024, equation (39): identified from a sweep, independent of the channel's model. The target is 1 % and
    # 1 deg; the fit of field, gain and pole is known to leave 0.22 % and 0.12 deg.
    ratio = sx300().response(freq) / transfer([2200.0, 0.0], [0.255, 2178.0, 33900.0], freq)
    assert np.abs(np.abs(ratio) - 1.0).max() < 0.0025
    assert np.rad2deg(np.abs(np.angle(ratio))).max() < 0.13


@pytest.mark.oracle
@pytest.mark.parametrize("pole", [100.0, 1352.0, 3000.0])
@pytest.mark.parametrize("freq", [10.0, 300.0, 1000.0])
def test_amplifier_in_time_meets_its_pole(pole: float, freq: float) -> None:
    fs, n = 20000.0, 20000
    t = np.arange(n) / fs
    y = OnePole(pole, fs).process(np.sin(2 * np.pi * freq * t))
    got = 2j * np.mean((y * np.exp(-2j * np.pi * freq * t))[n // 2 :])
    # A backward cubic misses 19/720 (2 pi f T)^4 = 2.6e-4 at 1 kHz; the promise is 1e-3.
    bound = 1.5 * 19.0 / 720.0 * (2 * np.pi * freq / fs) ** 4 + 1e-9
    assert abs(got * (1 + 1j * freq / pole) - 1.0) < bound
    assert bound < 1e-3


def test_amplifier_blocks_give_the_same_bits() -> None:
    u = np.random.default_rng(1).standard_normal(1000)
    whole = OnePole(1352.0, 20000.0).process(u)
    stage = OnePole(1352.0, 20000.0)
    assert np.array_equal(np.concatenate([stage.process(b) for b in np.split(u, [0, 1, 2, 500])]), whole)


def test_readings_are_whole_counts_of_the_paper() -> None:
    sensor = sx300()
    # Table I: 0.076 mV over 10 V at 30 deg/s, 2.3e-4 deg/s.
    assert np.rad2deg(sensor.resolution) == pytest.approx(2.0 * 30.0 / 2**18, rel=1e-12)
    assert np.rad2deg(sensor.full_scale()) == pytest.approx(30.0, rel=1e-12)
    readings = sensor.sample(0.1 * np.sin(np.arange(20000) / 50.0), 20000.0)
    counts = readings / sensor.resolution
    # Counts up to 2^17 times a rounded step: 2^17 eps.
    assert np.abs(counts - np.rint(counts)).max() < 1e-10
    assert np.unique(counts).size > 1000


def test_resting_sensor_shows_its_noise_density() -> None:
    sensor = sx300()
    readings = sensor.sample(np.zeros(400_000), 20000.0, seed=2)
    # White n sqrt(fs) and rounding; the 1/f part below a knee of 0.1 Hz adds under 0.01 % to 20 kHz of band.
    std = np.sqrt(sensor.noise_density**2 * 20000.0 + sensor.resolution**2 / 12.0)
    assert np.std(readings) == pytest.approx(std, rel=5.0 / np.sqrt(2 * readings.size))


def test_stage_shows_the_velocity_profile() -> None:
    sensor = sx300()
    stage = sensor.start(20000.0, 0, "mhd_ars")
    stage.process(0.1 * np.sin(np.arange(2000) / 20.0))
    assert stage.profile().shape == stage.heights.shape == (sensor.channel.nodes + 1,)
    # No slip at the walls; beside them the fluid does slip.
    assert np.abs(stage.profile()[[0, -1]]).max() < 1e-9
    assert np.abs(stage.profile()).max() > 1e-3


def test_secondary_flow_takes_the_rate_as_it_is_and_the_linear_one_its_changes() -> None:
    """A sensor that has turned for long starts in equilibrium; how fast matters to the secondary flow alone."""
    swing = np.sin(2 * np.pi * np.arange(40_000) / 40_000.0)
    for flow, alike in (("linear", True), ("similarity", False)):
        channel = sx300().channel.model_copy(update={"field": 0.036, "nodes": 32, "flow": flow})
        sensor = sx300().model_copy(update={"channel": channel, "noise": False})
        still, turning = (sensor.sample(offset + swing, 20e3) for offset in (0.0, 2.0))
        assert (np.abs(turning - still).max() < 1e-9) == alike


@pytest.mark.oracle
def test_nonlinearity_is_a_cubic_over_full_scale() -> None:
    """A sin gives A (1 + 3/4 n A^2) at its line and n A^3/4 at three times it, in parts of full scale."""
    sensor = sx300().model_copy(update={"noise": False, "nonlinearity": 0.02})
    n, size = 0.02, 0.5 * sensor.full_scale()
    t = np.arange(20_000) / 20e3
    lines = []
    for one in (sensor, sensor.model_copy(update={"nonlinearity": 0.0})):
        readings = one.sample(size * np.sin(2 * np.pi * 50.0 * t), 20e3)[10_000:] / one.full_scale()
        lines.append([abs(2.0 * np.mean(readings * np.exp(-2j * np.pi * f * t[10_000:]))) for f in (50.0, 150.0)])
    bent, plain = lines
    # The amplifier's pole, behind it, takes 0.6 % off the third line.
    assert bent[0] / plain[0] - 1.0 == pytest.approx(0.75 * n * plain[0] ** 2, rel=0.02)
    assert bent[1] == pytest.approx(0.25 * n * plain[0] ** 3, rel=0.02)


def test_input_noise_is_the_output_noise_over_the_response() -> None:
    sensor = sx300()
    freq = np.array([0.01, 1.0, 100.0])
    rounding = sensor.resolution**2 / 12.0 / 20000.0
    wanted = (1e-14 * (1 + 0.1 / freq) + rounding) / np.abs(sensor.response(freq)) ** 2
    np.testing.assert_allclose(sensor.input_noise_psd(freq), wanted, rtol=1e-12)


# Every parameter


def test_every_parameter_is_among_the_options() -> None:
    assert set(MhdArs.model_fields) == {*OPTIONS, "channel", "mounting", "faults", "clock", "lost"}


@pytest.mark.parametrize("key", OPTIONS)
def test_every_option_changes_the_readings_and_survives_the_round_trip(key: str) -> None:
    plain = sx300()
    changed = with_option(plain, **{key: OPTIONS[key]})
    assert changed != plain
    assert with_option(changed) == changed
    assert not np.array_equal(changed.sample(wide_sine(), FS, seed=1), plain.sample(wide_sine(), FS, seed=1))


@pytest.mark.parametrize("key", NESTED)
def test_every_parameter_of_the_channel_changes_the_readings(key: str) -> None:
    plain = sx300()
    channel = plain.model_dump(mode="json", context=BORDER)["channel"]
    changed = with_option(plain, channel={**channel, key.removeprefix("channel."): NESTED[key]})
    assert not np.array_equal(changed.sample(wide_sine(), FS, seed=1), plain.sample(wide_sine(), FS, seed=1))


@pytest.mark.parametrize("key", ["density_drift", "viscosity_drift", "conductivity_drift", "field_drift"])
def test_every_drift_acts_away_from_20_degrees_only(key: str) -> None:
    warm = sx300().model_copy(update={"temperature": REFERENCE + 30.0})
    channel = warm.channel
    if key == "field_drift":
        other = channel.model_copy(update={key: -1e-3})
    else:
        other = channel.model_copy(update={"fluid": channel.fluid.model_copy(update={key: 1e-3})})
    changed = warm.model_copy(update={"channel": other})
    freq = np.array([1.0, 3.0])
    assert np.all(changed.response(freq) != warm.response(freq))
    cold = changed.model_copy(update={"temperature": REFERENCE})
    assert np.array_equal(cold.sample(wide_sine(), FS), sx300().sample(wide_sine(), FS))


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"temperature": "-300 degC"}, "temperature"),
        ({"scale_factor_error": -1.5}, "scale_factor_error"),
        ({"scale_factor_error": float("nan")}, "scale_factor_error"),
        ({"transformer": {"magnetizing_inductance": "0 H", "source_resistance": "1 ohm"}}, "magnetizing_inductance"),
        ({"transformer": {"magnetizing_inductance": "1 H"}}, "source_resistance"),
        ({"saturation": {"recovery_time": "1 ms"}}, "limit"),
        ({"saturation": {"limit": "1 V", "recovery_time": "-1 ms"}}, "recovery_time"),
        ({"anti_alias": {"corner": "4 kHz", "order": 9}}, "order"),
        ({"anti_alias": {"corner": "4 krad/s"}}, "wrong dimension"),
        ({"delay": "-1 us"}, "delay"),
        ({"ring": {"width": "6 mm"}}, "radius"),
    ],
)
def test_bad_options_are_named(options: dict[str, Any], message: str) -> None:
    with pytest.raises(ValidationError, match=message):
        with_option(sx300(), **options)


# The chain


LINEAR = {key: OPTIONS[key] for key in ("temperature", "transformer", "second_pole", "anti_alias", "delay", "ring")}


def equipped(**options: Any) -> MhdArs:
    """Return `sx300` with all optional linear blocks."""
    return with_option(sx300(), **{**LINEAR, "scale_factor_error": 0.01, **options})


@pytest.mark.oracle
@pytest.mark.parametrize("freq", [1.0, 20.0, 300.0, 1000.0])
def test_equipped_sensor_without_noise_equals_its_response(freq: float) -> None:
    sensor = equipped(noise="off")
    seconds, wait = 4.0, 8.0
    t = np.arange(int((seconds + wait) * FS)) / FS
    readings = sensor.sample(0.1 * np.sin(2 * np.pi * freq * t), FS)
    got = 20j * np.mean((readings * np.exp(-2j * np.pi * freq * t))[t >= wait])
    # Fourth-order terms of two low-passes and the delay, (19/720 + 19/720 + 1/24) (2 pi f T)^4 and half as much again;
    # the transformer's start, 2 1/s, is down to e^-16.
    bound = 1.5 * 0.095 * (2 * np.pi * freq / FS) ** 4 + 2e-6
    assert got == pytest.approx(sensor.response(np.array([freq]))[0], abs=bound)


@pytest.mark.oracle
def test_response_is_the_product_of_its_blocks() -> None:
    sensor, freq = equipped(), np.geomspace(0.01, 5000.0, 60)
    s = 2j * np.pi * freq
    warm = sensor.channel.at(318.15)
    butterworth = np.polymul([1.0, 2 * np.cos(np.pi / 8), 1.0], [1.0, 2 * np.cos(3 * np.pi / 8), 1.0])
    expected = (
        1.01
        * 1.0143
        * warm.response(freq)
        / (1 + 1j * freq / 1352.0)
        * s
        / (s + 2.0)
        / (1 + 1j * freq / 1000.0)
        / np.polyval(butterworth, 1j * freq / 4000.0)
        * np.exp(-s * 120e-6)
    )
    np.testing.assert_allclose(sensor.response(freq), expected, rtol=1e-12)


def test_a_weaker_magnet_shows_in_the_readings() -> None:
    plain = sx300()
    magnet = plain.channel.model_copy(update={"field_drift": -1.1e-3})
    warm = plain.model_copy(update={"channel": magnet, "temperature": REFERENCE + 20.0})
    # Far above the corner the braking does not matter (a/w = 0.5 % at 500 Hz, 4 % less of it), so the EMF alone is
    # left.
    ratio = warm.response(np.array([500.0])) / plain.response(np.array([500.0]))
    assert abs(ratio[0]) == pytest.approx(np.exp(-0.022), rel=5e-4)


@pytest.mark.parametrize("sizes", [[1, 9, 4990, 15000], [777] * 25 + [575]], ids=["uneven", "odd"])
def test_equipped_sensor_gives_the_same_bits_for_any_blocks(sizes: list[int]) -> None:
    sensor = equipped(saturation=OPTIONS["saturation"], sample_rate="5 kHz")
    stage = sensor.start(FS, 3, "sensor")
    parts = [stage.process(block) for block in np.split(wide_sine(), np.cumsum(sizes)[:-1])]
    assert np.array_equal(np.concatenate(parts), sensor.start(FS, 3, "sensor").process(wide_sine()))


def test_rails_hold_and_their_recovery_outlasts_the_overload() -> None:
    quiet = {"noise": "off"}
    t = np.arange(20000) / FS
    burst = np.where((t > 0.1) & (t < 0.2), 0.4 * np.sin(2 * np.pi * 100.0 * t), 0.0)
    free = with_option(sx300(), **quiet).sample(burst, FS)
    at_once = with_option(sx300(), **quiet, saturation={"limit": "1 V"}).sample(burst, FS)
    late = with_option(sx300(), **quiet, saturation={"limit": "1 V", "recovery_time": "20 ms"}).sample(burst, FS)
    limit = 1.0 / sx300().scale_factor
    assert with_option(sx300(), saturation={"limit": "1 V"}).full_scale() == pytest.approx(limit, rel=1e-12)
    np.testing.assert_array_equal(at_once, np.clip(free, -limit, limit))
    # Two poles apart from the rails' charge: after 5 of its time constants 0.7 % of at most 6.6 limits are left.
    assert np.max(np.abs(late)) == pytest.approx(limit, rel=1e-12)
    assert np.max(np.abs(late - at_once)[(t > 0.201) & (t < 0.203)]) > 0.01 * limit
    assert np.max(np.abs(late - at_once)[t > 0.2 + 10 * 20e-3]) < 6.6 * np.exp(-10.0) * limit


# Johnson noise


@pytest.mark.oracle
def test_johnson_noise_of_the_channel_is_nyquists_over_the_emf() -> None:
    sensor = load_preset("mhd03")
    assert isinstance(sensor, MhdArs)
    # 4 kT R one-sided over B W r, by hand: R = 6 mm / (1.04e6 S/m 2 pi 15 mm 4 mm) = 15.3 uohm, 45 uV/(rad/s).
    resistance = 6e-3 / (1.04e6 * 2 * np.pi * 15e-3 * 4e-3)
    one_sided = np.sqrt(4 * 1.380649e-23 * 293.15 * resistance) / (0.5 * 6e-3 * 15e-3)
    assert sensor.johnson_noise == pytest.approx(one_sided / np.sqrt(2.0), rel=1e-12)
    warm = sensor.model_copy(update={"temperature": REFERENCE + 40.0})
    # kT up by 333/293, the resistance with the drift of the conductivity.
    assert warm.johnson_noise / sensor.johnson_noise == pytest.approx(
        np.sqrt(333.15 / 293.15 * np.exp(40 * 8.9e-4)), rel=1e-12
    )


@pytest.mark.oracle
def test_noise_at_rest_is_the_stated_density() -> None:
    """Johnson noise alone, through gain and amplifier, by a periodogram; and as referred to the input."""
    sensor = with_option(sx300(), ring=OPTIONS["ring"], noise_density="0 rad/s/sqrt(Hz)", adc_bits=32)
    n, average = 2**14, 64
    readings = sensor.sample(np.zeros(n * average), FS, seed=4).reshape(average, n)
    freq = np.fft.rfftfreq(n, 1 / FS)
    density = np.mean(np.abs(np.fft.rfft(readings)) ** 2, axis=0) / n / FS
    band = (freq > 20.0) & (freq < 1000.0)
    expected = sensor.input_noise_psd(freq[band]) * np.abs(sensor.response(freq[band])) ** 2
    # A mean over 64 records and 800 lines: 5 standard deviations; the amplifier's hold errs by 3e-4.
    assert np.mean(density[band] / expected) == pytest.approx(1.0, abs=5 / np.sqrt(average * band.sum()) + 1e-3)


@pytest.mark.oracle
def test_johnson_noise_is_referred_to_the_input_by_the_channel_alone() -> None:
    plain, freq = equipped(), np.array([0.05, 0.5, 50.0])
    bare = plain.model_copy(update={"ring": None})
    added = plain.input_noise_psd(freq) - bare.input_noise_psd(freq)
    # Difference of two sums, of which the Johnson part is a thousandth at least: 1e-13.
    np.testing.assert_allclose(
        added, (plain.johnson_noise / np.abs(plain.channel.at(318.15).response(freq))) ** 2, rtol=1e-9
    )


def test_johnson_and_electronic_noise_are_independent() -> None:
    resting = np.zeros(100_000)
    johnson = with_option(sx300(), ring=OPTIONS["ring"], noise_density="0 rad/s/sqrt(Hz)").sample(resting, FS, seed=4)
    electronic = sx300().sample(resting, FS, seed=4)
    # First differences are nearly white: n pairs correlate by 1/sqrt(n), low-passed ones by up to three times that.
    assert abs(np.corrcoef(np.diff(johnson), np.diff(electronic))[0, 1]) < 15 / np.sqrt(resting.size)


def test_johnson_noise_is_off_with_the_noise_and_without_a_ring_and_has_a_stream_of_its_own(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    names: list[tuple[str, ...]] = []
    monkeypatch.setattr(
        "testbed.sensors.mhd_ars.NoiseStage", lambda terms: names.append(tuple(terms)) or NoiseStage(terms)
    )
    ring = ChannelRing(width=6e-3, radius=15e-3)
    for update in ({"ring": ring}, {"ring": ring, "noise": False}, {}):
        sx300().model_copy(update=update).start(FS, 1, "a")
    assert names == [("johnson",), ("white", "flicker"), (), (), (), ("white", "flicker")]


# Presets


@pytest.mark.oracle
@pytest.mark.parametrize("freq", [0.1, 0.5, 2.5, 10.0, 100.0, 1000.0])
def test_sx300_meets_equation_39_in_time(freq: float) -> None:
    """The readings of a simulated sweep, as in the paper's experiment at 1 deg/s, against its fitted equation."""
    quiet = sx300().model_copy(update={"noise": False})
    wait, seconds = 2.0, max(1.0 / freq, 1.0)
    t = np.arange(round((wait + seconds) * FS)) / FS
    readings = quiet.sample(np.deg2rad(1.0) * np.sin(2 * np.pi * freq * t), FS)
    got = 2j * np.mean((readings * np.exp(-2j * np.pi * freq * t))[t >= wait]) / np.deg2rad(1.0)
    # The closed form's 0.22 % and 0.12 deg; the start is down by e^-31, the holds add 0.03 % at 1 kHz.
    ratio = got / transfer([2200.0, 0.0], [0.255, 2178.0, 33900.0], np.array([freq]))[0]
    assert abs(abs(ratio) - 1.0) < 0.003
    assert abs(np.angle(ratio, deg=True)) < 0.15


@pytest.mark.oracle
@pytest.mark.parametrize("height", [4e-3, 8e-3])
def test_equation_39_does_not_hang_on_the_assumed_height(height: float) -> None:
    """Refitted field, pole and gain: 0.83 % and 0.31 deg at 4 mm, 0.42 % and 0.15 deg at 8 mm, within 1 % and 1 deg."""
    field, pole, gain, worst = {4e-3: (0.442, 1339.0, 1.021, 0.0083), 8e-3: (0.446, 1348.0, None, 0.0042)}[height]
    plain, freq = sx300(), np.geomspace(0.1, 1000.0, 400)
    channel = plain.channel.model_copy(update={"height": height, "field": field})
    other = plain.model_copy(update={"channel": channel, "amplifier_pole": pole, "gain": gain or 1.0})
    ratio = other.response(freq) / transfer([2200.0, 0.0], [0.255, 2178.0, 33900.0], freq)
    if gain is None:
        ratio /= 0.5 * (np.abs(ratio).max() + np.abs(ratio).min())
    # The fitted numbers are rounded to three or four digits: 0.1 % and 0.2 deg.
    assert np.abs(np.abs(ratio) - 1.0).max() < worst + 0.001
    assert np.rad2deg(np.abs(np.angle(ratio))).max() < 0.5


def test_mhd03_has_the_band_of_the_paper_as_its_file_says() -> None:
    sensor = load_preset("mhd03")
    assert isinstance(sensor, MhdArs)
    freq = np.geomspace(1.0, 3000.0, 2000)
    gain = np.abs(sensor.response(freq))
    assert gain.max() == pytest.approx(1.0, abs=1e-4)
    above = freq[gain > np.sqrt(0.5)]
    # A grid of 0.4 %. The paper says 3-1000 Hz.
    assert above[0] == pytest.approx(3.19, rel=0.01)
    assert above[-1] == pytest.approx(1000.0, rel=0.01)
    assert np.rad2deg(sensor.full_scale()) == pytest.approx(60.0, rel=1e-12)

    def corner(field: float) -> float:
        channel = sensor.channel.model_copy(update={"field": field})
        other = sensor.model_copy(update={"channel": channel})
        return float(brentq(lambda f: float(np.abs(other.response(f))) - np.sqrt(0.5), 1.0, 20.0))

    assert corner(0.485) == pytest.approx(3.0, abs=0.02)
    # The amplifier does not matter down there: the channel against its closed form, sqrt(0.5) of one, is at 3.25 Hz.
    assert sensor.channel.corner_freq_hz == pytest.approx(3.25, abs=0.005)
