from __future__ import annotations

import math

import control
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from pydantic import ValidationError

from testbed.errors import ScenarioError, UnknownNameError
from testbed.fusion.belief import SensorBelief, default_belief, load_belief
from testbed.signals import transfer

FREQ_HZ = np.array([0.01, 0.1, 0.5, 2.0, 10.0, 100.0, 1000.0])
# Equation (39) as evaluated to six decimals of gain and four of phase in degrees.
BODE = {
    "mems_gyro": [
        (0.01, 1.021501, 0.7697),
        (0.5, 1.041583, -6.2771),
        (4.0, 0.783154, -41.6384),
        (1000.0, 0.004714, -89.7423),
    ],
    "mhd_ars": [
        (0.01, 0.004078, 89.7687),
        (0.5, 0.199863, 78.5879),
        (2.5, 0.718173, 44.6844),
        (1000.0, 0.814619, -36.2473),
    ],
}
PAIR = {"numerator": (1.0, 2.0e4, 4.0e6), "denominator": (1.0, 400.0, 1.0e6)}  # complex poles and feed-through
FOUR = {"numerator": (3.0e7, 0.0, 0.0), "denominator": tuple(np.poly([-2.0, -18.0, -6000.0, -7000.0]))}


@pytest.mark.oracle
@pytest.mark.parametrize("name", BODE)
def test_realisation_has_the_published_bode(name: str) -> None:
    freq, gain, phase = np.array(BODE[name]).T
    response = default_belief()[name].realisation().response(freq)
    # Half a unit of the last printed digit.
    np.testing.assert_allclose(np.abs(response), gain, rtol=0, atol=0.5e-6)
    np.testing.assert_allclose(np.degrees(np.angle(response)), phase, rtol=0, atol=0.5e-4)


@pytest.mark.oracle
@pytest.mark.parametrize("fields", [PAIR, FOUR, *({k: getattr(b, k) for k in PAIR} for b in default_belief().values())])
def test_realisation_equals_python_control(fields: dict[str, tuple[float, ...]]) -> None:
    belief = SensorBelief(**fields)
    wanted = control.frequency_response(belief.transfer_function(), 2 * np.pi * FREQ_HZ).complex.squeeze()
    # The modes cancel near a zero: each is of order ten, so eps * 10 * a few operations of a gain of one.
    np.testing.assert_allclose(belief.realisation().response(FREQ_HZ), wanted, rtol=1e-11, atol=1e-12)


@pytest.mark.property
@given(
    poles=st.lists(st.floats(0.0, 4.0), min_size=1, max_size=4, unique_by=lambda p: round(p * 4)),
    angle=st.floats(0.0, 1.2),
    zero=st.floats(-3.0, 3.0),
    gain=st.floats(0.1, 10.0),
)
def test_realisation_equals_transfer_function(poles: list[float], angle: float, zero: float, gain: float) -> None:
    magnitudes = 10.0 ** (np.round(np.array(poles) * 4) / 4)
    roots = list(-magnitudes)
    if angle > 0.1:
        pair = magnitudes[0] * np.exp(1j * (np.pi - angle))
        roots[:1] = [pair, pair.conjugate()]
    belief = SensorBelief(numerator=(gain, gain * zero), denominator=tuple(np.real(np.poly(roots))))
    freq = np.geomspace(0.01, 1e3, 9)
    wanted = transfer(list(belief.numerator), list(belief.denominator), freq)
    largest = np.abs(transfer(list(belief.numerator), list(belief.denominator), np.geomspace(1e-3, 1e5, 400))).max()
    # Neighbouring poles differ by at least a factor 1.78; partial fractions of five of them cancel by at most about
    # 1e4.
    np.testing.assert_allclose(belief.realisation().response(freq), wanted, rtol=1e-9, atol=1e-10 * largest)


def test_realisation_is_modal_with_unit_output() -> None:
    one = SensorBelief(**FOUR).realisation()
    assert np.array_equal(one.C, np.ones(4))
    assert np.count_nonzero(one.A - np.diag(np.diag(one.A))) == 0
    pair = SensorBelief(**PAIR).realisation()
    assert pair.D == 1.0
    assert np.array_equal(pair.C, [1.0, 0.0])
    assert pair.A[0, 1] == -pair.A[1, 0] > 0.0


@pytest.mark.parametrize(
    ("numerator", "denominator", "message"),
    [
        ((1.0, 0.0, 0.0), (1.0, 1.0), "numerator: expected a degree of at most 1"),
        ((1.0,), (1.0, -1.0), "expected a stable sensor"),
        ((1.0,), (0.0,), "denominator: expected a coefficient that is not 0"),
        ((math.nan,), (1.0, 1.0), "finite"),
    ],
)
def test_belief_refuses_what_it_cannot_realise(
    numerator: tuple[float, ...], denominator: tuple[float, ...], message: str
) -> None:
    with pytest.raises(ValidationError, match=message):
        SensorBelief(numerator=numerator, denominator=denominator)


def test_default_belief_has_the_noise_of_the_presets() -> None:
    gyro, mhd = default_belief()["mems_gyro"], default_belief()["mhd_ars"]
    assert gyro.input_noise == pytest.approx(math.radians(0.15) / 60.0, rel=1e-12, abs=0.0)
    # 4.243e-5 deg/sqrt(h) is 1e-9 (deg/s)^2 at 2 kHz to the four digits it is written with.
    assert gyro.output_noise**2 * 2000.0 == pytest.approx(math.radians(1.0) ** 2 * 1e-9, rel=2.4e-4, abs=0.0)
    assert mhd.input_noise == 0.0
    assert mhd.output_noise == pytest.approx(1e-7, rel=1e-12, abs=0.0)


