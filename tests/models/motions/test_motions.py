"""Each kind of motion against its closed form."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.testing import assert_allclose
from scipy.signal import hilbert, periodogram

from testbed.errors import ScenarioError
from testbed.models.motions.chirp import Chirp
from testbed.models.motions.constant import Constant
from testbed.models.motions.multisine import Multisine
from testbed.models.motions.random import Random
from testbed.models.motions.recorded import Recorded
from testbed.models.motions.sine import Sine
from testbed.models.motions.static import Static

T = np.linspace(0.0, 2.0, 4001)


def rate_of(motion, duration=2.0, seed=1):
    return motion.start(duration, np.random.default_rng(seed))


def test_sine_by_rate_follows_the_sine(rng):
    rate = Sine(frequency=3.0, rate=0.2, phase=0.7).start(2.0, rng)(T)
    assert_allclose(rate, 0.2 * np.sin(2 * np.pi * 3.0 * T + 0.7), rtol=0, atol=1e-15)


def test_sine_by_angle_is_the_derivative_of_the_angle():
    """The paper's mixed signal: 5.555 mrad at 0.5 Hz is 1 deg/s, 50 urad at 10 Hz is 0.18 deg/s."""
    assert np.rad2deg(rate_of(Sine(frequency=0.5, angle=5.555e-3))(np.zeros(1))[0]) == pytest.approx(1.0, abs=1e-4)
    assert np.rad2deg(rate_of(Sine(frequency=10.0, angle=50e-6))(np.zeros(1))[0]) == pytest.approx(0.18, abs=1e-4)
    h = 1e-6
    angle = 5.555e-3 * np.sin(2 * np.pi * 0.5 * np.array([1.0 - h, 1.0 + h]) + 0.3)
    # Central difference: h^2 w^2 / 6 = 2e-12 relative, rounding 1e-16 / h = 1e-10.
    assert rate_of(Sine(frequency=0.5, angle=5.555e-3, phase=0.3))(np.ones(1))[0] == pytest.approx(
        np.diff(angle)[0] / (2 * h), rel=1e-7
    )


@pytest.mark.parametrize("kwargs", [{}, {"rate": 1.0, "angle": 1.0}])
@pytest.mark.parametrize("kind", ["sine", "multisine"])
def test_exactly_one_amplitude_is_needed(kind, kwargs):
    with pytest.raises(ValueError, match="exactly one of rate"):
        Sine(frequency=1.0, **kwargs) if kind == "sine" else Multisine(frequencies=(1.0, 2.0), **kwargs)


def test_multisine_has_its_lines_and_a_low_crest_factor():
    frequencies = tuple(float(f) for f in range(1, 33))
    t = np.arange(20_000) / 10_000.0  # two whole periods of every line
    motion = Multisine(frequencies=frequencies, rate=0.1)
    rate = rate_of(motion)(t)
    spectrum = np.abs(np.fft.rfft(rate)) / (t.size / 2)
    assert_allclose(spectrum[2 * np.arange(1, 33)], 0.1, rtol=1e-10)
    assert motion.lines() == frequencies
    # Schroeder (1970) promises a peak of about 1.7 rms for a flat spectrum; all phases zero would give sqrt(2 * 32) =
    # 8.
    assert np.max(np.abs(rate)) / np.sqrt(np.mean(rate**2)) < 2.2


def test_multisine_by_angle_scales_each_line_with_its_frequency():
    t = np.arange(10_000) / 10_000.0
    spectrum = np.abs(np.fft.rfft(rate_of(Multisine(frequencies=(2.0, 8.0), angle=1e-3, phases="zero"))(t))) / 5000
    assert_allclose(spectrum[[2, 8]], 2 * np.pi * np.array([2.0, 8.0]) * 1e-3, rtol=1e-10)


def test_multisine_random_phases_come_from_the_seed():
    motion = Multisine(frequencies=(1.0, 2.0, 3.0), rate=1.0, phases="random")
    assert np.array_equal(rate_of(motion, seed=1)(T), rate_of(motion, seed=1)(T))
    assert not np.array_equal(rate_of(motion, seed=1)(T), rate_of(motion, seed=2)(T))


def test_multisine_refuses_a_repeated_frequency():
    with pytest.raises(ValueError, match="all different"):
        Multisine(frequencies=(1.0, 1.0), rate=1.0)


def test_constant_and_static():
    assert np.array_equal(rate_of(Constant(rate=0.3))(T), np.full(T.size, 0.3))
    assert not rate_of(Static())(T).any()


