"""Integration steps of several holds: `python benchmarks/bench_step.py`.

For each motion and number of holds: largest change of the true rate against the base step of 50 us and against 3.125 us
(the same held references), over the largest rate, and the CPU time of the truth against that of the base step. Beside
it, the same with the plain mean of the held references, which is what the correction is for. Last, what `auto` takes
for every shipped scenario. Promised: what `auto` takes is within 1e-6 of the largest rate, and 10 Hz with 2 holds too.
"""

from __future__ import annotations

import time
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING
from unittest.mock import patch

import numpy as np
from promises import Promise, conclude

from testbed.models.motion import MotionProfile
from testbed.models.turntable import stepping
from testbed.models.turntable.parameters import Mounting, TurntableParameters
from testbed.models.turntable.turntable import Turntable
from testbed.scenario.loader import load_scenario
from testbed.scenario.step_choice import choose_step
from testbed.signals import BASE_RATE_HZ

if TYPE_CHECKING:
    from testbed.signals import FloatArray

SCENARIOS = Path(__file__).parents[1] / "scenarios"
N_TIME = 8000
PLANT = TurntableParameters(rotor_com=(1e-4, 0.0, 0.05))


def play(freq_hz: float, holds: int = 1, substeps: int = 1) -> tuple[FloatArray, float]:
    """Return the true rate [rad/s] of 1 deg/s at one frequency, and its CPU time [s]."""
    motion = MotionProfile([lambda t: np.deg2rad(1.0) * np.sin(2 * np.pi * freq_hz * t)], 0.05, BASE_RATE_HZ)
    table = Turntable(PLANT, {"mhd_ars": Mounting()}, holds=holds, substeps=substeps)
    command = motion.process(N_TIME)
    begin = time.process_time()
    rate = table.process(command, motion.peek(table.lookahead)).rate
    return rate, time.process_time() - begin


def main() -> None:
    """Print the table, what `auto` takes, and the promises."""
    correct: dict[tuple[float, int], float] = {}
    print(" motion  holds  against 50 us  against 3.125 us  plain mean  times faster")
    for freq_hz in (0.5, 4.0, 10.0, 50.0, 100.0, 300.0, 1000.0):
        base, seconds = play(freq_hz)
        fine, _ = play(freq_hz, substeps=16)
        scale = np.abs(base).max()
        print(f"{freq_hz:5g} Hz      1                {np.abs(base - fine).max() / scale:18.1e}")
        for holds in (2, 3, 4, 5):
            long, taken = play(freq_hz, holds)
            with patch.object(stepping, "lag", lambda _holds, _dt: 0.0):
                plain, _ = play(freq_hz, holds)
            errors = [np.abs(a - b).max() / scale for a, b in ((long, base), (long, fine), (plain, base))]
            correct[freq_hz, holds] = float(errors[0])
            print(
                f"              {holds} {errors[0]:14.1e} {errors[1]:17.1e} {errors[2]:11.1e} {seconds / taken:13.2f}"
            )
    worst = 0.0
    for path in sorted(SCENARIOS.glob("*.yaml")):
        scenario = load_scenario(path)
        parameters = scenario.turntable.model_copy(update={"step": "auto"})
        begin = time.process_time()
        choice = choose_step(replace(scenario, turntable=parameters))
        worst = max(worst, choice.error or 0.0)
        error = "" if choice.error is None else f", error {choice.error:.1e}"
        print(
            f"{path.stem}: auto takes {1e6 * choice.step:g} us{error}; to find it took "
            f"{time.process_time() - begin:.2f} s"
        )
    conclude(
        Promise("step: error of what auto takes, worst shipped scenario [of peak]", 1e-6, worst),
        Promise("step: error of 2 holds at 10 Hz [of peak]", 9e-8, correct[10.0, 2]),
    )


if __name__ == "__main__":
    main()
