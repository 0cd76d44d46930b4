"""The filters' equations once more, with matrices and Python loops, and readings of the linear sensors of equation
(39).
"""

from __future__ import annotations

import math
from collections import deque
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest

from testbed.signals import LinearFilter, random_stream

if TYPE_CHECKING:
    from collections.abc import Callable

    from testbed.fusion.model import FusionModel
    from testbed.signals import FloatArray

DEG = math.pi / 180.0
RATES = {"mems_gyro": 2000.0, "mhd_ars": 20000.0}


@dataclass
class LiteralSensor:
    """What (14)-(38) need to know about one sensor."""

    R: float
    fit_noise: bool = False
    fit_offset: bool = False
    beta: float = 0.999
    floor: float = 0.0
    difference: bool = False
    alpha: float = 0.0
    window: int = 1
    memory_readings: float = math.inf
    thresholds: tuple[float, float] | None = None
    levels: tuple[float, float, float] = (0.0, 0.0, 0.0)
    wait: int = 1
    clamp: float = math.inf
    r: float = 0.0
    k: int = 0
    z_before: float = math.nan
    e_before: float = math.nan
    N: float = 0.0
    pairs: int = 0
    band: int = -1
    squares: deque[float] = field(default_factory=deque)


def literal_bands(s: LiteralSensor, z: float) -> None:
    """Apply (28)-(30) and the rule of the bands."""
    if np.isfinite(s.z_before):
        s.pairs += 1
        g = max(1.0 / s.pairs, 1.0 / s.memory_readings)
        s.N = (1.0 - g) * s.N + g * (z - s.z_before) ** 2 / 2.0
    if s.thresholds is not None and s.pairs >= s.wait:
        band = int(np.searchsorted(s.thresholds, s.N, side="right"))
        if band != s.band:
            s.band, s.R = band, s.levels[band]


def literal_learning(s: LiteralSensor, e: float, target: float) -> None:
    """Apply (16) and (17), R within its bounds."""
    d = (1.0 - s.beta) / (1.0 - s.beta ** (s.k + 1))
    if s.fit_offset:
        s.r = s.r + d * e
    if s.fit_noise and np.isfinite(target):
        lowest, highest = s.floor, math.inf
        if s.band >= 0:
            level = s.levels[s.band]
            lowest, highest = min(level, max(s.floor, level / s.clamp)), level * s.clamp
        s.R = min(max((1.0 - d) * s.R + d * target, lowest), highest)
    if not s.difference or np.isfinite(target):
        s.k += 1


def literal_filter(
    model: FusionModel,
    Z: FloatArray,
    sensors: list[LiteralSensor],
    adapt_Q: list[int] | None = None,
    beta: float = 0.999,
) -> dict[str, FloatArray]:
    """Run (8)-(17) and (28)-(38) over rows of readings; NaN none due, infinite missing. Joint update, full matrices."""
    n, F, H = model.F.shape[0], model.F, model.H
    Q = np.diag(np.diag(model.Q)) if adapt_Q else model.Q.copy()
    x, P = np.zeros(n), model.P0.copy()
    eye = np.eye(n)
    names = (
        "rate",
        "std",
        "Q_rate",
        *(f"{a}{i}" for a in ("e", "C", "R", "N", "band", "S") for i in range(len(sensors))),
    )
    out = {name: np.full(Z.shape[1], np.nan) for name in names}
    started, k_Q = False, 0
    for k in range(Z.shape[1]):
        predicted = started
        if predicted:
            x, P = F @ x, F @ P @ F.T + Q  # (8), (9)
        x_prior, P_prior = x, P
        due = [i for i in range(len(sensors)) if np.isfinite(Z[i, k])]
        e, tilde, target = {}, {}, {}
        for i in due:
            s, z = sensors[i], Z[i, k]
            literal_bands(s, z)
            e[i] = z - H[i] @ x_prior - s.r  # (11)
            hph = H[i] @ P_prior @ H[i]
            square = (e[i] - s.e_before) ** 2 / 2.0 if s.difference else e[i] ** 2
            C, S = hph + s.R, 1.0  # (33)
            if np.isfinite(square) and s.alpha > 0.0:
                s.squares.append(square)
                S = max(1.0, s.alpha * float(np.mean(list(s.squares)[-s.window :])) / C)  # (34), (36)
            tilde[i], target[i] = S * s.R, square - hph
            for a, value in (("e", e[i]), ("C", C), ("R", s.R), ("N", s.N), ("band", s.band), ("S", S)):
                out[f"{a}{i}"][k] = value
        if due:
            started = True
            h, R = H[due], np.diag([tilde[i] for i in due])
            K = P @ h.T @ np.linalg.inv(h @ P @ h.T + R)  # (10)
            A = eye - K @ h
            x, P = x + K @ np.array([e[i] for i in due]), A @ P @ A.T + K @ R @ K.T
        for i in due:
            s = sensors[i]
            literal_learning(s, e[i], target[i])
            s.e_before, s.z_before = e[i], Z[i, k]
        for i, s in enumerate(sensors):
            if np.isinf(Z[i, k]):
                s.e_before = s.z_before = math.nan
        if adapt_Q and due and predicted:
            d = (1.0 - beta) / (1.0 - beta ** (k_Q + 1))
            k_Q += 1
            new = (1.0 - d) * Q + d * (np.outer(x - x_prior, x - x_prior) + P - (P_prior - Q))  # (15) with + P
            for j in adapt_Q:
                Q[j, j] = max(0.0, new[j, j])
        out["rate"][k], out["std"][k], out["Q_rate"][k] = x[0], math.sqrt(P[0, 0]), Q[0, 0]
    return out


def linear_sensors(rate: FloatArray, seed: int, *, noise: bool = True) -> dict[str, FloatArray]:
    """Return the readings of both sensors of (39) for a true rate at 20 kHz, with the presets' noise and words."""
    n, fs = rate.size, RATES["mhd_ars"]
    gyro_noise = 0.15 / 60.0 * DEG * math.sqrt(fs) * random_stream(seed, "gyro").standard_normal(n)
    mhd_noise = 1e-7 * math.sqrt(fs) * random_stream(seed, "mhd").standard_normal(n)
    gyro = LinearFilter([154.537, 15.626], [5.2175, 148.0, 15.444], fs).process(rate + noise * gyro_noise)[::10]
    mhd = LinearFilter([2200.0, 0.0], [0.255, 2178.0, 33900.0], fs).process(rate) + noise * mhd_noise
    step = 2.3e-4 * DEG
    return {"mems_gyro": gyro, "mhd_ars": np.round(mhd / step) * step if noise else mhd}


def sines(*lines: tuple[float, float], duration: float = 20.0) -> FloatArray:
    """Return the sum of (frequency [Hz], amplitude [deg/s]) at 20 kHz [rad/s]."""
    t = np.arange(round(duration * RATES["mhd_ars"])) / RATES["mhd_ars"]
    rate: FloatArray = np.sum([amplitude * DEG * np.sin(2.0 * np.pi * f * t) for f, amplitude in lines], axis=0)
    return rate


@dataclass(frozen=True)
class Reference:
    """What the tests of this folder share."""

    run: Callable[..., dict[str, FloatArray]]
    sensor: type[LiteralSensor]
    readings: Callable[..., dict[str, FloatArray]]
    sines: Callable[..., FloatArray]
    rates: dict[str, float]


@pytest.fixture(scope="session")
def reference() -> Any:
    return Reference(literal_filter, LiteralSensor, linear_sensors, sines, RATES)
