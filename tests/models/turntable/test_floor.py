"""The floor's vibration: lines and bands against their definitions, and the streams they draw from."""

from __future__ import annotations

from functools import partial

import numpy as np
import pytest
from pydantic import ValidationError

from testbed.models.turntable.floor import AXES, Floor, FloorBand, FloorLine
from testbed.signals import random_stream

STREAM = partial(random_stream, 7, "turntable", "floor")
BAND = FloorBand(axis="rz", low=10.0, high=50.0, angular_acceleration_psd=2e-6)


@pytest.mark.oracle
@pytest.mark.parametrize("axis", AXES)
def test_line_is_the_sine_that_was_given(axis: str) -> None:
    f, phase, size = 12.0, 0.7, 3e-6
    name = "angle" if "r" in axis else "displacement"
    floor = Floor(lines=(FloorLine(axis=axis, frequency=f, phase=phase, **{name: size}),), ramp_in=0.0)
    t = np.linspace(0.0, 1.0, 777)
    moved = floor.start(1.0, STREAM).inputs(t)
    assert list(moved) == [axis]
    corner = 2 * np.pi * f
    np.testing.assert_allclose(moved[axis][0], size * np.sin(corner * t + phase), rtol=0.0, atol=1e-13 * size)
    speed = size * corner * np.cos(corner * t + phase)
    np.testing.assert_allclose(moved[axis][1], speed, rtol=0.0, atol=1e-13 * size * corner)


@pytest.mark.oracle
@pytest.mark.parametrize(("axis", "name"), [("x", "acceleration"), ("rx", "angular_acceleration")])
def test_acceleration_is_the_second_derivative_of_the_line(axis: str, name: str) -> None:
    f, size = 12.0, 0.01
    floor = Floor(lines=(FloorLine(axis=axis, frequency=f, phase=0.2, **{name: size}),), ramp_in=0.0)
    t, h = np.linspace(0.0, 0.2, 100), 1e-5
    inputs = floor.start(1.0, STREAM).inputs
    slope = (inputs(t + h)[axis][1] - inputs(t - h)[axis][1]) / (2 * h)
    # Central differences: (w h)^2 / 6 = 1e-7 off; rounding of a rate of 1e-4 over 2e-5 adds 1e-12 of it.
    np.testing.assert_allclose(slope, size * np.sin(2 * np.pi * f * t + 0.2), rtol=0.0, atol=3e-7 * size)


@pytest.mark.oracle
@pytest.mark.parametrize("ramp_in", [0.0, 0.5])
def test_second_input_is_the_rate_of_change_of_the_first(ramp_in: float) -> None:
    line = FloorLine(axis="rz", frequency=30.0, angle=1e-6)
    motion = Floor(lines=(line,), bands=(BAND,), ramp_in=ramp_in).start(1.0, STREAM)
    t, h = np.linspace(0.01, 0.99, 500), 1e-5
    place = [motion.inputs(t + i * h)["rz"][0] for i in (-2, -1, 1, 2)]
    slope = (place[0] - 8 * place[1] + 8 * place[2] - place[3]) / (12 * h)
    speed = motion.inputs(t)["rz"][1]
    # Fourth-order differences: (w h)^4 / 30 = 3e-12; rounding of 1e-6 rad over 1e-5 s is 1e-10 of the rate of 2e-4.
    np.testing.assert_allclose(slope, speed, rtol=0.0, atol=1e-8 * np.abs(speed).max())


@pytest.mark.parametrize("ramp_in", [0.2, 1.0])
def test_onset_is_smooth_and_complete(ramp_in: float) -> None:
    line = FloorLine(axis="z", frequency=30.0, displacement=1e-6, phase=1.0)
    soft, hard = (Floor(lines=(line,), ramp_in=length).start(3.0, STREAM) for length in (ramp_in, 0.0))
    assert soft.inputs(np.zeros(1))["z"] == (0.0, 0.0)
    late = np.linspace(ramp_in, 3.0, 100)
    for order in (0, 1):
        np.testing.assert_array_equal(soft.inputs(late)["z"][order], hard.inputs(late)["z"][order])


@pytest.mark.oracle
@pytest.mark.parametrize("seed", [1, 2, 3])
def test_band_has_its_density_inside_and_nothing_outside(seed: int) -> None:
    duration, fs = 100.0, 1000.0
    floor = Floor(bands=(BAND,), ramp_in=0.0)
    t = np.arange(int(duration * fs)) / fs
    angle, rate = floor.start(duration, partial(random_stream, seed)).inputs(t)["rz"]
    window = np.hanning(t.size)
    freq = np.fft.rfftfreq(t.size, 1 / fs)
    corner = 2 * np.pi * np.maximum(freq, 1e-9)
    for signal, order in ((angle, 2), (rate, 1)):
        line = np.abs(np.fft.rfft(window * signal)) ** 2 / (fs * np.sum(window**2))
        density = line * corner ** (2 * order)
        for low, high in ((10.5, 20.0), (20.0, 35.0), (35.0, 49.5)):
            # Chi-square with two degrees of freedom a line; the window correlates neighbours (1.5 of them): 5 sigma.
            inside = density[(freq >= low) & (freq < high)]
            assert inside.mean() == pytest.approx(BAND.angular_acceleration_psd, rel=5 * np.sqrt(1.5 / inside.size))
        # Leakage of the window beyond 0.5 Hz = 50 of its bins.
        assert line[(freq > 50.5) | ((freq < 9.5) & (freq > 0.5))].max() < 1e-6 * line.max()


