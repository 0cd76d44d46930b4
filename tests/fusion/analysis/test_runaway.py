"""The law of the runaway of R: its closed form, what R settles at above it, and the edge itself."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from testbed.fusion import estimate
from testbed.fusion.analysis.runaway import critical_q
from testbed.signals import random_stream

DEG = np.pi / 180.0


@pytest.mark.parametrize("order", [1, 2, 3])
def test_critical_q_sums_the_lines(order: int) -> None:
    lines = [(0.5, 1.0), (10.0, 0.18)]
    wanted = 25e-6 * (np.pi ** (2 * order) + 0.18**2 * (20.0 * np.pi) ** (2 * order))
    found = critical_q([(f, a * DEG) for f, a in lines], 20_000.0, order) / DEG**2
    assert found == pytest.approx(wanted, rel=1e-12, abs=0.0)


@pytest.mark.oracle
@pytest.mark.parametrize("above", [1.5, 3.0])
def test_above_the_edge_R_settles_where_the_closed_form_has_it(above: float) -> None:
    """One sensor without dynamics, order 1: (q - q_crit) T = 2 R_true K^2/(2 - K), and P^- = q T / K makes R = q T (1 -
    K)/K^2.
    """
    fs, freq, noise = 20_000.0, 10.0, 2e-2 * DEG
    t = np.arange(400_000) / fs
    z = DEG * np.sin(2.0 * np.pi * freq * t) + noise * random_stream(2, "white").standard_normal(t.size)
    # Poles fifty times faster than the sampling are no dynamics; the second sensor is silent (the size of (39) is
    # compiled anyway).
    still = {"numerator": [2e12], "denominator": [1.0, 3e6, 2e12], "output_noise": 1e-7}
    belief, rates = {"one": still, "silent": still}, {"one": fs, "silent": fs}
    q_crit = critical_q([(freq, DEG)], fs)
    q = above * q_crit
    excess = (q - q_crit) / fs / (2.0 * noise**2)
    K = 0.5 * (np.sqrt(excess**2 + 8.0 * excess) - excess)
    readings = {"one": z, "silent": np.full(t.size, np.nan)}
    chosen = {"q": q, "beta": 0.9999, "R0": {"one": noise**2}}
    block = estimate("shakf", readings, sample_rate_hz=rates, belief=belief, verdict=False, **chosen)
    # R is a mean of e^2 over n = 2e5 readings: sqrt(2/n) = 0.3 %, times up to three by the feedback through the gain,
    # three sigma; the lag's (w T / K)^2 is 0.2 %.
    settled = block.diagnostics["R_one"][t.size // 2 :].mean()
    assert settled == pytest.approx(q / fs * (1.0 - K) / K**2, rel=0.03, abs=0.0)


@pytest.mark.parametrize(
    ("freq_hz", "amplitude", "order"),
    [(10.0, 1.0, 1), (25.0, 0.3, 1), (4.0, 3.0, 1), (10.0, 1.0, 2), (25.0, 1.0, 3), (100.0, 1.0, 2)],
)
def test_the_edge_lies_at_the_critical_q(reference: Any, freq_hz: float, amplitude: float, order: int) -> None:
    """Lost means an error above a tenth of the line over the last 4 s of 8 s.

    Below q_crit R grows from its true 6.5e-7 as exp((q_crit/q - 1) t/tau), tau = 1000 readings, and the line is lost at
    R = 0.01 A^2/2; to get there in 4 s takes q_crit/q = 1 + ln(R_lost/R_true)/80 = 1.08 to 1.14: lost for sure at 1.25,
    or at 1.4 for 4 Hz, where R also swings within the period. Above, R settles with a lag below a tenth from q/q_crit =
    1 + 200 R_true/A^2 < 1.002 on: kept at 1.1.
    """
    rate = reference.sines((freq_hz, amplitude), duration=8.0)
    readings, half = reference.readings(rate, 6), rate.size // 2
    q_crit = critical_q([(freq_hz, amplitude * DEG)], 20_000.0, order)

    def error(q: float) -> float:
        block = estimate("shakf", readings, sample_rate_hz=reference.rates, order=order, q=q)
        return float(np.sqrt(np.mean((block.rate - rate)[half:] ** 2) / np.mean(rate[half:] ** 2)))

    assert error(q_crit / (1.4 if freq_hz < 10.0 else 1.25)) > 0.1
    assert error(1.1 * q_crit) < 0.1
