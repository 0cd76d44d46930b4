"""Speed and accuracy of the MHD channel in one run: `python benchmarks/bench_mhd_channel.py`.

Promised for 160 intervals (mercury, 15 mm, 0.448 T): 60 s at 20 kHz at 400 times real time or faster,
1e-6 of the closed form below 1 kHz, 1e-6 for a sine in time at 10 Hz and 1e-4 at 1 kHz.
"""

from __future__ import annotations

import time
from typing import TYPE_CHECKING

import numpy as np
from promises import Promise, conclude
from scipy.integrate import solve_ivp
from scipy.signal import lsim

from testbed.models.mhd_channel.channel import MhdChannel
from testbed.models.mhd_channel.chebyshev import even_operators
from testbed.signals import BASE_RATE_HZ

if TYPE_CHECKING:
    from collections.abc import Callable

CHANNEL = MhdChannel(fluid="mercury", height=15e-3, field=0.448)


def best_of(repeats: int, work: Callable[[], object]) -> float:
    seconds = []
    for _ in range(repeats):
        begin = time.perf_counter()
        work()
        seconds.append(time.perf_counter() - begin)
    return min(seconds)


def sine(freq: float, duration: float) -> tuple[np.ndarray, np.ndarray]:
    t = np.arange(round(duration * BASE_RATE_HZ)) / BASE_RATE_HZ
    return t, np.sin(2 * np.pi * freq * t)


def operators() -> tuple[np.ndarray, np.ndarray]:
    second, mean = even_operators(CHANNEL.nodes)
    A = CHANNEL.fluid.kinematic_viscosity / CHANNEL.height**2 * second - CHANNEL.braking_rate * np.eye(mean.size)
    return A, mean


def numpy_recursion(wall: np.ndarray) -> np.ndarray:
    """Run the same recursion, one vector operation at a time."""
    A, mean = operators()
    values, vectors = np.linalg.eig(A)
    gain = (mean @ vectors) * np.linalg.solve(vectors, np.ones(mean.size))
    E = np.exp(values / BASE_RATE_HZ)
    push = np.expm1(values / BASE_RATE_HZ) / (values / BASE_RATE_HZ)
    z = np.full(mean.size, wall[0])
    out = np.empty(wall.size)
    out[0] = gain @ z
    for k, increment in enumerate(np.diff(wall), start=1):
        z = E * z + push * increment
        out[k] = gain @ z
    return out


def scipy_lsim(wall: np.ndarray) -> np.ndarray:
    """Run SciPy's first-order hold on the same grid; x = slip + wall velocity makes the input a velocity."""
    A, mean = operators()
    system = (A, -A @ np.ones((mean.size, 1)), -mean[None, :], np.array([[mean.sum()]]))
    return np.asarray(lsim(system, wall, np.arange(wall.size) / BASE_RATE_HZ)[1])


def scipy_radau(freq: float, duration: float) -> np.ndarray:
    """Run SciPy's stiff integrator on the same grid, for a sine whose derivative it is told."""
    A, mean = operators()
    w = 2 * np.pi * freq
    t = np.arange(round(duration * BASE_RATE_HZ)) / BASE_RATE_HZ
    solution = solve_ivp(
        lambda at, u: A @ u - w * np.cos(w * at),
        (0.0, t[-1]),
        np.zeros(mean.size),
        method="Radau",
        t_eval=t,
        jac=A,
        rtol=1e-6,
        atol=1e-9,
    )
    return -(mean @ solution.y)


def speed() -> Promise:
    """Return how many times real time the channel runs, and print others beside it."""
    _, wall = sine(10.0, 60.0)
    CHANNEL.simulate(wall[:10], BASE_RATE_HZ)
    ours = 60.0 / best_of(5, lambda: CHANNEL.simulate(wall, BASE_RATE_HZ))
    print(f"60 s at 20 kHz, {CHANNEL.nodes} intervals: {ours:.0f} times real time")
    _, short = sine(10.0, 1.0)
    expected = CHANNEL.simulate(short, BASE_RATE_HZ)
    peers: dict[str, Callable[[], np.ndarray]] = {
        "NumPy recursion, same modes": lambda: numpy_recursion(short),
        "scipy.signal.lsim, same grid": lambda: scipy_lsim(short),
        "scipy solve_ivp Radau 1e-6, same grid": lambda: scipy_radau(10.0, 1.0),
    }
    for name, work in peers.items():
        difference = np.max(np.abs(work() - expected))
        peer = 1.0 / best_of(1, work)
        print(
            f"  {name}: {peer:.1f} times real time, we are {ours / peer:.0f} times faster; difference {difference:.1e}"
        )
    return Promise(f"channel of {CHANNEL.nodes} intervals over real time [-]", 1500.0, ours, at_most=False)


def secondary_flow() -> None:
    """Print what a step costs with the secondary flow."""
    _, wall = sine(10.0, 1.0)
    for nodes in (64, 160):
        channel = CHANNEL.model_copy(update={"nodes": nodes, "flow": "similarity"})
        channel.simulate(wall[:10], BASE_RATE_HZ)
        spent = best_of(5, lambda channel=channel: channel.simulate(wall, BASE_RATE_HZ)) / wall.size
        print(f"secondary flow, {nodes:3d} intervals: {1e6 * spent:.1f} us a step")


def accuracy() -> list[Promise]:
    """Return how well the grid meets the closed form, in frequency and in time."""
    found = []
    freq = np.logspace(-3, 3, 1000)
    for nodes in (64, 96, 128, 160, 256):
        grid = CHANNEL.model_copy(update={"nodes": nodes})
        error = np.max(np.abs(grid.discrete_response(freq) - grid.response(freq)))
        print(f"discretised response below 1 kHz, {nodes:3d} intervals: {error:.1e}")
        if nodes == CHANNEL.nodes:
            found.append(Promise(f"channel below 1 kHz against its closed form, {nodes} intervals [-]", 1e-6, error))
    for line, promised in ((10.0, 1e-6), (1000.0, 1e-4)):
        t, wall = sine(line, 4.0)
        got = CHANNEL.simulate(wall, BASE_RATE_HZ)[-20000:]
        expected = np.imag(CHANNEL.response(line) * np.exp(2j * np.pi * line * t[-20000:]))
        error = float(np.max(np.abs(got - expected)))
        found.append(
            Promise(f"sine of {line:g} Hz through the channel in time, against the closed form", promised, error)
        )
    return found


if __name__ == "__main__":
    secondary_flow()
    conclude(*accuracy(), speed())
