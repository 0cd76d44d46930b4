"""Gains that settle: the Kalman filter at less cost, through gaps, and what it costs away from its signal."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
import pytest

from testbed.fusion.analysis.even import most_even
from testbed.fusion.analysis.optimum import optimum, settled_filters
from testbed.fusion.belief import SensorBelief, load_belief
from testbed.fusion.filters.kalman import Kalman, KalmanParameters
from testbed.fusion.filters.steady_state import SteadyState, SteadyStateParameters
from testbed.fusion.model import build_model
from testbed.signals import LinearFilter

if TYPE_CHECKING:
    from testbed.fusion import EstimateBlock
    from testbed.signals import FloatArray

DEG = np.pi / 180.0
RATES = {"mems_gyro": 2000.0, "mhd_ars": 20000.0}
# The gyro as good as the MHD sensor: no slow mode, so that both filters settle in a second.
QUICK = {
    "mhd_ars": load_belief("eq39")["mhd_ars"],
    "mems_gyro": SensorBelief(numerator=(600.0,), denominator=(1.0, 600.0), input_noise=2e-8, output_noise=2e-8),
}


# Three looks at the gains, a second apart: the first has nothing to compare with.
SETTLED = 70_000


def quick_readings(n: int) -> dict[str, FloatArray]:
    rng = np.random.default_rng(3)
    return {"mems_gyro": 1e-4 * rng.standard_normal(n // 10), "mhd_ars": 1e-4 * rng.standard_normal(n)}


def both(readings: dict[str, FloatArray]) -> tuple[EstimateBlock, EstimateBlock]:
    """Return the settling filter and the Kalman filter of its model."""
    best = optimum(QUICK, RATES, [(10.0, DEG)])
    kalman = Kalman(QUICK, RATES, KalmanParameters(order=best.order, q=best.q, coloured=False))
    return SteadyState(QUICK, RATES, SteadyStateParameters(frequency=10.0, coloured=False)).process(
        readings
    ), kalman.process(readings)


@pytest.mark.oracle
def test_it_is_the_kalman_filter_from_the_start_on() -> None:
    fixed, kalman = both(quick_readings(SETTLED + 2_000))
    n = 40_000
    assert np.array_equal(fixed.rate[:n], kalman.rate[:n])
    assert np.array_equal(fixed.std[:n], kalman.std[:n])
    # Then with gains that change by less than 1e-3 a second, here by e^-30.
    assert not np.array_equal(fixed.rate, kalman.rate)
    assert np.unique(fixed.std[SETTLED:]).size == 10
    np.testing.assert_allclose(fixed.rate, kalman.rate, rtol=0.0, atol=1e-7 * np.max(np.abs(kalman.rate)))
    np.testing.assert_allclose(fixed.std, kalman.std, rtol=1e-5)
    for key in ("innovation_variance_mhd_ars", "innovation_variance_mems_gyro"):
        np.testing.assert_allclose(fixed.diagnostics[key], kalman.diagnostics[key], rtol=1e-5)


@pytest.mark.oracle
@pytest.mark.parametrize(
    ("sensor", "lost"),
    [("mhd_ars", slice(70_005, 72_003)), ("mems_gyro", slice(7_001, 7_030)), ("mhd_ars", slice(70_009, 75_000, 2))],
)
def test_a_gap_ends_the_settled_state_and_it_is_the_kalman_filter_again(sensor: str, lost: slice) -> None:
    readings = quick_readings(SETTLED + 70_000)
    readings[sensor][lost] = np.nan
    fixed, kalman = both(readings)
    np.testing.assert_allclose(fixed.rate, kalman.rate, rtol=0.0, atol=1e-6 * np.max(np.abs(kalman.rate)))
    np.testing.assert_allclose(fixed.std, kalman.std, rtol=1e-5)
    assert np.unique(fixed.std[-2_000:]).size == 10


def test_the_cycle_of_gains_follows_the_clock_and_not_the_first_reading() -> None:
    """The gyro is due at every tenth step from t = 0, whether or not readings came before: claims repeat with that
    phase.
    """
    n = SETTLED + 20_000
    readings = {"mems_gyro": np.zeros(n // 10), "mhd_ars": np.zeros(n)}
    late = {key: values.copy() for key, values in readings.items()}
    late["mhd_ars"][:13], late["mems_gyro"][:2] = np.nan, np.nan
    whole, begun = (
        SteadyState(QUICK, RATES, SteadyStateParameters(frequency=10.0, coloured=False, gate=False)).process(one)
        for one in (readings, late)
    )
    assert np.unique(whole.std[-100:]).size == 10
    np.testing.assert_allclose(begun.std[-100:], whole.std[-100:], rtol=1e-6)


def test_it_is_best_at_the_signal_it_was_made_for(reference: Any) -> None:
    belief = load_belief("eq39")
    error = {}
    rate = reference.sines((100.0, 1.0), duration=2.0)
    for frequency in (1.0, 100.0):
        p = SteadyStateParameters(frequency=frequency, start="rest")
        found = SteadyState(belief, RATES, p).process(reference.readings(rate, 8)).rate - rate
        error[frequency] = np.sqrt(np.mean(found[20_000:] ** 2)) / DEG
    assert error[100.0] < 0.01
    assert error[1.0] > 10.0 * error[100.0]


def test_amplitude_opens_the_filter(reference: Any) -> None:
    readings = reference.readings(reference.sines((10.0, 1.0), duration=0.2), 8)
    belief = load_belief("eq39")
    small, large = (
        SteadyState(belief, RATES, SteadyStateParameters(frequency=10.0, amplitude=a * DEG)).process(readings)
        for a in (0.01, 10.0)
    )
    assert large.std[-1] > small.std[-1]


@pytest.mark.oracle
def test_without_a_frequency_no_sine_costs_much_more_than_its_optimum() -> None:
    """The largest ratio over 0.1 to 500 Hz, by the optima of single sines; any one sine's own design has a larger."""
    belief = load_belief("eq39")
    even = most_even(belief, RATES, DEG)
    frequencies = (0.1, 1.0, 10.0, 100.0, 500.0)

    def ratios(order: int, q: float) -> list[float]:
        filters = settled_filters(belief, RATES, order=order, q=np.array([q]))
        truth = np.array([belief[name].realisation().response(np.array(frequencies)) for name in RATES])
        lag = filters.line_error(np.array(frequencies), truth)[0] ** 2 * DEG**2 / 2.0
        errors = np.sqrt(filters.noise_variance().sum() + lag)
        return [e / optimum(belief, RATES, [(f, DEG)]).rmse for e, f in zip(errors, frequencies, strict=True)]

    assert max(ratios(even.order, even.q)) <= even.largest_ratio * (1.0 + 1e-9)
    for frequency in (0.1, 10.0, 500.0):
        own = optimum(belief, RATES, [(frequency, DEG)])
        assert max(ratios(own.order, own.q)) >= max(ratios(even.order, even.q))


