"""The verdict before the estimate: what is planted is named, what is right is left in peace, what cannot be told is
said.
"""

from __future__ import annotations

import math

import numpy as np
import pytest

from testbed import belief_of
from testbed.errors import VerdictWarning
from testbed.fusion import estimate
from testbed.fusion.analysis.finding import UNITS
from testbed.fusion.analysis.remedy import remedied
from testbed.fusion.analysis.verdict import even_stamps, verdict
from testbed.fusion.belief import load_belief
from tests.records import DEG, PRESETS, RATES, mixed, ramped, record

EQ39 = load_belief("eq39")
DURATION = 12.0


def stamps_of(readings):
    return {name: np.rint(np.arange(z.size) * 1e9 / RATES[name]).astype(np.int64) for name, z in readings.items()}


def four(t):
    return DEG * np.sin(8.0 * np.pi * t)


def still(t):
    return np.zeros_like(t)


@pytest.fixture(scope="module")
def moving():
    """Return a record of lines of 0.5 and 10 Hz with its stamps."""
    _, readings = record(ramped(mixed), DURATION, 7)
    return readings, stamps_of(readings)


def kinds(found):
    return [(one.kind, one.sensor) for one in found.findings]


FAULTS = {
    "sign": (lambda z: -z, lambda t: t, -1.0),
    "unit": (np.degrees, lambda t: t, math.degrees(1.0)),
    "offset": (lambda z: z, lambda t: t + 20_000_000, 0.02),
    "rate": (lambda z: z, lambda t: t + np.rint(1852e-6 * t).astype(np.int64), 1852e-6),
}


@pytest.mark.parametrize("kind", FAULTS)
def test_a_planted_fault_is_named_alone_and_put_right(moving, kind):
    readings, time_ns = moving
    value, stamp, wanted = FAULTS[kind]
    spoilt = readings | {"mems_gyro": value(readings["mems_gyro"])}
    moved = time_ns | {"mems_gyro": stamp(time_ns["mems_gyro"])}
    found = verdict(spoilt, moved, EQ39)
    assert kinds(found) == [(kind, "mems_gyro")]
    one = found.findings[0]
    assert one.lower <= wanted <= one.upper
    again = remedied(spoilt, moved, found)
    assert again.verdict.unfixed == ()
    assert verdict(again.readings, again.time_ns, EQ39).findings == ()


