"""What each part of paper 1's adaptive filter does, and which one breaks it: every table of docs/ablation.md from one
command.

Simulated `sx300` and `adis16505_filtered` with all their noise; belief `eq39` unless said; errors in deg/s, phase
included, medians over seeds 1, 2, ... The four signals of Table II are the truth of the simulated table, 20 s, judged
from 10 s on; the signals beyond them are ideal sines over the same times, the jump (0.5 Hz to 10 Hz at 10 s) judged
from 15 s on. Tuning uses seeds from 101 on, and 0.5 Hz only.

Run it with ``python examples/ablation.py [--seeds N]`` (default 3: about a minute and a half of processor time).
"""

from __future__ import annotations

import argparse
from typing import TYPE_CHECKING, Any

import numpy as np
import runaway_edge
from runaway_edge import DEG, RATES, readings, sine
from scipy.optimize import minimize, minimize_scalar

from testbed.fusion import estimate
from testbed.fusion.bands import load_bands
from testbed.reproduce.paper1 import SIGNALS, FusionProtocol, truth

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping, Sequence

PROTOCOL = FusionProtocol()
TUNING_SEEDS = range(101, 106)
BEYOND = ("25 Hz", "100 Hz", "0.5 Hz, 5 deg/s", "4 Hz, 10 deg/s", "jump")
SHAKF_Q, ARW_Q, LITERAL_Q = (f"{q} (deg/s)^2/s" for q in ("0.0056", "0.1", "0.3"))
LITERAL = {"q": SHAKF_Q}
BARE = LITERAL | {"bands": {}, "alpha": 0.0}
# MHD bands far below H P H', so that R stays the smaller part of the innovation's variance and S has nothing to
# inflate.
LOW_BANDS = load_bands("sx300_adis16505")
LOW_BANDS["mhd_ars"] = LOW_BANDS["mhd_ars"].model_copy(update={"R": tuple(R * DEG**2 for R in (6.5e-7, 3e-9, 3e-10))})
# What the table calls it: filter, its parameters.
FORMS: dict[str, tuple[str, dict[str, Any]]] = {
    "`kalman`": ("kalman", {}),
    "`shakf`, q 0.0056 (tuned)": ("shakf", {}),
    "`shakf`, q 0.1": ("shakf", {"q": ARW_Q}),
    "`shakf`, q 0.3": ("shakf", {"q": LITERAL_Q}),
    "`shakf`, R fixed": ("shakf", {"adapt": ()}),
    "S alone, R fixed": ("arw_shakf_literal", LITERAL | {"bands": {}, "adapt": ()}),
    "literal, q 0.0056": ("arw_shakf_literal", LITERAL),
    "literal, q 0.3": ("arw_shakf_literal", {}),
    "literal + fading N_k": ("arw_shakf_literal", LITERAL | {"memory": 1.0}),
    "literal + gyro noise in Q": ("arw_shakf_literal", LITERAL | {"use_input_noise": True}),
    "literal + clamp 3": ("arw_shakf_literal", LITERAL | {"clamp": 3.0}),
    "literal + freeze": ("arw_shakf_literal", LITERAL | {"clamp": 1.0}),
    "literal + freeze, no S": ("arw_shakf_literal", LITERAL | {"clamp": 1.0, "alpha": 0.0}),
    "literal + freeze + fading, no S": ("arw_shakf_literal", LITERAL | {"clamp": 1.0, "alpha": 0.0, "memory": 1.0}),
    "literal + differences": ("arw_shakf_literal", LITERAL | {"innovation": "difference"}),
    "literal + fading + clamp 3 + low bands": (
        "arw_shakf_literal",
        LITERAL | {"memory": 1.0, "clamp": 3.0, "bands": LOW_BANDS},
    ),
    "differences, no bands, no S": ("arw_shakf_literal", BARE | {"innovation": "difference"}),
    "`arw_shakf`, q 0.0056": ("arw_shakf", LITERAL),
    "`arw_shakf`, q 0.1": ("arw_shakf", {}),
    "`arw_shakf`, no bands, no S": ("arw_shakf", {"bands": {}, "alpha": 0.0}),
}
BELIEFS = ("eq39", "swept", "identified")
BELIEVERS = ("kalman", "shakf", "arw_shakf", "arw_shakf_literal")


