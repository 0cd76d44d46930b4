"""A gyro in a thermal chamber, written for these tests alone: other chain of lags and other hysteresis than the
simulator's.

The thermometer sits on the case (one lag behind the chamber) and reads in steps; the coil follows the case, the
gradient is that between two shells, so no true term is exactly one of the model's features.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.signal import lfilter

from testbed.compensation.record import GyroRecord

DEG_H = np.pi / 180.0 / 3600.0
# N = 7.8034e-4 deg/sqrt(h) and B = 1.5323e-2 deg/h of paper 3, in deg/h at 1 Hz.
WHITE, FLICKER = 7.8034e-4 * 60.0, 1.5323e-2
# Legs of a programme: (target [degC], rate [degC/min]), or (None, hold [s]).
PROGRAMMES = {
    "up": [(None, 7200), (60, 0.1), (-30, 0.1)],
    "down": [(None, 7200), (-30, 0.1), (60, 0.1)],
    "slow_up": [(None, 3600), (55, 0.08), (None, 5400), (-25, 0.09), (None, 5400)],
    "mixed_down": [(None, 5400), (-25, 0.1), (None, 3600), (55, 0.09), (20, 0.1)],
    "two_rates": [(None, 7200), (60, 0.15), (-30, 0.1), (20, 0.15)],
}
UNSEEN = ("up", "down", "slow_up", "mixed_down")


@dataclass(frozen=True)
class Cycle:
    """A record [SI] with its true drift and noise [rad/s]."""

    record: GyroRecord
    drift: np.ndarray
    noise: np.ndarray


def programme(legs):
    """Return the chamber's temperature [degC] at 1 Hz."""
    parts, at = [], 20.0
    for target, value in legs:
        if target is None:
            parts.append(np.full(int(value), at))
        else:
            n = round(abs(target - at) / value * 60.0)
            parts.append(at + (target - at) * np.arange(1, n + 1) / n)
            at = target
    return np.concatenate(parts)


def lag(x, tau):
    a = -np.expm1(-1.0 / tau)
    return lfilter([a], [1.0, a - 1.0], x, zi=[(1.0 - a) * x[0]])[0]


def play(x, width):
    held, out = x[0], np.empty_like(x)
    for k, value in enumerate(x.tolist()):
        held = min(max(held, value - width), value + width)
        out[k] = held
    return out


def true_drift(chamber):
    """Return the drift [deg/h] and the case's temperature [degC]."""
    case = lag(chamber, 900.0)
    coil = lag(case, 600.0)
    heat, slope = (coil - 20.0) / 40.0, np.gradient(coil) * 60.0
    drift = 0.06 * heat - 0.05 * heat**2 + 0.035 * heat**3 + 0.45 * slope + 0.25 * heat * slope
    drift += 0.015 * (lag(chamber, 1500.0) - lag(chamber, 2400.0))
    return drift + 0.012 * (case - play(case, 5.0)) / 5.0 + 0.010 * (case - play(case, 15.0)) / 15.0, case


def flicker(n, rng):
    """Return n samples with S = B^2 / (2 pi f), flat below 2.5e-5 Hz, drawn in frequency [deg/h]."""
    freq = np.maximum(np.fft.rfftfreq(4 * n, 1.0), 2.5e-5)
    root = FLICKER / np.sqrt(2.0 * np.pi * freq) * np.sqrt(2.0 * n)
    line = (rng.normal(size=freq.size) + 1j * rng.normal(size=freq.size)) * root
    line[0] = 0.0
    return np.fft.irfft(line, 4 * n)[:n]


def cycle(name, seed, *, earth=10.0, noise=1.0):
    """Return a cycle of `PROGRAMMES` on the rate `earth` [deg/h]."""
    rng = np.random.default_rng(seed)
    drift, case = true_drift(programme(PROGRAMMES[name]))
    own = noise * (WHITE * rng.normal(size=drift.size) + flicker(drift.size, rng))
    reading = np.round(case / 0.0625) * 0.0625 + 273.15
    record = GyroRecord(DEG_H * (earth + drift + own), reading, 1.0)
    return Cycle(record, DEG_H * drift, DEG_H * own)
