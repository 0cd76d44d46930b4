"""Step cost of the filters: ours beside filterpy and equivalent C, five states, two sensors, 20 kHz and 2 kHz, one
process.

Promised: at least 140 times faster than filterpy, whose H and R are worked out before; within 1.5 times of C (gcc -O3
-march=native, sizes fixed). Printed beside it: adaptive filters, meant to take at most 3 times the plain Kalman step,
and `wideband`, 5 times faster than real time. C and filterpy do the recursion without what adapts: the plain filter;
for `allan_srkf` filterpy's SquareRootKalmanFilter; for `wideband` sixteen times the filter of order 3 (seven states).
The states of slow noise (belief `identified`) may cost `kalman` at most 3 times its step without them, and leave
`wideband` at most 7 us.
Run:
python benchmarks/bench_kalman.py
"""

import argparse
import ctypes
import functools
import subprocess
import tempfile
import time
from collections.abc import Callable
from pathlib import Path

import numpy as np
from promises import Promise, conclude

from testbed.fusion import FILTERS
from testbed.fusion.belief import default_belief, load_belief
from testbed.fusion.kernels.covariance import kalman_kernel
from testbed.fusion.model import FusionModel, build_model
from testbed.fusion.transitions import even
from testbed.parts import resolve
from testbed.signals import FloatArray, random_stream

RATES = {"mems_gyro": 2000.0, "mhd_ars": 20000.0}


def readings(n: int) -> FloatArray:
    """Return white readings as rows at the fastest rate, NaN where the gyro has none."""
    Z = 1e-3 * random_stream(1, "benchmark").standard_normal((2, n))
    Z[0, np.arange(n) % 10 != 0] = np.nan
    return Z


def best(task: Callable[[], object], repeats: int) -> float:
    """Return the shortest of `repeats` runs [s of processor time]: what else the machine does only ever adds."""
    times = []
    for _ in range(repeats):
        start = time.process_time()
        task()
        times.append(time.process_time() - start)
    return min(times)


def c_filter(folder: Path, n: int = 5) -> Callable[..., int]:
    """Compile kalman.c for n states and return its `run`."""
    library = folder / f"kalman{n}.so"
    source = Path(__file__).with_name("kalman.c")
    flags = ["-O3", "-march=native", f"-DN={n}", "-DS=2", "-shared", "-fPIC"]
    subprocess.run(["gcc", *flags, "-o", str(library), str(source), "-lm"], check=True)
    function = ctypes.CDLL(str(library)).run
    array = np.ctypeslib.ndpointer(np.float64, flags="C")
    function.argtypes = [*[array] * 7, ctypes.c_long, ctypes.c_int, array]
    return function


def c_us(model: FusionModel, Z: FloatArray, folder: Path) -> tuple[float, FloatArray]:
    """Return the microseconds per step of the C filter, and its output."""
    n = len(model.F)
    run, out = c_filter(folder, n), np.empty((6, Z.shape[1]))
    given = (model.F, model.Q, model.H, model.R, Z, Z.shape[1], 0, out)
    return best(lambda: run(np.zeros(n), model.P0.copy(), *given), 9) / Z.shape[1] * 1e6, out


def filterpy_us(kind: str, model: FusionModel, Z: FloatArray) -> float:
    """Return the microseconds per step of a filter of filterpy that reads both sensors at every step."""
    from filterpy import kalman  # type: ignore[import-untyped]

    kf = getattr(kalman, kind)(dim_x=len(model.F), dim_z=2)
    kf.P, kf.F, kf.Q, kf.R, kf.H = model.P0.copy(), model.F, model.Q, np.diag(model.R), model.H

    def task() -> None:
        for k in range(Z.shape[1]):
            kf.predict()
            kf.update(Z[:, k : k + 1])

    return best(task, 2) / Z.shape[1] * 1e6


def filterpy_run(model: FusionModel, Z: FloatArray) -> tuple[FloatArray, float]:
    """Run filterpy's KalmanFilter over the same readings; return the rate, and the seconds of its steps."""
    from filterpy.kalman import KalmanFilter

    kf = KalmanFilter(dim_x=5, dim_z=2)
    kf.x, kf.P, kf.F, kf.Q = np.zeros((5, 1)), model.P0.copy(), model.F, model.Q
    R = np.diag(model.R)
    rate = np.empty(Z.shape[1])
    # What is due repeats itself: H and R of each kind of step are there before the clock starts.
    known = {}
    for k in range(Z.shape[1]):
        due = np.flatnonzero(np.isfinite(Z[:, k]))
        known[due.tobytes()] = (due, model.H[due], R[np.ix_(due, due)])
    kinds = [known[np.flatnonzero(np.isfinite(Z[:, k])).tobytes()] for k in range(Z.shape[1])]
    readings = [Z[due, k][:, None] for k, (due, _, _) in enumerate(kinds)]
    begin = time.process_time()
    for k in range(Z.shape[1]):
        if k:
            kf.predict()
        due, H, R_due = kinds[k]
        kf.dim_z = due.size
        kf.update(readings[k], R=R_due, H=H)
        rate[k] = kf.x[0, 0]
    return rate, time.process_time() - begin