@pytest.mark.parametrize("sweep", ["linear", "logarithmic"])
def test_chirp_has_the_stated_instantaneous_frequency(sweep):
    f0, f1, duration = 5.0, 50.0, 20.0
    t = np.arange(0.0, duration, 1e-3)
    rate = rate_of(Chirp(start_frequency=f0, stop_frequency=f1, rate=1.0, sweep=sweep), duration)(t)
    observed = np.gradient(np.unwrap(np.angle(hilbert(rate))), t) / (2 * np.pi)
    expected = f0 + (f1 - f0) * t / duration if sweep == "linear" else f0 * (f1 / f0) ** (t / duration)
    # The analytic signal of a record that is cut off rings at its ends; in the middle half it holds to a percent.
    middle = slice(t.size // 4, 3 * t.size // 4)
    assert_allclose(observed[middle], expected[middle], rtol=0.01)


def test_chirp_stays_at_its_last_frequency_with_continuous_phase():
    motion = Chirp(start_frequency=1.0, stop_frequency=4.0, rate=1.0, sweep_time=1.0, sweep="linear")
    t = np.array([1.0 - 1e-9, 1.0 + 1e-9])
    assert np.abs(np.diff(rate_of(motion)(t)))[0] < 2 * np.pi * 4.0 * 3e-9
    after = np.array([1.25, 1.5])  # one and two periods of 4 Hz after the sweep, whose 2.5 cycles end at phase pi
    assert_allclose(rate_of(motion)(after), 0.0, atol=1e-12)


def test_random_has_the_stated_two_sided_density_and_nothing_outside():
    psd, low, high = 1e-6, 5.0, 40.0
    fs, duration = 2000.0, 400.0
    t = np.arange(int(fs * duration)) / fs
    rate = rate_of(Random(psd=psd, low=low, high=high), duration)(t)
    freq, one_sided = periodogram(rate, fs, window="hann", detrend=False, return_onesided=True)
    inside = (freq > low + 0.1) & (freq < high - 0.1)
    # n independent periodogram bins of a Gaussian process have a relative spread of 1/sqrt(n); the hann window
    # correlates neighbours (factor 2).
    spread = np.sqrt(2.0 / np.count_nonzero(inside))
    assert np.mean(one_sided[inside]) / 2.0 == pytest.approx(psd, rel=4 * spread)
    outside = (freq > high + 0.5) | ((freq < low - 0.5) & (freq > 0))
    assert np.max(one_sided[outside]) < 1e-6 * psd
    # Gaussian: the kurtosis of n_independent = 2 * 35 Hz * 400 s samples is 3 +- sqrt(24 / n).
    n_independent = 2 * (high - low) * duration
    assert np.mean(rate**4) / np.mean(rate**2) ** 2 == pytest.approx(3.0, abs=4 * np.sqrt(24 / n_independent))


def test_random_depends_on_the_seed_only():
    motion = Random(psd=1e-6, low=1.0, high=10.0)
    assert np.array_equal(rate_of(motion, seed=3)(T), rate_of(motion, seed=3)(T))
    assert not np.array_equal(rate_of(motion, seed=3)(T), rate_of(motion, seed=4)(T))


def test_random_refuses_an_empty_band():
    with pytest.raises(ValueError, match="expected high above low"):
        Random(psd=1e-6, low=10.0, high=10.0)


def write_record(path, t, rate, head="time_ms,rate_deg_s"):
    path.write_text(
        "\n".join(
            [head, *(f"{1e3 * a!r},{float(np.rad2deg(b))!r}" for a, b in zip(t.tolist(), rate.tolist(), strict=True))]
        )
        + "\n"
    )
    return Recorded.model_validate(
        {
            "file": path.name,
            "time": {"column": "time_ms", "unit": "ms"},
            "rate": {"column": "rate_deg_s", "unit": "deg/s"},
        },
        context={"border": True, "folder": path.parent},
    )


def test_recorded_returns_what_was_recorded_with_its_units(tmp_path):
    t = np.arange(0.0, 3.0, 0.01)
    motion = write_record(tmp_path / "r.csv", t + 7.0, 0.1 * np.sin(2 * np.pi * t))
    between = np.linspace(0.1, 2.0, 777)
    # Cubic spline of a 1 Hz sine at 100 Hz: (w h)^4 / 384 = 4e-8 of the amplitude.
    assert_allclose(rate_of(motion, 2.0)(between), 0.1 * np.sin(2 * np.pi * between), atol=1e-8)
    assert motion.top_frequency() == pytest.approx(1.0, abs=3.0)


@pytest.mark.parametrize(
    ("edit", "line", "message"),
    [
        (lambda rows: [*rows[:50], *rows[51:]], 51, "uneven or missing"),
        (lambda rows: [*rows[:20], "abc,1", *rows[21:]], 21, "expected a finite number"),
        (lambda rows: [*rows[:20], "190,", *rows[21:]], 21, "expected a finite number"),
        (lambda rows: [*rows[:20], rows[20].split(",")[0] + ",nan", *rows[21:]], 21, "finite"),
        (lambda rows: ["time,rate", *rows[1:]], None, "no column 'rate_deg_s'"),
        (lambda rows: rows[:3], None, "at least 4 samples"),
    ],
    ids=["missing sample", "text", "empty field", "nan", "no column", "too short"],
)
def test_recorded_refuses_bad_records_with_their_line(tmp_path, edit, line, message):
    path = tmp_path / "r.csv"
    motion = write_record(path, np.arange(0.0, 3.0, 0.01), np.ones(300))
    path.write_text("\n".join(edit(path.read_text().splitlines())))
    with pytest.raises(ScenarioError, match=message) as caught:
        rate_of(motion, 1.0)
    assert caught.value.problems[0].line == line
    assert caught.value.problems[0].file == str(path)


def test_recorded_refuses_a_record_shorter_than_the_run(tmp_path):
    motion = write_record(tmp_path / "r.csv", np.arange(0.0, 3.0, 0.01), np.ones(300))
    with pytest.raises(ScenarioError, match="shorter than the run"):
        rate_of(motion, 5.0)


def test_recorded_refuses_a_wrong_unit():
    with pytest.raises(ValueError, match="wrong dimension"):
        Recorded(file="x.csv", time={"column": "t", "unit": "Hz"}, rate={"column": "r", "unit": "deg/s"})


def test_recorded_refuses_a_missing_and_a_binary_file(tmp_path):
    motion = write_record(tmp_path / "r.csv", np.arange(0.0, 3.0, 0.01), np.ones(300))
    (tmp_path / "r.csv").write_bytes(bytes(range(256)))
    with pytest.raises(ScenarioError, match=r"cannot be read"):
        rate_of(motion, 1.0)
    (tmp_path / "r.csv").unlink()
    with pytest.raises(ScenarioError, match="cannot be read"):
        rate_of(motion, 1.0)
