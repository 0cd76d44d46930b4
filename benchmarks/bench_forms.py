"""Covariance forms in single precision: smallest eigenvalue, condition number, difference from double precision; the
root over an hour.

Belief `paper2` (seven states, modal realisation), P0 and R as shipped, both sensors at 20 kHz, and the nine states of
order 3. Run: python benchmarks/bench_forms.py
"""

import argparse
import time

import numpy as np
from scipy.linalg import solve_discrete_are

from testbed.fusion.belief import load_belief
from testbed.fusion.filters.kalman import Kalman, KalmanParameters
from testbed.signals import FloatArray, random_stream
from testbed.units import DEG

RATES = {"mems_gyro": 20000.0, "mhd_ars": 20000.0}
BLOCK = 100_000


def run(form: str, precision: str, n_time: int, **parameters: float) -> tuple[FloatArray, list[FloatArray]]:
    """Return the rates [rad/s] and the covariances after each tenth of the run, for white readings of 1 mrad/s."""
    stage = Kalman(load_belief("paper2"), RATES, KalmanParameters(form=form, precision=precision, **parameters))
    rng, rates, covariances = random_stream(1, "forms"), [], []
    for _ in range(10):
        white = 1e-3 * rng.standard_normal((2, n_time // 10))
        rates.append(stage.process({"mems_gyro": white[0], "mhd_ars": white[1]}).rate)
        covariances.append(stage.covariance)
    return np.concatenate(rates), covariances


def scaled(P: FloatArray, by: FloatArray) -> FloatArray:
    """Return P symmetrised, each state in units of its standard deviation in `by`."""
    std = np.sqrt(np.diag(by))
    value: FloatArray = 0.5 * (P + P.T) / np.outer(std, std)
    return value


def setting() -> None:
    """Print realisation, P0 and R of the comparison: what rounding does depends on them."""
    model = Kalman(load_belief("paper2"), RATES, KalmanParameters()).model
    print("belief paper2, modal realisation (states are parts of the reading), Van Loan, both sensors at 20 kHz")
    print(f"P0 = diag({', '.join(f'{value / DEG**2:.2g}' for value in np.diag(model.P0))}) (deg/s)^2 for order 1")
    variances = [f"{name} {value / DEG**2:.2g}" for name, value in zip(model.sensors, model.R, strict=True)]
    print(f"R = {', '.join(variances)} (deg/s)^2")


def compare(label: str, n_time: int, **parameters: float) -> None:
    """Print one line per form and precision against Joseph in double precision."""
    reference, covariances = run("joseph", "double", n_time, **parameters)
    truth = covariances[-1]
    print(
        f"{label}: condition of P {np.linalg.cond(truth):.1e}, of its correlations "
        f"{np.linalg.cond(scaled(truth, truth)):.1e}"
    )
    print(
        f"{'form':14s}{'precision':10s}{'lowest eigenvalue':>19s}{'of correlations':>17s}"
        f"{'P off':>10s}{'rate off, deg/s':>17s}"
    )
    for form in ("conventional", "joseph", "square_root"):
        for precision in ("double", "single"):
            rate, found = run(form, precision, n_time, **parameters)
            lowest = min(np.linalg.eigvalsh(0.5 * (P + P.T))[0] if np.all(np.isfinite(P)) else np.nan for P in found)
            last = scaled(found[-1], truth)
            relative = np.linalg.eigvalsh(last)[0] if np.all(np.isfinite(last)) else np.nan
            off = np.abs(last - scaled(truth, truth)).max()
            print(
                f"{form:14s}{precision:10s}{lowest:19.1e}{relative:17.1e}{off:10.1e}"
                f"{np.abs(rate - reference).max() / DEG:17.1e}"
            )


def hour(seconds: float) -> None:
    """Run the root in single precision for `seconds` of readings and print what is left of it."""
    stage = Kalman(load_belief("paper2"), RATES, KalmanParameters(form="square_root", precision="single"))
    n_block = max(1, round(seconds * 20000.0 / BLOCK))
    zero, taken = np.zeros(BLOCK), 0.0
    for _ in range(n_block):
        start = time.perf_counter()
        std = stage.process({"mems_gyro": zero, "mhd_ars": zero}).std
        taken += time.perf_counter() - start
    print(
        f"root in single precision over {n_block * BLOCK / 20000.0:g} s: {taken / (n_block * BLOCK) * 1e6:.2f} us/step"
    )
    model = stage.model
    prior = solve_discrete_are(model.F.T, model.H.T, model.Q, np.diag(model.R))
    S = model.H @ prior @ model.H.T + np.diag(model.R)
    steady = prior - prior @ model.H.T @ np.linalg.solve(S, model.H @ prior)
    print(f"std at the end {std[-1] / DEG:.6g} deg/s, of the Riccati equation {np.sqrt(steady[0, 0]) / DEG:.6g} deg/s")
    print(f"lowest eigenvalue of D D' {np.linalg.eigvalsh(stage.covariance)[0]:.1e}")


def main() -> None:
    """Print both tables and the long run."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--seconds", type=float, default=10.0, help="length of each comparison at 20 kHz")
    parser.add_argument("--long", type=float, default=3600.0, help="length of the long run of the root")
    arguments = parser.parse_args()
    n_time = round(arguments.seconds * 20000.0)
    setting()
    compare("order 1, q = 0.3 (deg/s)^2/s", n_time)
    compare("order 3, q = 1e10 (deg/s)^2/s^5", n_time, order=3)
    hour(arguments.long)


if __name__ == "__main__":
    main()