def test_in_a_gap_q_is_the_design_of_the_sensors_that_are_left() -> None:
    """Bit i of the number of a set is sensor i: of the gyro alone its own even design, of the MHD sensor alone, which
    sees no constant and never settles, that of both.
    """
    belief = load_belief("eq39")
    found = SteadyState(belief, RATES, SteadyStateParameters(coloured=False))
    both = most_even(belief, RATES, DEG)
    alone = most_even(belief, {"mems_gyro": RATES["mems_gyro"]}, DEG, orders=(both.order,))
    assert alone.q < both.q
    gyro = list(RATES).index("mems_gyro")
    for number, q in ((1 << gyro, alone.q), (3 - (1 << gyro), both.q), (3, both.q)):
        wanted = build_model(belief, RATES, order=both.order, q=q).Q
        np.testing.assert_allclose(found._Q[number], wanted, rtol=1e-12)


def test_without_any_sensor_the_rate_departs_by_three_amplitudes_at_most() -> None:
    """The claim ends at (3 A)^2 beside that of the last reading; the estimate goes no further than two claims."""
    t = np.arange(40_000) / RATES["mhd_ars"]
    rate = DEG * np.sin(6.0 * np.pi * t)
    belief = load_belief("eq39")
    readings = {
        name: np.asarray(
            LinearFilter(list(belief[name].numerator), list(belief[name].denominator), RATES["mhd_ars"]).process(rate)
        )[:: round(RATES["mhd_ars"] / RATES[name])]
        for name in RATES
    }
    lost = {name: np.where(np.arange(z.size) < z.size // 2, z, np.nan) for name, z in readings.items()}
    block = SteadyState(belief, RATES, SteadyStateParameters(coloured=False, gate=False)).process(lost)
    most = np.sqrt(block.std[19_999] ** 2 + (3.0 * DEG) ** 2)
    assert block.std.max() <= max(most, block.std[:19_999].max()) * (1.0 + 1e-9)
    assert block.std[-1] == pytest.approx(most, rel=1e-3)
    assert np.max(np.abs(block.rate[20_000:] - block.rate[19_999])) < 2.0 * most