def test_faults_together_are_named_together(moving):
    readings, time_ns = moving
    spoilt = readings | {"mems_gyro": -np.degrees(readings["mems_gyro"])}
    moved = time_ns | {"mems_gyro": time_ns["mems_gyro"] + 20_000_000 + time_ns["mems_gyro"] // 1000}
    found = verdict(spoilt, moved, EQ39)
    assert {kind for kind, _ in kinds(found)} == {"sign", "unit", "offset", "rate"}
    again = remedied(spoilt, moved, found)
    assert verdict(again.readings, again.time_ns, EQ39).findings == ()


def test_a_gain_is_said_of_the_sensor_that_is_blind_to_a_constant(moving):
    readings, time_ns = moving
    found = verdict(readings | {"mhd_ars": 1.05 * readings["mhd_ars"]}, time_ns, EQ39)
    assert kinds(found) == [("gain", "mhd_ars")]
    assert found.findings[0].lower <= 1.05 <= found.findings[0].upper


def test_both_in_degrees_are_told_by_their_noise(moving):
    readings, time_ns = moving
    found = verdict({name: np.degrees(z) for name, z in readings.items()}, time_ns, EQ39)
    assert kinds(found) == [("unit", "mems_gyro"), ("unit", "mhd_ars")]


def test_a_right_record_has_no_finding(moving):
    assert verdict(*moving, EQ39).findings == ()
    assert verdict(*moving, load_belief("identified")).findings == ()


def test_at_rest_nothing_is_decided_and_nothing_found():
    _, readings = record(still, DURATION, 3)
    found = verdict(readings, stamps_of(readings), EQ39)
    assert found.findings == ()
    assert any("no motion shows in both" in text for text in found.undecided)


@pytest.mark.parametrize("factor", [6.2, 10.0, 57.3])
def test_without_common_motion_noise_is_no_unit(factor):
    """Within 8 % of rev/s, rpm and deg/s: a gyro with so much noise is as likely."""
    _, readings = record(still, DURATION, 3)
    loud = readings | {"mems_gyro": factor * readings["mems_gyro"]}
    for said in ({}, dict.fromkeys(loud, UNITS["deg/s"])):
        found = verdict(loud, stamps_of(loud), EQ39, said)
        assert kinds(found) == [("belief", "mems_gyro")]
        assert any("sign, unit, gain, offset and rate: no motion shows in both" in text for text in found.undecided)


@pytest.mark.parametrize("factor", [4.0, 10.0, 50.0])
def test_two_sensors_that_agree_and_are_far_noisier_than_believed_have_no_odd_unit(moving, factor):
    readings, time_ns = moving
    quiet = {
        name: one.model_copy(
            update={"input_noise": one.input_noise / factor, "output_noise": one.output_noise / factor}
        )
        for name, one in EQ39.items()
    }
    assert set(kinds(verdict(readings, time_ns, quiet))) == {("belief", "mems_gyro"), ("belief", "mhd_ars")}


def slow(t):
    return 5.0 * DEG * np.sin(0.4 * np.pi * t)


def inside(t):
    return mixed(t) + 6.0 * DEG


PAIRS = {
    "sx300 and adis16505_filtered": (PRESETS, RATES),
    "mhd03 and crs03": ({"mhd_ars": "mhd03", "mems_gyro": "crs03"}, RATES),
    "sx300 and mpu6050": (PRESETS | {"mems_gyro": "mpu6050"}, RATES | {"mems_gyro": 1000.0}),
}


def short(motion, begin, duration, seed, pair):
    """Return a record that is cut out of a motion, with its stamps and what is true of its sensors."""
    presets, rates = PAIRS[pair]
    _, whole = record(motion, begin + duration, seed, presets=presets)
    readings = {name: z[round(begin * rates[name]) :] for name, z in whole.items()}
    belief = load_belief({name: belief_of(preset, exact=True) for name, preset in presets.items()})
    return readings, even_stamps(readings, rates), belief


@pytest.mark.parametrize("duration", [3.0, 5.0])
@pytest.mark.parametrize("pair", PAIRS)
def test_a_short_record_that_is_cut_out_of_a_motion_has_no_finding(pair, duration):
    for k, motion in enumerate([inside, four, four, slow]):
        # Phases of 4 Hz: a third and two thirds of a turn; of 0.2 Hz nearly the crest.
        readings, time_ns, belief = short(motion, 1.0 + k / 12.0, duration, 11 + k, pair)
        found = verdict(readings, time_ns, belief)
        assert kinds(found) == [], (motion.__name__, k)
        spoilt = readings | {"mems_gyro": -np.degrees(readings["mems_gyro"])}
        if motion is not slow:
            assert {"sign", "unit"} == {kind for kind, _ in kinds(verdict(spoilt, time_ns, belief))}


def test_a_swing_that_does_not_turn_twice_in_the_record_decides_nothing():
    for pair in PAIRS:
        found = verdict(*short(slow, 1.0, 3.0, 8, pair))
        assert found.findings == ()
        assert any("no motion shows in both" in text for text in found.undecided)


@pytest.mark.parametrize("pair", PAIRS)
def test_a_rate_that_only_grows_decides_nothing(pair):
    """The slope of the clean path is noise alone, and the level that it ends at was not there before."""
    found = verdict(*short(lambda t: DEG * t * t, 1.0, 8.0, 4, pair))
    assert found.findings == ()
    assert any("no motion shows in both" in text for text in found.undecided)


@pytest.mark.parametrize("seed", [1, 15, 22])
def test_a_fit_that_leads_nowhere_is_no_motion(seed):
    """Steps that would turn the time round."""
    found = verdict(*short(slow, 1.0, 8.0, seed, "sx300 and mpu6050"))
    assert found.findings == ()


@pytest.mark.parametrize("motion", [mixed, still], ids=["mixed", "still"])
def test_a_wide_gyro_under_the_belief_of_a_filtered_one(motion):
    from testbed.sensors import load_preset

    rate, readings = record(ramped(motion), DURATION, 5)
    readings["mems_gyro"] = load_preset("adis16505").start(20_000.0, 5, "mems_gyro").process(rate)
    found = verdict(readings, stamps_of(readings), EQ39)
    assert kinds(found) == [("bandwidth", "mems_gyro")]
    # The sensor's corner is 480 Hz, and the comparison reaches 0.45 of 1 kHz.
    assert found.findings[0].value > 300.0


def test_noise_alone_is_no_bandwidth(moving):
    """White noise on the readings far above the believed one, while the response is as believed."""
    readings, time_ns = moving
    rng = np.random.default_rng(2)
    # Three times the angle random walk, 0.0025 deg/sqrt(s), at 2 kHz: it leaves the gain 17 standard deviations, of the
    # ten that show a motion. Five times leaves 10 to 13, and one record of ten has none then.
    loud = readings["mems_gyro"] + 3.0 * 0.0025 * DEG * math.sqrt(2000.0) * rng.normal(size=readings["mems_gyro"].size)
    assert kinds(verdict(readings | {"mems_gyro": loud}, time_ns, EQ39)) == [("belief", "mems_gyro")]


def test_a_bias_of_the_blind_sensor_shows_and_that_of_the_other_does_not(moving):
    readings, time_ns = moving
    found = verdict(readings | {"mhd_ars": readings["mhd_ars"] + 0.05 * DEG}, time_ns, EQ39)
    assert kinds(found) == [("bias", "mhd_ars")]
    assert found.findings[0].lower < 0.05 * DEG < found.findings[0].upper
    assert found.findings[0].upper - found.findings[0].lower < 0.02 * DEG
    found = verdict(readings | {"mems_gyro": readings["mems_gyro"] + 0.05 * DEG}, time_ns, EQ39)
    assert found.findings == ()
    assert "mems_gyro: bias: it alone sees a constant rate" in found.undecided


def test_gaps_repeats_and_ends_of_the_range(moving):
    readings, time_ns = moving
    z = readings["mhd_ars"].copy()
    z[100_000:110_000] = np.nan
    assert kinds(verdict(readings | {"mhd_ars": z}, time_ns, EQ39)) == [("gaps", "mhd_ars")]
    z[100_000:110_000] = readings["mhd_ars"][100_000]
    assert kinds(verdict(readings | {"mhd_ars": z}, time_ns, EQ39)) == [("repeats", "mhd_ars")]
    z = readings["mhd_ars"].copy()
    z[100_000:100_004] = 31.0 * DEG
    found = verdict(readings | {"mhd_ars": z}, time_ns, EQ39)
    assert ("saturation", "mhd_ars") in kinds(found)


@pytest.mark.parametrize(
    ("said", "wrote", "factor"), [("deg/s", "deg/h", 3600.0), ("deg/s", "rad/s", DEG), ("deg/h", "deg/s", 1.0 / 3600.0)]
)
def test_a_unit_that_was_said_wrong_is_told_from_all_others(moving, said, wrote, factor):
    """3600 is no unit against rad/s, but arcmin/s is within 5 % of it."""
    readings, time_ns = moving
    spoilt = readings | {"mems_gyro": factor * readings["mems_gyro"]}
    found = verdict(spoilt, time_ns, EQ39, {"mems_gyro": UNITS[said]})
    assert kinds(found) == [("unit", "mems_gyro")]
    assert found.findings[0].value == pytest.approx(factor, rel=1e-12)
    assert f"it reads in {wrote}, not in {said}: divide its readings by {factor:.6g}" in str(found.findings[0])


def test_words_that_are_coarser_than_believed_are_not_told_to_be_stuck(rng):
    """Words of 0.07 deg/s, five standard deviations of the noise, under a belief of fine ones: filters miss most."""
    belief = load_belief({"g": {"numerator": [1.0], "denominator": [1.0], "output_noise": 1.7e-5, "resolution": 1e-8}})
    word, n = 0.07 * DEG, 20_000
    z = np.rint((2.4e-4 * rng.standard_normal(n) + 0.45 * word) / word) * word
    stamps = {"g": np.arange(n) * 5_000_000}
    (found,) = verdict({"g": z}, stamps, belief).findings
    assert found.kind == "repeats"
    assert "all are words of 0.07 deg/s, so believe that resolution" in str(found)
    coarse = {"g": belief["g"].model_copy(update={"resolution": word})}
    assert verdict({"g": z}, stamps, coarse).findings == ()
    # Words of two standard deviations repeat each other some dozen times, and not 4000 times.
    z = np.rint(2.4e-4 * rng.standard_normal(n) / 4.8e-4) * 4.8e-4
    assert "believe that resolution" in str(verdict({"g": z}, stamps, belief).findings[0])
    z[5000:9000] = z[5000]
    assert "mend what stuck" in str(verdict({"g": z}, stamps, belief).findings[0])


def test_what_is_cut_off_at_the_end_of_the_range_is_neither_noise_nor_stuck():
    _, readings = record(ramped(lambda t: 40.0 * four(t)), DURATION, 7)
    limit = EQ39["mhd_ars"].range
    cut = readings | {"mhd_ars": np.clip(readings["mhd_ars"], -limit, limit)}
    found = verdict(cut, stamps_of(cut), EQ39)
    assert ("saturation", "mhd_ars") in kinds(found)
    assert not {("repeats", "mhd_ars"), ("belief", "mhd_ars")} & set(kinds(found))


def test_a_sensor_that_always_reads_the_same_is_stuck_and_no_more(moving):
    """Alone, so that its noise is looked for in what is not stuck."""
    readings, time_ns = moving
    found = verdict({"mems_gyro": np.zeros(readings["mems_gyro"].size)}, {"mems_gyro": time_ns["mems_gyro"]}, EQ39)
    assert kinds(found) == [("repeats", "mems_gyro")]


def test_clocks_that_drift_apart_by_more_than_the_search_reaches_are_told(rng):
    """3000 ppm over 400 s: 0.6 s at either end; half a second is searched."""
    like = {"numerator": [300.0], "denominator": [1.0, 300.0]}
    belief = load_belief({"good": like | {"output_noise": 1e-5}, "late": like | {"output_noise": 1e-4}})
    t = np.arange(40_000) / 100.0
    readings = {}
    for name, run, std in (("good", 0.0, 1e-4), ("late", 3e-3, 1e-3)):
        true = (1.0 - run) * t
        lines = sum(0.02 * np.sin(2.0 * np.pi * f * true + f) for f in (0.71, 3.3, 11.7))
        readings[name] = lines + std * rng.standard_normal(t.size)
    stamps = np.rint(1e9 * t).astype(np.int64)
    found = verdict(readings, {"good": stamps, "late": stamps}, belief)
    assert kinds(found) == [("rate", "late")]
    assert found.findings[0].value == pytest.approx(3e-3, rel=0.0, abs=20e-6)


def test_sensors_that_were_swapped_are_told(moving):
    readings, time_ns = moving
    names = {"mhd_ars": "mems_gyro", "mems_gyro": "mhd_ars"}
    found = verdict(*({names[key]: one for key, one in each.items()} for each in (readings, time_ns)), EQ39)
    assert [one.kind for one in found.findings] == ["swapped"]
    assert "the readings of mems_gyro are as is believed of mhd_ars" in found.findings[0].remedy


@pytest.mark.parametrize(
    "others",
    [
        still,
        lambda t: 0.1 * DEG * np.sin(18.0 * np.pi * t),
        lambda t: 0.01 * four(t) + 0.1 * DEG * np.sin(18.0 * np.pi * t),
    ],
    ids=["still", "another line", "one in a hundred of it beside another line"],
)
@pytest.mark.parametrize("turned", ["mhd_ars", "mems_gyro"])
def test_sensors_of_other_axes_are_told_and_nothing_else(others, turned):
    """What of each is its noise nothing tells then: a line would be taken for a noise of another bandwidth."""
    _, readings = record(ramped(four), DURATION, 7)
    _, other = record(ramped(others), DURATION, 8)
    spoilt = readings | {turned: other[turned]}
    found = verdict(spoilt, stamps_of(spoilt), EQ39)
    assert [one.kind for one in found.findings] == ["axis"]
    assert remedied(spoilt, stamps_of(spoilt), found).verdict.unfixed == found.findings


def test_missing_stamps_are_gaps_as_missing_readings_are(moving):
    readings, time_ns = moving
    keep = np.ones(readings["mems_gyro"].size, dtype=bool)
    keep[10_000:10_500] = False
    found = verdict(
        readings | {"mems_gyro": readings["mems_gyro"][keep]}, time_ns | {"mems_gyro": time_ns["mems_gyro"][keep]}, EQ39
    )
    assert kinds(found) == [("gaps", "mems_gyro")]
    assert found.findings[0].value == pytest.approx(500 / keep.size)


def test_the_odd_one_of_three_is_named(moving):
    """Of two gyros and an MHD ARS the one that all others contradict."""
    _, more = record(ramped(mixed), DURATION, 8)
    readings, time_ns = moving
    three = readings | {"second": more["mems_gyro"]}
    clocks = time_ns | {"second": time_ns["mems_gyro"]}
    belief = EQ39 | {"second": EQ39["mems_gyro"]}
    assert verdict(three, clocks, belief).findings == ()
    assert kinds(verdict(three | {"mhd_ars": -three["mhd_ars"]}, clocks, belief)) == [("sign", "mhd_ars")]
    assert kinds(verdict(three | {"second": -three["second"]}, clocks, belief)) == [("sign", "second")]
    assert kinds(verdict(three | {"mhd_ars": 1.05 * three["mhd_ars"]}, clocks, belief)) == [("gain", "mhd_ars")]
    assert kinds(verdict(three | {"second": 1.05 * three["second"]}, clocks, belief)) == [("gain", "second")]


def test_one_sensor_alone_leaves_all_else_open(moving):
    readings, time_ns = moving
    found = verdict({"mhd_ars": readings["mhd_ars"]}, {"mhd_ars": time_ns["mhd_ars"]}, EQ39)
    assert found.findings == ()
    assert any("no other sensor" in text for text in found.undecided)


def test_too_little_is_said_to_be_too_little(moving):
    readings, time_ns = moving
    short = {name: z[: round(RATES[name])] for name, z in readings.items()}
    found = verdict(short, {name: time_ns[name][: z.size] for name, z in short.items()}, EQ39)
    assert found.findings == ()
    assert any("in common" in text for text in found.undecided)
    empty = {name: np.full(50, np.nan) for name in readings}
    found = verdict(empty, {name: time_ns[name][:50] for name in readings}, EQ39)
    assert len(found.undecided) == 2


def test_stamps_may_be_of_any_clock(moving):
    """Stamps of a clock that began in 1970, jitter of 20 us, and readings that are out of order."""
    readings, time_ns = moving
    rng = np.random.default_rng(4)
    late = time_ns["mems_gyro"] + 1_700_000_000_000_000_000
    order = np.arange(late.size)
    order[100:102] = 101, 100
    # A sine of 10 Hz and 0.18 deg/s moves by 0.0002 deg/s in 20 us, a hundredth of the noise.
    jittered = (late + np.rint(20_000 * rng.normal(size=late.size)).astype(np.int64))[order]
    found = verdict(
        readings | {"mems_gyro": readings["mems_gyro"][order]},
        {"mems_gyro": jittered, "mhd_ars": time_ns["mhd_ars"] + 1_700_000_000_000_000_000},
        EQ39,
    )
    assert found.findings == ()


def test_stamps_are_asked_for(moving):
    readings, time_ns = moving
    with pytest.raises(ValueError, match="time_ns: expected the stamps of the"):
        verdict(readings, {"mhd_ars": time_ns["mhd_ars"]}, EQ39)
    with pytest.raises(ValueError, match="belief: expected one for each"):
        verdict(readings, time_ns, {"mhd_ars": EQ39["mhd_ars"]})


def test_readings_stay_as_they_are(moving):
    readings, time_ns = moving
    before = {name: z.copy() for name, z in readings.items()}
    verdict(readings, time_ns, EQ39)
    assert all(np.array_equal(before[name], z) for name, z in readings.items())


def test_estimate_warns_of_each_finding_and_keeps_them(moving):
    readings, _ = moving
    assert estimate("kalman", readings, sample_rate_hz=RATES).findings == ()
    turned = readings | {"mems_gyro": -readings["mems_gyro"]}
    with pytest.warns(VerdictWarning, match="mems_gyro: sign -1") as said:
        found = estimate("kalman", turned, sample_rate_hz=RATES)
    assert [(one.kind, one.sensor) for one in found.findings] == [("sign", "mems_gyro")]
    # It points at who called.
    assert [one.filename for one in said] == [__file__]
    assert estimate("kalman", turned, sample_rate_hz=RATES, verdict=False).findings == ()
