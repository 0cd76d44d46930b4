"""Cost, accuracy and memory of the turntable in one run: `python benchmarks/bench_turntable.py`.

Cost is CPU time per step beside a bare `mujoco.rollout` of the same model; accuracy is the change of the truth when the
step is halved; memory is the peak of a run of 2 s against one of 12 s, both in blocks of 1 s.
"""

from __future__ import annotations

import resource
import time
from typing import TYPE_CHECKING, Any

import mujoco
import mujoco.rollout
import numpy as np
from promises import Promise, conclude

from testbed.models.motion import CommandBlock, MotionProfile
from testbed.models.turntable.modes import coupled_modes
from testbed.models.turntable.parameters import Mounting, TurntableParameters
from testbed.models.turntable.turntable import Turntable
from testbed.signals import BASE_RATE_HZ

if TYPE_CHECKING:
    from collections.abc import Callable

MODAL_FASTER = 500.0
BLOCK = 20_000
SENSORS = {"mhd_ars": Mounting(), "mems_gyro": Mounting(position=(0.0, 0.0, 0.06))}


def profile(freq_hz: float = 10.0) -> MotionProfile:
    return MotionProfile([lambda t: np.deg2rad(1.0) * np.sin(2 * np.pi * freq_hz * t)], 0.05, BASE_RATE_HZ)


def best_of(repeats: int, work: Callable[[], object]) -> float:
    """Return the least CPU time per step [us]."""
    seconds = []
    for _ in range(repeats):
        begin = time.process_time()
        work()
        seconds.append(time.process_time() - begin)
    return 1e6 * min(seconds) / BLOCK


def bare(model: Any) -> float:
    data = mujoco.MjData(model)
    state = np.zeros(mujoco.mj_stateSize(model, mujoco.mjtState.mjSTATE_FULLPHYSICS))
    control = np.zeros((1, BLOCK, model.nu))
    return best_of(3, lambda: mujoco.rollout.rollout(model, data, state, control, skip_checks=False))


def stepped(parameters: TurntableParameters) -> tuple[float, Any]:
    table, motion = Turntable(parameters, SENSORS), profile()
    blocks = [motion.process(BLOCK) for _ in range(4)]
    table.process(blocks.pop(0))
    return best_of(3, lambda: table.process(blocks.pop(0))), table.model


def copies(block: CommandBlock) -> Callable[[], object]:
    """Return the least that a table must do: one copy for each array it hands out."""
    return lambda: [block.rate[:-1].copy() for _ in range(4 + len(SENSORS))]


def cost() -> None:
    for mode in ("servo", "digital", "ideal"):
        own, model = stepped(TurntableParameters(mode=mode))
        peer = bare(model)
        print(f"{mode:7} {own:7.3f} us/step, bare mujoco.rollout {peer:7.3f} us/step, ratio {own / peer:.2f}")
    own, _ = stepped(TurntableParameters(mode="fixed"))
    peer = best_of(20, copies(profile().process(BLOCK)))
    hour = own * 1e-6 * BASE_RATE_HZ * 3600
    print(f"fixed   {own:7.4f} us/step, copying its arrays {peer:7.4f} us/step: 1 h of truth in {hour:.1f} s")


def modal() -> Promise:
    """Return how many times real time the modes play the plant."""
    table, motion = Turntable(TurntableParameters(), SENSORS, modal=True, pose_stride=BLOCK), profile()
    blocks = [motion.process(BLOCK) for _ in range(21)]
    table.process(blocks.pop(0))
    own = best_of(20, lambda: table.process(blocks.pop(0)))
    faster = 1e6 / (own * BASE_RATE_HZ)
    print(f"modal   {own:7.4f} us/step: {faster:.0f} times real time")
    return Promise("modal plant over real time [-]", MODAL_FASTER, faster, at_most=False)


def halving() -> Promise:
    """Return the largest change of the true rate when the step is halved."""
    changes = []
    for freq_hz in (0.5, 10.0, 100.0, 1000.0):
        block = profile(freq_hz).process(10_000)
        coarse, fine = (Turntable(TurntableParameters(), SENSORS, substeps=n).process(block).rate for n in (1, 2))
        change = np.abs(coarse - fine).max() / np.abs(coarse).max()
        print(f"halving the step, {freq_hz:6g} Hz: {change:.1e} of the largest rate")
        changes.append(float(change))
    return Promise("change of the true rate when MuJoCo's step is halved, over the largest [-]", 1e-6, max(changes))


def memory() -> None:
    table, motion = Turntable(TurntableParameters(), SENSORS), profile()
    peak = {}
    for second in range(1, 13):
        table.process(motion.process(BLOCK))
        peak[second] = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024
    print(f"memory: peak {peak[2]:.0f} MB after 2 s, {peak[12]:.0f} MB after 12 s, ratio {peak[12] / peak[2]:.3f}")


def main() -> None:
    freq_hz, damping = coupled_modes(TurntableParameters())
    print("coupled modes:", ", ".join(f"{f:.4g} Hz ({z:.3f})" for f, z in zip(freq_hz, damping, strict=True)))
    memory()
    cost()
    conclude(halving(), modal())


if __name__ == "__main__":
    main()
