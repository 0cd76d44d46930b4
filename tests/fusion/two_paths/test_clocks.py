"""Two paths between stamps: what they make of a sine does not depend on when it is read."""

from __future__ import annotations

import numpy as np
import pytest

from testbed.fusion import FILTERS
from testbed.fusion.belief import default_belief
from testbed.parts import resolve
from testbed.signals import random_stream

FAST = 20_000.0
# Around the crossover of 2 Hz, where both paths count, and well above.
LINES_HZ = (1.0, 10.0)


def gain(name: str, slow_hz: float, freq_hz: float, jitter: float) -> complex:
    """Return what a filter of a crossover of 2 Hz makes of a sine, by least squares from 1 to 3 s; `jitter` of the fast
    clock in its steps.
    """
    random, belief = random_stream(1, "two paths"), default_belief()
    times = {"mhd_ars": np.arange(60_000) / FAST, "mems_gyro": np.arange(int(3.0 * slow_hz)) / slow_hz + 0.3 / FAST}
    times["mhd_ars"] = np.sort(times["mhd_ars"] + jitter / FAST * random.uniform(-0.5, 0.5, 60_000))
    stamps = {key: np.rint(1e9 * (one + 1.0)).astype(np.int64) for key, one in times.items()}
    turn = {key: 2j * np.pi * freq_hz * (1e-9 * one - 1.0) for key, one in stamps.items()}
    true = {key: belief[key].realisation().response(np.array([freq_hz]))[0] for key in belief}
    kind = resolve("filter", name, FILTERS)
    stage = kind(belief, {"mhd_ars": FAST, "mems_gyro": slow_hz}, kind.Parameters(crossover=2.0, gate=False))
    found = stage.process({key: (true[key] * np.exp(one)).imag for key, one in turn.items()}, stamps)
    kept = turn["mhd_ars"][20_000:]
    columns = np.stack([np.exp(kept).imag, np.exp(kept).real, np.ones(kept.size)], axis=1)
    along, across, _ = np.linalg.lstsq(columns, found.rate[20_000:], rcond=None)[0]
    return complex(along, across)


@pytest.mark.parametrize("freq_hz", LINES_HZ)
@pytest.mark.parametrize("name", ["complementary", "blending"])
def test_a_sine_comes_out_alike_by_any_clocks(name: str, freq_hz: float) -> None:
    """Half a step of the fast clock amiss turns 10 Hz by 1.6e-3 rad; a hundredth of a node, which steps are rounded to,
    by 5e-9. Readings are straight lines between samples: where these lie up to 1.4 steps apart the loop, which holds
    its correction for so long, is later by up to 0.2 steps of 10 Hz, 6e-4.
    """
    even = gain(name, 2000.0, freq_hz, 0.0)
    assert abs(gain(name, 2003.704, freq_hz, 0.0) - even) < 2e-5
    assert abs(gain(name, 2003.704, freq_hz, 0.8) - even) < 1e-3
