from __future__ import annotations

import dataclasses
import math
from typing import TYPE_CHECKING

import allantools
import numpy as np
import pytest
from allantools import ci
from scipy.signal import welch
from scipy.stats import binom, chi2

from testbed.allan import AllanCurve, allan_deviation, fit_allan
from testbed.allan.fit import judge_fit, term_variance
from testbed.allan.freedom import chi_square_quantile, equivalent_freedom
from testbed.sensors import load_preset
from testbed.sensors.noise import GyroNoise, GyroTerms

if TYPE_CHECKING:
    from collections.abc import Callable

    from testbed.signals import FloatArray

TERMS = ("quantization", "angle_random_walk", "bias_instability", "rate_random_walk", "rate_ramp")


def nist_series() -> list[float]:
    """Return the 1000-point test set of NIST SP 1065: a linear congruential generator."""
    values, n = [], 1234567890
    for _ in range(1000):
        values.append(n / 2147483647)
        n = 16807 * n % 2147483647
    return values


@pytest.mark.oracle
def test_deviation_meets_the_nist_test_set() -> None:
    # NIST SP 1065, published overlapping Allan deviation, seven digits.
    curve = allan_deviation(np.array(nist_series()), 1.0, np.array([1.0, 10.0, 100.0]))
    np.testing.assert_allclose(curve.deviation, [2.922319e-01, 9.159953e-02, 3.241343e-02], rtol=2e-7)


@pytest.mark.oracle
def test_deviation_meets_the_nbs_monograph_140_set() -> None:
    # NIST SP 1065, the nine frequency values of Annex 8.E with the published overlapping Allan deviation.
    rate = [892.0, 809.0, 823.0, 798.0, 671.0, 644.0, 883.0, 903.0, 677.0]
    curve = allan_deviation(rate, 1.0, [1.0, 2.0])
    np.testing.assert_allclose(curve.deviation, [91.22945, 85.95287], rtol=1e-7)


@pytest.mark.oracle
@pytest.mark.parametrize("name", TERMS[:4])
def test_deviation_equals_allantools_for_each_noise(name: str) -> None:
    rate = GyroNoise(**{name: 1e-4}).sample(20_001, 50.0, 2)
    curve = allan_deviation(rate, 50.0)
    _, wanted, _, _ = allantools.oadev(rate, rate=50.0, data_type="freq", taus=curve.tau)
    np.testing.assert_allclose(curve.deviation, wanted, rtol=1e-8)


@pytest.mark.oracle
def test_deviation_equals_allantools() -> None:
    rate = np.random.default_rng(1).standard_normal(20_001).cumsum() + 100.0
    curve = allan_deviation(rate, 50.0)
    _, wanted, _, _ = allantools.oadev(rate, rate=50.0, data_type="freq", taus=curve.tau)
    # allantools keeps the mean: 100 s of angle per second costs it digits, eps * theta / (deviation tau).
    np.testing.assert_allclose(curve.deviation, wanted, rtol=1e-8)


@pytest.mark.oracle
@pytest.mark.parametrize("alpha", [2, 0, -1, -2])
@pytest.mark.parametrize("n_angle", [1001, 20_001])
def test_degrees_of_freedom_equal_allantools(alpha: int, n_angle: int) -> None:
    for m in (1, 2, 5, 10, 31, 63, 64, 100, 250):
        wanted = ci.edf_greenhall(alpha, 2, m, n_angle, overlapping=True, modified=False)
        # Both replace long sums by shorter ones; Greenhall and Riley give theirs as good to a few percent.
        assert equivalent_freedom(m, n_angle, alpha) == pytest.approx(wanted, rel=0.02)


@pytest.mark.oracle
def test_quantiles_of_chi_square_are_scipys() -> None:
    freedom = np.geomspace(0.1, 1e6, 50)
    for probability in (0.025, 0.975):
        # The inverse of the incomplete gamma function, good to some roundings.
        np.testing.assert_allclose(
            chi_square_quantile(probability, freedom), chi2.ppf(probability, freedom), rtol=1e-13, atol=0.0
        )


