"""How near complementary filters come to the two-sensor bound, frequency by frequency, for every pair that ships.

The one-pole filter of least noise, the shaped one of two poles, and one of three, which `complementary` does without;
for the default pair also the filter of any order that H-infinity synthesis finds for the same norm (Dehaeze, Verma,
Collette 2019), the least excess that there is. The synthesis, `control.hinfsyn`, needs slycot, which is GPL-2 and in no
extra of this project; without it the line that installs it is printed.
Run: `python examples/shaped_blends.py [--all] [FIGURE.png]`
"""

from __future__ import annotations

import argparse
import importlib.util
import time
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from matplotlib.figure import Figure
from scipy.optimize import least_squares, minimize

from testbed.fusion.two_paths.design import best_crossover, input_psd
from testbed.fusion.two_paths.loop import butterworth_loop, shaped_loop
from testbed.parts import preset, preset_names
from testbed.scenario.beliefs import belief_of
from testbed.sensors import load_preset

if TYPE_CHECKING:
    from testbed.fusion.belief import SensorBelief
    from testbed.signals import FloatArray

PICTURE = Path(__file__).parents[1] / "docs" / "images" / "shaped_blends.png"
INSTALL = "H-infinity synthesis needs slycot (GPL-2, in no extra of this project): python -m pip install slycot"
FREQ = np.geomspace(1e-3, 1e3, 601)
# The synthesis counts time by the handover, near 10 mHz, and its weights, of so many poles, are fitted up to here [Hz].
UNIT, FITTED_TO_HZ, WEIGHT_POLES = 0.06, 1.0, 3


class Pair(NamedTuple):
    """Two beliefs and their input-referred densities over `FREQ` [rad^2/s], the one better at low frequency first."""

    name: str
    slow: SensorBelief
    fast: SensorBelief
    of_slow: FloatArray
    of_fast: FloatArray

    @property
    def bound(self) -> FloatArray:
        """Density that no linear filter of both falls below [rad^2/s]."""
        return 1.0 / (1.0 / self.of_slow + 1.0 / self.of_fast)

    def density(self, L: FloatArray) -> FloatArray:
        """Fused density of a share L of the slow sensor [rad^2/s]."""
        return np.abs(L) ** 2 * self.of_slow + np.abs(1.0 - L) ** 2 * self.of_fast

    def excess(self, L: FloatArray) -> FloatArray:
        """How far that is above the bound [dB]."""
        return 10.0 * np.log10(self.density(L) / self.bound)


def pair(slow: str, fast: str) -> Pair:
    """Return the pair of two presets, each believed exactly."""
    beliefs = [belief_of(name, exact=True) for name in (slow, fast)]
    return Pair(f"{fast} + {slow}", *beliefs, *(input_psd(one)(FREQ) for one in beliefs))


def shipped() -> list[tuple[str, str]]:
    """Return the names of all pairs of a gyro and an MHD ARS that ship."""
    kinds = {name: preset("testbed.sensors", name)["type"] for name in preset_names("testbed.sensors")}
    fast = [name for name, kind in kinds.items() if kind == "mhd_ars"]
    slow = [name for name in kinds if abs(load_preset(name).response(np.array([1e-6]))[0]) > 0.5]
    return [(a, b) for b in fast for a in slow]


def rms(density: FloatArray) -> float:
    """Return the root mean square of a density over `FREQ` [deg/s]."""
    return float(np.degrees(np.sqrt(2.0 * np.trapezoid(density * FREQ, np.log(FREQ)))))


def share(fraction: tuple[FloatArray, FloatArray]) -> FloatArray:
    """Return L over `FREQ`."""
    s = 2j * np.pi * FREQ
    return np.polyval(fraction[0], s) / np.polyval(fraction[1], s)


def one_pole(which: Pair) -> FloatArray:
    """Return L of the one pole that leaves the least noise."""
    return share(butterworth_loop(1, best_crossover(which.slow, which.fast, 1)).low_pass())


def shaped(which: Pair) -> FloatArray:
    """Return L of the two poles that `complementary` has."""
    return share(shaped_loop(input_psd(which.slow), input_psd(which.fast)).low_pass())


def three_poles(which: Pair) -> FloatArray:
    """Return L = (k s^2 + q s + r) / (s^3 + (k + a) s^2 + (q + b) s + r) with the least excess anywhere.

    From the two poles, with a pole on a zero below, at and above the handover; the largest excess has edges, on which a
    simplex collapses, so it starts anew.
    """
    s = 2j * np.pi * FREQ

    def shared(logs: FloatArray) -> FloatArray:
        k, q, r, a, b = np.exp(logs)
        above = np.polyval([k, q, r], s)
        return above / (s * (s * (s + a) + b) + above)

    def worst(logs: FloatArray) -> float:
        k, q, r, a, b = np.exp(logs)
        stable = (k + a) * (q + b) > r
        return float(which.excess(shared(logs)).max()) if stable else 100.0

    loop = shaped_loop(input_psd(which.slow), input_psd(which.fast))
    found = []
    for far in (0.2, 1.0, 5.0):
        p, k, q, z = far * loop.crossover, loop.gain, max(loop.slope_gain, 1e-12), max(loop.leak, 1e-9)
        logs = np.log([k, q + z * k + p * k, p * (z * k + q), z + p, z * p])
        for _ in range(4):
            ended = minimize(worst, logs, method="Nelder-Mead", options={"maxiter": 1500, "maxfev": 1500})
            logs = ended.x
        found.append((ended.fun, logs))
    return shared(min(found, key=lambda one: one[0])[1])