def slow_noise_us(name: str, blocks: dict[str, FloatArray], n: int) -> tuple[float, float]:
    """Return the microseconds per step of a filter with states for slow noise and without; print them."""
    cls = resolve("filter", name, FILTERS)
    found = []
    for coloured in (True, False):
        stage = cls(load_belief("identified"), RATES, cls.Parameters(coloured=coloured))
        stage.process(blocks)
        found.append(best(functools.partial(stage.process, blocks), 5) / n * 1e6)
    print(f"{name:20s} with states for slow noise {found[0]:.2f} us/step, without {found[1]:.2f}")
    return found[0], found[1]


def main() -> None:
    """Print microseconds per step and the ratios."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--seconds", type=float, default=10.0, help="length of the record at 20 kHz")
    n = int(parser.parse_args().seconds * 20000)
    belief = default_belief()
    parameters = resolve("filter", "kalman", FILTERS).Parameters()
    model = build_model(belief, RATES, order=1, q=parameters.q)
    Z, out = readings(n), np.empty((6, n))
    kernel = kalman_kernel(5, 2)

    def ours() -> None:
        kernel(
            np.zeros(5),
            model.P0.copy(),
            model.F,
            model.Q,
            model.H,
            model.R,
            Z,
            even(model.F, model.Q),
            np.zeros(2, dtype=int),
            False,
            out,
        )

    ours()
    ours_us = best(ours, 9) / n * 1e6
    order_3 = build_model(belief, RATES, order=3, q=1.0)
    with tempfile.TemporaryDirectory() as folder:
        plain_c, out_c = c_us(model, Z, Path(folder))
        bank_c = 16 * c_us(order_3, Z, Path(folder))[0]
    few = Z[:, : min(n, 5000)].copy()
    reference = filterpy_run(model, few)[0]
    peer = min(filterpy_run(model, few)[1] for _ in range(3)) / few.shape[1] * 1e6
    both = np.nan_to_num(few[:, :1000])
    root_peer, bank_peer = (
        filterpy_us("SquareRootKalmanFilter", model, both),
        16 * filterpy_us("KalmanFilter", order_3, both),
    )
    scale = np.abs(out_c[0]).max()
    print(f"largest difference, relative: C {np.abs(out[0] - out_c[0]).max() / scale:.1e}, ", end="")
    print(f"filterpy {np.abs(out[0, : reference.size] - reference).max() / scale:.1e}")
    print(f"ours (kernel) {ours_us:.3f} us/step, {ours_us / plain_c:.2f} of C", end="")
    print(f", filterpy {peer / ours_us:.0f} times ours")
    print(
        f"{'filter, with blocks':20s} {'us/step':>9}{'C':>8}{'filterpy':>10}{'/ kalman':>10}{'real time':>11}   "
        "promised"
    )
    blocks = {"mems_gyro": Z[0, ::10].copy(), "mhd_ars": Z[1].copy()}
    plain_us = 0.0
    for name in FILTERS:
        cls = resolve("filter", name, FILTERS)
        # Five states are those of signal and sensors: slow noise has a line of its own below.
        plain = {"coloured": False} if "coloured" in cls.Parameters.model_fields else {}
        stage = cls(belief, RATES, cls.Parameters(**plain))
        stage.process(blocks)
        step_us = best(functools.partial(stage.process, blocks), 5) / n * 1e6
        plain_us = plain_us or step_us
        in_c, other = {"wideband": (bank_c, bank_peer), "allan_srkf": (plain_c, root_peer)}.get(name, (plain_c, peer))
        # A bank of 16 filters is judged by real time.
        promise = "5 x real time" if name == "wideband" else "3 / kalman"
        faster = 1e6 / RATES["mhd_ars"] / step_us
        print(f"{name:20s} {step_us:9.3f}{in_c:8.3f}{other:10.1f}{step_us / plain_us:10.2f}{faster:11.1f}   {promise}")
    with_states, without = slow_noise_us("kalman", blocks, n)
    bank_us, _ = slow_noise_us("wideband", blocks, n)
    conclude(
        Promise("step of kalman with states for slow noise over that without [-]", 3.0, with_states / without),
        Promise("step of wideband with states for slow noise [us]", 7.0, bank_us),
        Promise("step of kalman, 5 states, over that of filterpy [-]", 140.0, peer / ours_us, at_most=False),
        Promise("step of kalman, 5 states, over that of C with -march=native [-]", 1.5, ours_us / plain_c),
    )


if __name__ == "__main__":
    main()