@pytest.mark.oracle
@pytest.mark.parametrize(("keys", "exponent"), [({"angle_random_walk": 1e-4}, -1), ({"rate_random_walk": 1e-4}, 1)])
def test_limits_cover_the_true_deviation(keys: dict[str, float], exponent: int) -> None:
    runs, fs, tau = 300, 10.0, np.array([1.0, 3.0, 10.0, 30.0, 60.0])
    m = tau * fs
    true = 1e-4 * np.sqrt(tau**exponent * (1.0 if exponent < 0 else (1.0 + 0.5 / m**2) / 3.0))
    inside = np.zeros(tau.size)
    for seed in range(runs):
        curve = allan_deviation(GyroNoise(**keys).sample(3000, fs, seed), fs, tau)
        inside += (curve.lower <= true) & (true <= curve.upper)
    # 99.9 % binomial band about 0.95 for 300 runs is 0.905-0.986; 1.5 % is allowed for the type of noise being guessed.
    assert np.all((inside / runs > 0.89) & (inside / runs < 0.99)), inside / runs


def exact_curve(**true: float) -> AllanCurve:
    tau = np.round(np.geomspace(100, 250_000, 40)) / 100.0
    q, n, b, k, r = (true.get(name, 0.0) ** 2 for name in TERMS)
    variance = 3 * q / tau**2 + n / tau + 2 * math.log(2) / math.pi * b + k * tau / 3 + r * tau**2 / 2
    deviation = np.sqrt(variance)
    return AllanCurve(tau, deviation, deviation, deviation, np.ones(tau.size), 1_000_000, 100.0)


@pytest.mark.oracle
@pytest.mark.parametrize("lose", ["single", "stretches"])
def test_intervals_cover_the_truth_where_samples_are_lost(lose: str) -> None:
    """White and flicker noise, 1 % of the samples lost at random or 5 % in two stretches: 95 % of 100 records."""
    N, B, n_time, fs, runs = 4e-5, 1.3e-5, 10_000, 10.0, 100
    inside = {"angle_random_walk": 0, "bias_instability": 0}
    for seed in range(runs):
        rate = GyroNoise(angle_random_walk=N, bias_instability=B).sample(n_time, fs, seed)
        rng = np.random.default_rng(seed)
        if lose == "single":
            rate[rng.random(n_time) < 0.01] = np.nan
        else:
            for start in rng.integers(0, n_time - 250, 2):
                rate[start : start + 250] = np.nan
        fit = fit_allan(allan_deviation(rate, fs))
        for name, true in (("angle_random_walk", N), ("bias_instability", B)):
            found = getattr(fit, name)
            inside[name] += found.lower <= true <= found.upper
    # 99.9 % binomial band about 0.95 for 100 runs is 0.87 to 1.
    assert min(inside.values()) >= 87, inside


@pytest.mark.oracle
def test_lost_samples_bias_the_curve_by_nothing() -> None:
    """A tenth of white noise lost: the mean over 200 records is N^2 / tau to six of its standard deviations."""
    curves = []
    for seed in range(200):
        rng = np.random.default_rng(seed)
        rate = rng.standard_normal(2000)
        rate[rng.random(2000) < 0.1] = np.nan
        curves.append(allan_deviation(rate, 1.0, [1, 3, 10, 30, 100]))
    variance = np.array([curve.deviation**2 for curve in curves])
    spread = variance.std(axis=0) / np.sqrt(len(curves))
    assert np.all(np.abs(variance.mean(axis=0) - 1.0 / curves[0].tau) < 6.0 * spread)


@pytest.mark.oracle
def test_fit_recovers_the_coefficients_of_an_exact_curve() -> None:
    true = dict(zip(TERMS, (1e-4, 1e-4, 3e-5, 2e-6, 1e-7), strict=True))
    fit = fit_allan(exact_curve(**true))
    for name in TERMS:
        got = getattr(fit, name)
        assert got.upper >= true[name] >= got.lower
        if got.identified:
            # Sampled columns differ from the continuous ones by 1/m^2 = 1e-4 at most (m >= 100 here).
            assert got.value == pytest.approx(true[name], rel=1e-3)
    assert fit.angle_random_walk.identified
    assert fit.goodness.accepted


