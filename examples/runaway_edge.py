"""Where `shakf` begins to work: the law q_crit = (T/2) sum A^2 w^(2m) against the edge found by trying.

Single lines through the simulated `sx300` and `adis16505_filtered` with all their noise, belief `eq39`, `shakf` of
order m. The edge is bisected in log q between a sixth and six times q_crit, to 3 %; a run fails if the error over the
second half is above a tenth of the signal.

Run it with ``python examples/runaway_edge.py`` (about 20 s): it prints the table and writes
docs/images/runaway_edge.png and .csv.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from matplotlib.figure import Figure
from matplotlib.ticker import FuncFormatter

from testbed.fusion import estimate
from testbed.fusion.analysis.runaway import critical_q
from testbed.runs.atomic import write_text
from testbed.sensors import load_preset
from testbed.units import DEG

if TYPE_CHECKING:
    from collections.abc import Callable

    from matplotlib.axes import Axes

PRESETS = {"mems_gyro": "adis16505_filtered", "mhd_ars": "sx300"}
RATES = {"mems_gyro": 2_000.0, "mhd_ars": 20_000.0}
PICTURE = Path(__file__).parents[1] / "docs" / "images" / "runaway_edge.png"
SEED = 5
SPAN, ROUNDS = 0.75, 7
FAILED = 0.1
# Frequency [Hz], amplitude [deg/s], order.
OVER_FREQUENCY = [(f, 1.0, m) for m in (1, 2, 3) for f in (0.5, 1.0, 2.0, 4.0, 10.0, 25.0, 100.0, 300.0)]
OVER_AMPLITUDE = [(4.0, a, m) for m in (1, 2, 3) for a in (0.1, 0.3, 3.0, 10.0)]
COLORS = {1: "#2f9e58", 2: "#b565d8", 3: "#e2553d"}
MARKERS = {1: "o", 2: "s", 3: "^"}


@dataclass(frozen=True)
class Edge:
    """Predicted and observed edge of one case, q in (deg/s)^2/s^(2 order - 1)."""

    freq_hz: float
    amplitude: float
    order: int
    predicted: float
    observed: float

    @property
    def ratio(self) -> float:
        """Observed over predicted."""
        return self.observed / self.predicted


def sine(freq_hz: float, amplitude: float, duration: float) -> np.ndarray:
    """Return amplitude [deg/s] sin(2 pi f t) at 20 kHz, in rad/s."""
    t = np.arange(round(duration * RATES["mhd_ars"])) / RATES["mhd_ars"]
    return amplitude * DEG * np.sin(2.0 * np.pi * freq_hz * t)


def readings(rate: np.ndarray, seed: int) -> dict[str, np.ndarray]:
    """Return the readings of both sensors [rad/s]."""
    return {name: load_preset(preset).sample(rate, RATES["mhd_ars"], seed) for name, preset in PRESETS.items()}


def trial(freq_hz: float, amplitude: float, order: int) -> Callable[[float], bool]:
    """Return failed(q): whether `shakf` with that q [rad^2/s^(2m+1)] loses the line."""
    rate = sine(freq_hz, amplitude, max(8.0, 8.0 / freq_hz))
    z, half = readings(rate, SEED), rate.size // 2

    def failed(q: float) -> bool:
        error = estimate("shakf", z, sample_rate_hz=RATES, start="rest", order=order, q=q, verdict=False).rate - rate
        return bool(np.mean(error[half:] ** 2) > FAILED**2 * np.mean(rate[half:] ** 2))

    return failed


def edge(freq_hz: float, amplitude: float, order: int) -> Edge:
    """Return the edge of one case by bisection in log q."""
    predicted = critical_q([(freq_hz, amplitude * DEG)], RATES["mhd_ars"], order)
    failed = trial(freq_hz, amplitude, order)
    low, high = -SPAN, SPAN
    if not failed(predicted * 10.0**low) or failed(predicted * 10.0**high):
        return Edge(freq_hz, amplitude, order, predicted / DEG**2, float("nan"))
    for _ in range(ROUNDS):
        middle = 0.5 * (low + high)
        low, high = (middle, high) if failed(predicted * 10.0**middle) else (low, middle)
    return Edge(freq_hz, amplitude, order, predicted / DEG**2, predicted / DEG**2 * 10.0 ** (0.5 * (low + high)))


def draw(edges: list[Edge]) -> Figure:
    """Return the figure: q over frequency and over amplitude, and below each observed over predicted."""
    figure = Figure(figsize=(8.6, 5.6), dpi=200, layout="constrained")
    axes = figure.subplots(2, 2, sharex="col", sharey="row", height_ratios=(3, 1.2), width_ratios=(3, 2))
    groups = (
        (axes[:, 0], [e for e in edges if e.amplitude == 1.0], "freq_hz", "frequency [Hz]", "1 deg/s"),
        (axes[:, 1], [e for e in edges if e.freq_hz == 4.0], "amplitude", "amplitude [deg/s]", "4 Hz"),
    )
    for (upper, lower), group, key, label, title in groups:
        for order, color in COLORS.items():
            own = sorted((e for e in group if e.order == order), key=lambda e: getattr(e, key))
            x = [getattr(e, key) for e in own]
            upper.plot(x, [e.predicted for e in own], color=color, linewidth=1.4)
            upper.plot(x, [e.observed for e in own], MARKERS[order], color=color, markersize=5, label=f"order {order}")
            lower.plot(x, [e.ratio for e in own], MARKERS[order], color=color, markersize=7 - 1.5 * order, alpha=0.8)
        upper.set_title(title, loc="left", fontsize=10)
        lower.set_xlabel(label)
        _finish(upper, lower)
    axes[0, 0].set_ylabel("q at the edge [(deg/s)$^2$/s$^{2m-1}$]")
    axes[1, 0].set_ylabel("observed / predicted")
    axes[0, 0].text(
        0.98, 0.05, "below: R runs away\nabove: R settles", transform=axes[0, 0].transAxes, ha="right", fontsize=8.5
    )
    axes[0, 0].legend(
        frameon=False, fontsize=8.5, title="marks: observed\nlines: $(T/2) A^2 w^{2m}$", title_fontsize=8.5
    )
    return figure


def _finish(upper: Axes, lower: Axes) -> None:
    upper.set(xscale="log", yscale="log")
    lower.set(ylim=(0.75, 1.1))
    lower.axhline(1.0, color="#7d8894", linewidth=0.9)
    lower.xaxis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))
    for axes in (upper, lower):
        axes.grid(visible=True, color="#e3e6ea", linewidth=0.6)
        axes.spines[["top", "right"]].set_visible(False)


def main() -> None:
    """Print the table of edges, draw them and write them."""
    cases = sorted(set(OVER_FREQUENCY + OVER_AMPLITUDE), key=lambda case: (case[2], case[0], case[1]))
    edges = [edge(*case) for case in cases]
    print("\nEdge of q of `shakf` in (deg/s)^2/s^(2m-1), by the law and by bisection:\n")
    print("| order m | Hz | deg/s | q_crit | observed | ratio |\n|---|---|---|---|---|---|")
    for e in edges:
        print(f"| {e.order} | {e.freq_hz:g} | {e.amplitude:g} | {e.predicted:.3g} | {e.observed:.3g} | {e.ratio:.2f} |")
    rows = [f"{e.order},{e.freq_hz:g},{e.amplitude:g},{e.predicted:.6g},{e.observed:.6g},{e.ratio:.4f}" for e in edges]
    write_text(
        PICTURE.with_suffix(".csv"),
        "order,frequency_hz,amplitude_deg_s,q_crit,q_observed,ratio\n" + "\n".join(rows) + "\n",
    )
    draw(edges).savefig(PICTURE)
    ratios = [e.ratio for e in edges]
    print(
        f"\nobserved over predicted: {min(ratios):.2f} to {max(ratios):.2f} in {len(edges)} cases; "
        f"drawn in {PICTURE.name}"
    )


if __name__ == "__main__":
    main()