def test_another_axis_or_line_leaves_a_band_as_it_was() -> None:
    other = FloorBand(axis="x", low=1.0, high=20.0, acceleration_psd=1e-6)
    line = FloorLine(axis="y", frequency=5.0, displacement=1e-6)
    t = np.linspace(0.0, 1.0, 100)
    alone = Floor(bands=(BAND,)).start(1.0, STREAM).inputs(t)["rz"]
    among = Floor(lines=(line,), bands=(other, BAND)).start(1.0, STREAM).inputs(t)["rz"]
    np.testing.assert_array_equal(alone, among)


def test_bands_of_one_axis_and_of_two_axes_are_independent() -> None:
    floor = Floor(bands=(BAND, BAND, BAND.model_copy(update={"axis": "rx"})), ramp_in=0.0)
    t = np.arange(20_000) / 1000.0
    moved = floor.start(20.0, STREAM).inputs(t)
    first = Floor(bands=(BAND,), ramp_in=0.0).start(20.0, STREAM).inputs(t)["rz"][1]
    second = moved["rz"][1] - first
    for a, b in ((first, second), (first, moved["rx"][1]), (second, moved["rx"][1])):
        # 2 * 40 Hz * 20 s = 1600 degrees of freedom, halved by the slope of the density: five sigma of 1/sqrt(800).
        assert abs(np.corrcoef(a, b)[0, 1]) < 5 / np.sqrt(800)


def test_same_seed_same_floor_other_seed_other_floor_any_division() -> None:
    t = np.arange(3000) / 1000.0
    floor = Floor(lines=(FloorLine(axis="rz", frequency=33.0, angle=1e-6),), bands=(BAND,))
    whole = floor.start(3.0, STREAM).inputs(t)["rz"]
    again = floor.start(3.0, STREAM)
    parts = [again.inputs(piece)["rz"] for piece in np.split(t, [1, 17, 1000])]
    np.testing.assert_array_equal(np.concatenate(parts, axis=1), whole)
    assert not np.array_equal(floor.start(3.0, partial(random_stream, 8)).inputs(t)["rz"], whole)


def test_still_floor_moves_nothing() -> None:
    assert Floor().start(1.0, STREAM).inputs(np.zeros(3)) == {}
    assert Floor().top_frequency() == 0.0
    assert Floor(lines=(FloorLine(axis="x", frequency=90, displacement=0),), bands=(BAND,)).top_frequency() == 90.0


@pytest.mark.parametrize(
    ("part", "values", "message"),
    [
        (FloorLine, {"axis": "x", "frequency": 1.0}, "expected displacement or acceleration for axis x, got none"),
        (
            FloorLine,
            {"axis": "x", "frequency": 1.0, "angle": 1.0},
            "expected displacement or acceleration for axis x, got",
        ),
        (
            FloorLine,
            {"axis": "rz", "frequency": 1.0, "acceleration": 1.0},
            "expected angle or angular_acceleration for",
        ),
        (
            FloorLine,
            {"axis": "z", "frequency": 1.0, "acceleration": 1, "displacement": 1},
            "got displacement and accel",
        ),
        (FloorLine, {"axis": "w", "frequency": 1.0, "displacement": 1.0}, "Input should be 'x', 'y'"),
        (FloorLine, {"axis": "x", "frequency": float("nan"), "displacement": 1.0}, "expected a quantity in Hz"),
        (FloorLine, {"axis": "x", "frequency": 1.0, "displacement": float("inf")}, "expected a quantity in m"),
        (FloorBand, {"axis": "x", "low": 5.0, "high": 5.0, "acceleration_psd": 1.0}, "expected high above low"),
        (FloorBand, {"axis": "x", "low": 5.0, "high": 9.0}, "expected acceleration_psd for axis x, got none"),
        (
            FloorBand,
            {"axis": "rx", "low": 5.0, "high": 9.0, "acceleration_psd": 1.0},
            "expected angular_acceleration_psd",
        ),
        (
            FloorBand,
            {"axis": "x", "low": 5.0, "high": 9.0, "acceleration_psd": -1.0},
            "expected at least 0.0 m\\^2/s\\^3",
        ),
        (Floor, {"ramp_in": -1.0}, "expected at least 0.0 s"),
    ],
)
def test_parts_refuse_what_is_no_vibration(part: type, values: dict[str, object], message: str) -> None:
    with pytest.raises(ValidationError, match=message):
        part(**values)