@pytest.mark.oracle
@pytest.mark.parametrize(
    ("name", "density", "end", "tail"),
    [
        # T (2 pi f)^2 up to 1 / 2T, here 200 Hz.
        ("quantization", lambda f: (2.0 * np.pi * f) ** 2 / 400.0, 200.0, 0.0),
        ("angle_random_walk", lambda f: 1.0 + 0.0 * f, 2000.0, 1.0 / 2000.0),
        ("bias_instability", lambda f: 1.0 / (2.0 * np.pi * f), 2000.0, 1.0 / (4.0 * np.pi * 2000.0**2)),
        ("rate_random_walk", lambda f: 1.0 / (2.0 * np.pi * f) ** 2, 2000.0, 0.0),
    ],
)
def test_columns_are_the_integral_over_the_density(
    name: str, density: Callable[[FloatArray], FloatArray], end: float, tail: float
) -> None:
    """Judge the closed forms by IEEE Std 952's integral, 4 S(f) sin^4(pi f tau) / (pi f tau)^2 df, at tau = 1 s."""
    f = (np.arange(round(end * 200)) + 0.5) / 200.0
    integral = np.sum(4.0 * density(f) * np.sin(np.pi * f) ** 4 / (np.pi * f) ** 2) / 200.0
    # Beyond `end` the mean of sin^4, 3/8, counts; `tail` is the integral of S / f^2.
    integral += 1.5 / np.pi**2 * tail
    curve = AllanCurve(*np.full((5, 1), 1.0), n_time=10**9, sample_rate_hz=1e5)
    # Midpoints of h = 1/200: h^2 / 24 times the flicker's slope of 2 pi at zero frequency is 1.5e-5 of its 0.44.
    assert term_variance(curve, name, 1.0)[0] == pytest.approx(integral, rel=2e-5, abs=0)


@pytest.mark.oracle
@pytest.mark.parametrize(("name", "exponent"), list(zip(TERMS[:4], (2, 0, -1, -2), strict=True)))
def test_fit_finds_the_coefficient_of_a_peers_noise(name: str, exponent: int, monkeypatch: pytest.MonkeyPatch) -> None:
    """Noise by Kasdin and Walter (1992) from allantools: S = 2 qd (2 pi f)^b T^(b+1), one-sided."""
    fs, n, value = 10.0, 2**16, 1e-4
    # Half of it is two-sided: (2 pi f)^2 T Q^2, N^2, B^2 / (2 pi f), K^2 / (2 pi f)^2 give qd.
    qd = value**2 * {2: fs**2, 0: fs, -1: 1.0, -2: 1.0 / fs}[exponent]
    stream = np.random.default_rng(5)
    monkeypatch.setattr(np.random, "normal", stream.normal)
    noise = allantools.Noise(nr=n, qd=qd, b=exponent)
    noise.generateNoise()
    fit = fit_allan(allan_deviation(noise.time_series, fs))
    got = getattr(fit, name)
    assert fit.goodness.accepted
    assert got.identified
    margin = got.upper - got.lower  # 8 standard deviations together with the interval's own
    assert got.lower - margin < value < got.upper + margin
    assert got.upper / got.lower < 1.6


@pytest.mark.oracle
def test_vendors_one_sided_density_is_root_two_larger() -> None:
    """Judge n = sqrt(2) N by scipy's density, which is one-sided as a vendor's rate noise density is."""
    rate = GyroNoise(angle_random_walk=1e-4).sample(2**18, 100.0, 4)
    _, one_sided = welch(rate, 100.0, nperseg=1024)
    vendor = math.sqrt(np.mean(one_sided[5:-5]))
    got = fit_allan(allan_deviation(rate, 100.0)).angle_random_walk.value
    # Both from 2^18 samples: 5 / sqrt(2^18), and the Hann window's overlap leaves two thirds of the record's worth.
    assert vendor / got == pytest.approx(math.sqrt(2.0), rel=0.015)


