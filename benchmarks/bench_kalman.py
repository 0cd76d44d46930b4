"""Step cost of the filters: ours beside filterpy and equivalent C, five states, two sensors, 20 kHz and 2 kHz, one process.

Promised: at least 150 times faster than filterpy; within 1.5 times of C (gcc -O3 -march=native, sizes fixed); adaptive filters at most
3 times the plain Kalman step. Run: python benchmarks/bench_kalman.py
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

from testbed.fusion import FILTERS
from testbed.fusion.belief import default_belief
from testbed.fusion.kernels import kalman_kernel
from testbed.fusion.model import FusionModel, build_model
from testbed.parts import resolve
from testbed.signals import FloatArray, random_stream

RATES = {"mems_gyro": 2000.0, "mhd_ars": 20000.0}


def readings(n: int) -> FloatArray:
    """Return white readings as rows at the fastest rate, NaN where the gyro has none."""
    Z = 1e-3 * random_stream(1, "benchmark").standard_normal((2, n))
    Z[0, np.arange(n) % 10 != 0] = np.nan
    return Z


def best(task: Callable[[], object], repeats: int) -> float:
    """Return the shortest of `repeats` runs [s]: what else the machine does only ever adds."""
    times = []
    for _ in range(repeats):
        start = time.perf_counter()
        task()
        times.append(time.perf_counter() - start)
    return min(times)


def c_filter(folder: Path) -> Callable[..., int]:
    """Compile kalman.c and return its `run`."""
    library = folder / "kalman.so"
    source = Path(__file__).with_name("kalman.c")
    flags = ["-O3", "-march=native", "-DN=5", "-DS=2", "-shared", "-fPIC"]
    subprocess.run(["gcc", *flags, "-o", str(library), str(source), "-lm"], check=True)
    function = ctypes.CDLL(str(library)).run
    array = np.ctypeslib.ndpointer(np.float64, flags="C")
    function.argtypes = [*[array] * 7, ctypes.c_long, ctypes.c_int, array]
    return function


def filterpy_run(model: FusionModel, Z: FloatArray) -> FloatArray:
    """Run filterpy's KalmanFilter over the same readings."""
    from filterpy.kalman import KalmanFilter  # type: ignore[import-untyped]

    kf = KalmanFilter(dim_x=5, dim_z=2)
    kf.x, kf.P, kf.F, kf.Q = np.zeros((5, 1)), model.P0.copy(), model.F, model.Q
    R = np.diag(model.R)
    rate = np.empty(Z.shape[1])
    for k in range(Z.shape[1]):
        if k:
            kf.predict()
        due = np.flatnonzero(np.isfinite(Z[:, k]))
        kf.dim_z = due.size
        kf.update(Z[due, k][:, None], R=R[np.ix_(due, due)], H=model.H[due])
        rate[k] = kf.x[0, 0]
    return rate


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
        kernel(np.zeros(5), model.P0.copy(), model.F, model.Q, model.H, model.R, Z, np.zeros(2, dtype=int), False, out)

    ours()
    ours_us = best(ours, 9) / n * 1e6
    with tempfile.TemporaryDirectory() as folder:
        run, out_c = c_filter(Path(folder)), np.empty((6, n))
        c_us = (
            best(lambda: run(np.zeros(5), model.P0.copy(), model.F, model.Q, model.H, model.R, Z, n, 0, out_c), 9)
            / n
            * 1e6
        )
    few = Z[:, : min(n, 5000)].copy()
    reference = filterpy_run(model, few)
    peer_us = best(lambda: filterpy_run(model, few), 3) / few.shape[1] * 1e6
    scale = np.abs(out_c[0]).max()
    print(f"largest difference, relative: C {np.abs(out[0] - out_c[0]).max() / scale:.1e}, ", end="")
    print(f"filterpy {np.abs(out[0, : reference.size] - reference).max() / scale:.1e}")
    print(f"{'ours':20s} {ours_us:9.3f} us/step")
    print(f"{'C':20s} {c_us:9.3f} us/step   ours / C        {ours_us / c_us:7.2f}   (promised: at most 1.5)")
    print(
        f"{'filterpy':20s} {peer_us:9.3f} us/step   filterpy / ours {peer_us / ours_us:7.0f}   (promised: at least 150)"
    )
    blocks = {"mems_gyro": Z[0, ::10].copy(), "mhd_ars": Z[1].copy()}
    plain_us = 0.0
    for name, target in FILTERS.items():
        cls = resolve("filter", target, FILTERS)
        stage = cls(belief, RATES, cls.Parameters())
        stage.process(blocks)
        step_us = best(functools.partial(stage.process, blocks), 5) / n * 1e6
        plain_us = plain_us or step_us
        promise = f"/ kalman        {step_us / plain_us:7.2f}   (with blocks; promised: at most 3)"
        if name == "wideband":  # a bank of 16 filters: judged by real time
            promise = f"x real time     {1e6 / RATES['mhd_ars'] / step_us:7.1f}   (with blocks; promised: at least 5)"
        print(f"{name:20s} {step_us:9.3f} us/step   {promise}")


if __name__ == "__main__":
    main()