def test_load_belief_takes_names_and_mappings() -> None:
    assert load_belief("eq39") == default_belief()
    loaded = load_belief({"g": {"numerator": [1.0], "denominator": [1.0, 1.0], "output_noise": "0.6 deg/sqrt(h)"}})
    assert loaded["g"].output_noise == pytest.approx(math.radians(0.01), rel=1e-12, abs=0.0)
    with pytest.raises(UnknownNameError, match="eq39"):
        load_belief("eq40")
    with pytest.raises(ValidationError, match="nominator"):
        load_belief({"g": {"nominator": [1.0], "denominator": [1.0, 1.0]}})


def test_load_belief_gives_a_mapping_of_its_own() -> None:
    load_belief("eq39").clear()
    assert set(load_belief("eq39")) == {"mems_gyro", "mhd_ars"}


@pytest.mark.parametrize("numerator", [(), (0.0, 0.0), (1e-320,), (1e300,)])
def test_a_sensor_that_passes_nothing_is_refused(numerator):
    with pytest.raises(ValueError, match="numerator: expected readings of the size of the rate"):
        SensorBelief(numerator=numerator, denominator=(0.001, 1.0), output_noise=1e-4)


EQUAL = [[-5.0] * 2, [-5.0] * 3, [-5.0] * 4, [-0.1, -40.0, -40.0, -3000.0], [-2.0, -300 + 400j, -300 - 400j] * 2]


@pytest.mark.oracle
@pytest.mark.parametrize("poles", EQUAL)
def test_equal_poles_have_a_realisation(poles):
    """Poles of a polynomial with m equal ones are found to eps^(1/m), 1e-4 for four: its square is left."""
    a = np.real(np.poly(poles))
    b = a[-1] * np.array([0.001, 1.0])
    belief = SensorBelief(numerator=b, denominator=a)
    wanted = transfer(b, a, FREQ_HZ)
    np.testing.assert_allclose(belief.realisation().response(FREQ_HZ), wanted, rtol=1e-7, atol=1e-9)
    assert belief.realisation().B.size == belief.n_state == a.size - 1


@pytest.mark.oracle
@pytest.mark.parametrize("apart", [0.0, 1e-6, 1e-4, 0.9e-3, 1.1e-3])
def test_poles_that_are_nearly_equal_err_by_the_square_of_their_distance(apart):
    a = np.poly([-20.0, -20.0 * (1.0 + apart), -3.0])
    wanted = transfer([a[-1]], a, FREQ_HZ)
    found = SensorBelief(numerator=(a[-1],), denominator=a).realisation().response(FREQ_HZ)
    # Poles moved by d from their mean: (d/p)^2 of the response at most, d half the distance. Rounding of the roots of a
    # double pole: 1e-8, which partial fractions of single ones 1e-3 apart enlarge by 1e3.
    np.testing.assert_allclose(found, wanted, rtol=apart**2 / 2.0 + 1e-10, atol=1e-10)


@pytest.mark.oracle
def test_a_static_sensor_is_a_factor_and_its_input_noise_lies_on_the_reading():
    belief = SensorBelief(numerator=(0.9,), denominator=(1.0,), input_noise=3e-5, output_noise=2e-5)
    np.testing.assert_array_equal(belief.realisation().response(FREQ_HZ), np.full(FREQ_HZ.size, 0.9 + 0j))
    assert belief.n_state == 0
    assert belief.reading_noise == pytest.approx(math.hypot(2e-5, 0.9 * 3e-5), rel=1e-15, abs=0.0)


@pytest.mark.oracle
@pytest.mark.parametrize("delay", [50e-6, 0.5e-3, 20e-3])
def test_a_delay_keeps_the_gain_and_errs_in_phase_by_what_is_said(delay):
    one = default_belief()["mhd_ars"].model_copy(update={"delay": delay})
    freq = one.delay_holds_to * np.array([0.1, 0.5, 0.9, 1.0])
    ratio = one.realisation().response(freq) / one.response(freq)
    np.testing.assert_allclose(np.abs(ratio), 1.0, rtol=1e-9)
    turn = 2.0 * np.pi * freq * delay
    # The next term of the series is x^2 * 5/84 of the first one: 6 % at 1 rad.
    np.testing.assert_allclose(np.abs(np.angle(ratio)), turn**5 / 720.0, rtol=0.08, atol=1e-9)
    assert np.abs(np.angle(ratio[-1])) == pytest.approx(1e-3, rel=0.08, abs=0.0)


def test_a_belief_stands_in_a_file(tmp_path):
    path = tmp_path / "own.yaml"
    path.write_text("gyro: {numerator: [1.0], denominator: [0.01, 1.0], delay: 0.5 ms, bias: 1 deg/h}\n")
    found = load_belief(str(path))["gyro"]
    assert (found.delay, found.source) == (0.5e-3, "own.yaml")
    assert found.bias == pytest.approx(math.radians(1.0) / 3600.0, rel=1e-12, abs=0.0)
    path.write_text("gyro: {numerator: [1.0], denominator: [0.01, 1.0], delay: 0.5}\n")
    with pytest.raises(ScenarioError, match=r"own.yaml:1: gyro.delay: expected a quantity in s"):
        load_belief(str(path))