def test_part_of_a_curve() -> None:
    curve = allan_deviation(GyroNoise(angle_random_walk=1e-4).sample(2000, 10.0, 1), 10.0)
    part = curve.between(0.5, 20.0)
    assert part.tau[0] >= 0.5 > curve.tau[curve.tau < part.tau[0]][-1]
    assert part.tau[-1] <= 20.0 < curve.tau[curve.tau > part.tau[-1]][0]
    chosen = np.isin(curve.tau, part.tau)
    for name in ("deviation", "lower", "upper", "edf"):
        assert np.array_equal(getattr(part, name), getattr(curve, name)[chosen])
    assert (part.n_time, part.sample_rate_hz) == (2000, 10.0)
    assert judge_fit(part) == fit_allan(part).goodness


def test_fit_gives_an_upper_limit_for_what_the_record_cannot_show() -> None:
    fit = fit_allan(allan_deviation(GyroNoise(angle_random_walk=1e-4).sample(20_000, 100.0, 3), 100.0))
    assert fit.angle_random_walk.identified
    for name in set(TERMS) - {"angle_random_walk"}:
        got = getattr(fit, name)
        assert not got.identified
        assert math.isnan(got.value)
        assert got.lower == 0.0
        assert 0.0 < got.upper < math.inf


@pytest.mark.oracle
@pytest.mark.parametrize("fs", [100.0, 2000.0, 20000.0])
@pytest.mark.parametrize("name", ["quantization", "angle_random_walk", "bias_instability", "rate_random_walk"])
def test_fit_finds_each_term_alone_at_three_rates(name: str, fs: float) -> None:
    fit = fit_allan(allan_deviation(GyroNoise(**{name: 1e-5}).sample(100_000, fs, 17), fs))
    got = getattr(fit, name)
    assert fit.goodness.accepted
    assert got.identified
    # A 95 % interval, four times as wide: 8 standard deviations.
    margin = 3.0 * (got.upper - got.lower)
    assert got.lower - margin < 1e-5 < got.upper + margin
    assert got.upper / got.lower < 1.6


def preset_terms(**changed: float) -> dict[str, float]:
    gyro = load_preset("adis16505")
    return {**{name: getattr(gyro, name) for name in GyroTerms.model_fields}, **changed}


@pytest.mark.slow
@pytest.mark.oracle
@pytest.mark.parametrize(
    ("changed", "fs", "n", "top", "seen", "hidden"),
    [
        # White noise and flicker cross at 25 s; below 0.1 mHz the preset's flicker is flat and no longer in the model,
        # so the fit ends at 500 s. The walk would cross the flicker at 40 days.
        pytest.param({}, 10.0, 100_000, 500.0, "NB", "K", id="10000 s at 10 Hz"),
        # Without the flicker the walk crosses the white noise at 2.6 hours.
        pytest.param({"bias_instability": 0.0}, 0.02, 100_000, math.inf, "NK", "", id="58 days at 0.02 Hz"),
        pytest.param({}, 100.0, 6000, math.inf, "N", "BK", id="60 s at 100 Hz"),
    ],
)
def test_intervals_cover_the_coefficients_of_a_preset(
    changed: dict[str, float], fs: float, n: int, top: float, seen: str, hidden: str
) -> None:
    true = preset_terms(**changed)
    names = dict(zip("QNBKR", TERMS, strict=True))
    runs = 200
    covered, shown, worth = dict.fromkeys(seen + hidden, 0), dict.fromkeys(seen + hidden, 0), []
    for seed in range(runs):
        fit = fit_allan(allan_deviation(GyroNoise(**true).sample(n, fs, seed), fs).between(0.0, top))
        worth.append(fit.goodness)
        for letter in covered:
            got = getattr(fit, names[letter])
            shown[letter] += got.identified
            covered[letter] += got.lower <= true[names[letter]] <= got.upper
    refused = sum(not one.accepted for one in worth)
    below = {p: sum(one.p_value < p for one in worth) for p in (0.05, 0.5)}
    print(f"{runs} records: covered {covered}, shown as numbers {shown}, p below {below}, refused {refused}")
    low, high = binom.interval(0.99, runs, 0.95)
    for letter in seen:
        assert shown[letter] == runs
        assert low <= covered[letter] <= high
    # A limit covers from below only, so it may always hold; a term that is not there is seen once in 700 fits.
    for letter in hidden:
        assert shown[letter] <= 4
        assert covered[letter] >= 0.95 * runs
    # A right model is refused once in a thousand (99.9 % of such counts), and its p is uniform: half of them below 0.5
    # within 0.12 (3.3 sigma) and 0.08 for a sum of correlated squares that counts as chi square.
    assert refused <= 3
    assert below[0.05] <= binom.ppf(0.999, runs, 0.05)
    assert 0.3 * runs < below[0.5] < 0.7 * runs