def beyond(name: str) -> np.ndarray:
    """Return the rate of a signal beyond Table II [rad/s]."""
    if name == "jump":
        slow, fast = (sine(freq, 1.0, PROTOCOL.duration) for freq in (0.5, 10.0))
        return np.where(np.arange(slow.size) < slow.size // 2, slow, fast)
    freq, _, amplitude = name.partition(" Hz")
    return sine(float(freq), float(amplitude.strip(", deg/s") or 1.0), PROTOCOL.duration)


def judged_from(name: str) -> int:
    """Return the first sample that is judged."""
    return round((15.0 if name == "jump" else PROTOCOL.settle) * RATES["mhd_ars"])


def run(
    z: Mapping[str, np.ndarray], rate: np.ndarray, first: int, name: str, belief: str = "eq39", **own: Any
) -> tuple[float, float]:
    """Return rms(error) [deg/s] and rms(error)/rms(std) [-] of a filter from sample `first` on."""
    block = estimate(name, z, sample_rate_hz=RATES, belief=belief, start="rest", verdict=False, **own)
    error, std = (np.sqrt(np.mean(part[first:] ** 2)) for part in (block.rate - rate, block.std))
    return float(error) / DEG, float(error / std)


def medians(rates: Mapping[str, np.ndarray], forms: Mapping[str, Any], seeds: Sequence[int]) -> np.ndarray:
    """Return the medians of both figures of `run`, shape (n_form, n_signal, 2)."""
    found = np.empty((len(seeds), len(forms), len(rates), 2))
    for column, (signal, rate) in enumerate(rates.items()):
        for i, seed in enumerate(seeds):
            z = readings(rate, seed)
            for row, (name, own) in enumerate(forms.values()):
                found[i, row, column] = run(z, rate, judged_from(signal), name, **own)
    return np.median(found, axis=0)


def objective_at_half_a_hertz(rate: np.ndarray, seeds: Sequence[int] = TUNING_SEEDS) -> Callable[..., float]:
    """Return what tuning makes small: the median error [deg/s] of `shakf` with given parameters at 0.5 Hz."""
    records = [readings(rate, seed) for seed in seeds]

    def error(**own: Any) -> float:
        return float(np.median([run(z, rate, judged_from("0.5 Hz"), "shakf", **own)[0] for z in records]))

    return error


def tune_q(objective: Callable[..., float]) -> tuple[float, float, int]:
    """Return the q [(deg/s)^2/s] that Brent's bounded search in log10 q finds between 1e-4 and 1, its error [deg/s],
    and the runs it took.
    """
    best = minimize_scalar(
        lambda p: objective(q=10.0**p * DEG**2), bounds=(-4.0, 0.0), method="bounded", options={"xatol": 0.02}
    )
    return 10.0**best.x, best.fun, best.nfev


def tune_R(objective: Callable[..., float], **own: Any) -> tuple[dict[str, float], float, int]:
    """Return the R0 of both sensors [rad^2/s^2] that Nelder and Mead find in log10 R from the default, its error
    [deg/s], and the runs.
    """

    def sensors(p: np.ndarray) -> dict[str, float]:
        return dict(zip(("mems_gyro", "mhd_ars"), 10.0**p * DEG**2, strict=True))

    best = minimize(
        lambda p: objective(R0=sensors(p), **own),
        (-4.0, -6.2),
        method="Nelder-Mead",
        bounds=[(-8.0, 0.0)] * 2,
        options={"xatol": 0.1, "fatol": 1e-6, "initial_simplex": [[-4.0, -6.2], [-3.0, -6.2], [-4.0, -5.2]]},
    )
    return sensors(best.x), best.fun, best.nfev


def tuned_forms(rate: np.ndarray) -> dict[str, tuple[str, dict[str, Any]]]:
    """Print what tuning at 0.5 Hz gives, and return the forms with the R found."""
    objective = objective_at_half_a_hertz(rate)
    q, error, runs = tune_q(objective)
    shipped = objective()
    print(f"\nq of `shakf` tuned at 0.5 Hz: {q:.4f} (deg/s)^2/s, error {error:.5f} deg/s ({runs} runs)")
    print(f"the shipped 0.0056: error {shipped:.5f} deg/s, {100.0 * (shipped / error - 1.0):.2f} % above")
    forms = {}
    for label, own in (("`shakf`, R0 tuned", {}), ("`shakf`, R fixed and tuned", {"adapt": ()})):
        R, error, runs = tune_R(objective, **own)
        listed = ", ".join(f"{name} {value / DEG**2:.1e}" for name, value in R.items())
        print(f"{label}: {listed} (deg/s)^2, error {error:.5f} deg/s ({runs} runs)")
        forms[label] = ("shakf", {"R0": R, **own})
    return forms


def table(title: str, rows: Sequence[str], columns: Sequence[str], values: np.ndarray, digits: int) -> None:
    """Print a table in Markdown."""
    print(f"\n{title}\n\n| |{'|'.join(f' {name} ' for name in columns)}|\n|---|{'---|' * len(columns)}")
    for name, row in zip(rows, values, strict=True):
        print(f"| {name} | " + " | ".join(f"{value:.{digits}f}" for value in row) + " |")


def main() -> None:
    """Tune, run every form on every signal, print the tables and the law."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--seeds", type=int, default=3, help="seeds 1 to this (%(default)s)")
    seeds = range(1, parser.parse_args().seeds + 1)
    rates = {signal: truth(signal, PROTOCOL) for signal in SIGNALS}
    forms = FORMS | tuned_forms(rates["0.5 Hz"])
    rates |= {signal: beyond(signal) for signal in BEYOND}
    found = medians(rates, forms, seeds)
    table(f"Error [deg/s], median of {len(seeds)} seeds", list(forms), list(rates), found[..., 0], 4)
    table("rms(error) / rms(reported std), median; 1 is honest", list(forms), list(rates), found[..., 1], 2)
    believers = {f"`{name}`, `{belief}`": (name, {"belief": belief}) for name in BELIEVERS for belief in BELIEFS}
    four = {signal: rates[signal] for signal in SIGNALS}
    table("Error [deg/s] by belief", list(believers), list(four), medians(four, believers, seeds)[..., 0], 4)
    runaway_edge.main()


if __name__ == "__main__":
    main()