def weight(magnitude: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray]:
    """Return A, B, C, D of a stable, minimum-phase fit of a magnitude, in the log and up to `FITTED_TO_HZ`, by modes.

    Beyond it stays what it is there: the norm with it is no larger, so what it states is still the least there is.
    """
    seen = FREQ <= FITTED_TO_HZ
    s, wanted = 2j * np.pi * FREQ[seen] / UNIT, np.log(magnitude[seen])

    def misfit(logs: FloatArray) -> FloatArray:
        zeros, poles = np.exp(logs[:-1].reshape(2, -1))
        return np.log(np.abs(s[:, None] + zeros) / np.abs(s[:, None] + poles)).sum(1) + logs[-1] - wanted

    lowest, highest = np.log(2 * np.pi * np.array([0.2 * FREQ[0], 5.0 * FITTED_TO_HZ]) / UNIT)
    apart = np.linspace(lowest + 2.0, highest - 1.6, WEIGHT_POLES)
    edges = [[end] * (2 * WEIGHT_POLES) + [gain] for end, gain in ((lowest, -10.0), (highest, 20.0))]
    logs = least_squares(misfit, np.concatenate([apart + 0.3, apart - 0.3, wanted[-1:]]), bounds=edges).x
    zeros, poles = np.exp(logs[:-1].reshape(2, -1))
    others = poles[None, :] - poles[:, None] + np.eye(poles.size)
    residues = np.exp(logs[-1]) * np.prod(zeros[None, :] - poles[:, None], axis=1) / np.prod(others, axis=1)
    root = np.sqrt(np.abs(residues))
    return -np.diag(poles), root[:, None], (np.sign(residues) * root)[None, :], np.exp(logs[-1:])[None, :]


def synthesised(which: Pair) -> tuple[FloatArray, float]:
    """Return L of any order that H-infinity synthesis finds, and the norm that it states [dB].

    Weights are the roots of both densities over the bound: the norm of [W1 L; W2 (1 - L)] is the excess itself.
    """
    import control

    weights = [weight(np.sqrt(density / which.bound)) for density in (which.of_slow, which.of_fast)]
    first, second = (control.ss(*matrices) for matrices in weights)
    n, m = first.nstates, second.nstates
    A = np.block([[first.A, np.zeros((n, m))], [np.zeros((m, n)), second.A]])
    B = np.block([[np.zeros_like(first.B), first.B], [second.B, -second.B]])
    C = np.block([[first.C, np.zeros((1, m))], [np.zeros((1, n)), second.C], [np.zeros((1, n + m))]])
    D = np.array([[0.0, first.D[0, 0]], [second.D[0, 0], -second.D[0, 0]], [1.0, 0.0]])
    found, _, gamma, _ = control.hinfsyn(control.ss(A, B, C, D), 1, 1)
    return found(2j * np.pi * FREQ / UNIT), float(20.0 * np.log10(gamma))


def row(which: Pair) -> tuple[str, dict[str, FloatArray]]:
    """Return a row of the table, and the excess of each design over `FREQ` [dB]."""
    begin = time.process_time()
    two = shaped(which)
    seconds = time.process_time() - begin
    designs = {"one pole": one_pole(which), "shaped, two poles": two}
    words = [f"{which.name:36s}"]
    words += [
        f"{which.excess(L).max():6.2f} dB {1e3 * rms(which.density(L)):7.3f}e-3"
        for L in (*designs.values(), three_poles(which))
    ]
    words.append(f"{1e3 * rms(which.bound):7.3f}e-3  {seconds:5.2f} s")
    return "  ".join(words), {name: which.excess(L) for name, L in designs.items()}


def draw(which: Pair, designs: dict[str, FloatArray]) -> Figure:
    """Return the excess of each design over frequency."""
    figure = Figure(figsize=(7.0, 3.4), dpi=200, layout="constrained")
    axes = figure.subplots()
    for (name, excess), color in zip(designs.items(), ("#8fb8de", "#c2552d", "#3b3b3b"), strict=False):
        axes.semilogx(FREQ, excess, color=color, linewidth=1.6, label=name)
    axes.set_title(which.name, loc="left", fontsize=10)
    axes.set_xlabel("frequency [Hz]")
    axes.set_ylabel("above the two-sensor bound [dB]")
    axes.set_xlim(FREQ[0], FREQ[-1])
    axes.set_ylim(0.0)
    axes.grid(visible=True, color="#d5d9de", linewidth=0.7)
    axes.spines[["top", "right"]].set_visible(False)
    axes.legend(frameon=False, fontsize=8.5)
    return figure


def main() -> None:
    """Print the table and draw the default pair."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--all", action="store_true", help="every pair that ships, not the default one alone")
    parser.add_argument("figure", nargs="?", type=Path, default=PICTURE, help="where to write it (%(default)s)")
    asked = parser.parse_args()
    print(
        "largest excess over the bound and rms in deg/s, 1 mHz-1 kHz: one pole; two, shaped; three; the bound; time of "
        "the two"
    )
    default = pair("adis16505_filtered", "sx300")
    line, designs = row(default)
    print(line)
    if importlib.util.find_spec("slycot"):
        L, norm = synthesised(default)
        designs["H-infinity synthesis"] = default.excess(L)
        print(f"H-infinity synthesis: {default.excess(L).max():.2f} dB {1e3 * rms(default.density(L)):.3f}e-3", end="")
        print(f"; of any order none has less than {norm:.2f} dB")
    else:
        print(INSTALL)
    for names in shipped() if asked.all else []:
        print(row(pair(*names))[0], flush=True)
    asked.figure.parent.mkdir(parents=True, exist_ok=True)
    draw(default, designs).savefig(asked.figure)
    print(f"wrote {asked.figure}")


if __name__ == "__main__":
    main()