@pytest.mark.slow
@pytest.mark.oracle
def test_limits_and_intervals_hold_at_the_edge_of_what_is_seen() -> None:
    """1000 s show the preset's flicker half the time: what is seen depends on chance, what is claimed must hold."""
    true = preset_terms()
    shown, limits, below = 0, 0, 0
    for seed in range(200):
        record = GyroNoise(**true).sample(10_000, 10.0, seed)
        got = fit_allan(allan_deviation(record, 10.0)).bias_instability
        shown += got.identified and got.lower <= true["bias_instability"] <= got.upper
        limits += not got.identified
        below += not got.identified and true["bias_instability"] <= got.upper
    print(f"limits {limits}, of which hold {below}; numbers {200 - limits}, of which cover {shown}")
    assert 40 < limits < 160
    assert below >= binom.ppf(0.005, limits, 0.95)
    assert shown + below >= binom.ppf(0.005, 200, 0.95)


def test_fit_scales_with_the_unit() -> None:
    rate = GyroNoise(angle_random_walk=1e-4, bias_instability=1e-4).sample(20_000, 100.0, 1)
    small, large = (fit_allan(allan_deviation(rate * scale, 100.0)) for scale in (1.0, 2.0**20))
    for name in TERMS:
        a, b = dataclasses.astuple(getattr(small, name)), dataclasses.astuple(getattr(large, name))
        np.testing.assert_allclose(np.array(b) / 2.0**20, a, rtol=1e-9)


@pytest.mark.parametrize(
    ("rate", "fs", "tau", "message"),
    [
        (np.zeros((2, 8)), 1.0, None, "rate: expected a vector"),
        (np.zeros(3), 1.0, None, "rate: expected a vector of at least 4"),
        (np.array([0.0, 1.0, np.inf, 0.0]), 1.0, None, "got inf at sample 2"),
        (np.array([0.0, np.nan, np.nan, np.nan, 0.0]), 1.0, None, "at least half of 5 samples, got 2"),
        (np.zeros(8), 0.0, None, "sample_rate_hz: expected a positive number"),
        (np.zeros(8), 1.0, np.array([0.2]), "tau: expected 1 to 4 s"),
        (np.zeros(8), 1.0, np.array([5.0]), "tau: expected 1 to 4 s"),
        (np.zeros(8), 1.0, np.array([]), "tau: expected 1 to 4 s"),
    ],
)
def test_deviation_refuses(rate: np.ndarray, fs: float, tau: np.ndarray | None, message: str) -> None:
    with pytest.raises(ValueError, match=message):
        allan_deviation(rate, fs, tau)


def test_fit_refuses_a_constant_and_a_short_curve() -> None:
    with pytest.raises(ValueError, match="curve: expected"):
        fit_allan(allan_deviation(np.ones(1000), 1.0))
    with pytest.raises(ValueError, match="curve: expected"):
        fit_allan(allan_deviation(np.random.default_rng(1).standard_normal(100), 1.0, np.array([1.0, 2.0])))
