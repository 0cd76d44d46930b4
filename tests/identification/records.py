"""Records of a sensor beside a reference, of which response, delay, clock and noise are known."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.interpolate import CubicSpline
from scipy.signal import butter, sosfilt

from testbed.identification.spectrum import Series
from testbed.signals import LinearFilter, transfer

# Equation (39)'s MHD ARS.
NUMERATOR, DENOMINATOR = [2200.0, 0.0], [0.255, 2178.0, 33900.0]
BASE_HZ, REFERENCE_HZ, OUTPUT_HZ = 20_000.0, 2000.0, 2000.0
STEPS_HZ = (2.0, 5.0, 11.0, 23.0, 47.0, 83.0)
LINES_HZ = (1.3, 2.7, 4.1, 8.3, 13.7, 27.1, 44.9, 61.3, 90.7, 121.1)


def _ramp(t, length):
    """Return a smooth beginning and end of half a second each."""
    u = np.clip(np.minimum(t, length - t) / 0.5, 0.0, 1.0)
    return u**3 * (10.0 - 15.0 * u + 6.0 * u**2)


def stepped(t, rng):
    length = t[-1] / len(STEPS_HZ)
    k = np.minimum((t / length).astype(int), len(STEPS_HZ) - 1)
    return 0.02 * np.sin(2.0 * np.pi * np.array(STEPS_HZ)[k] * (t - k * length)) * _ramp(t - k * length, length)


def chirp(t, rng):
    """Up to 150 Hz and down again, so that each frequency comes twice."""
    half = t[-1] / 2.0
    b = np.log(150.0) / half
    phase = 2.0 * np.pi * (np.exp(b * np.minimum(t, 2.0 * half - t)) - 1.0) / b
    return 0.02 * np.sin(np.where(t <= half, phase, 2.0 * phase.max() - phase)) * _ramp(t, t[-1])


def once(t, rng):
    """Up to 150 Hz, once."""
    b = np.log(150.0) / t[-1]
    return 0.02 * np.sin(2.0 * np.pi * (np.exp(b * t) - 1.0) / b) * _ramp(t, t[-1])


def multisine(t, rng):
    places = np.arange(len(LINES_HZ))[:, None]
    return 0.01 * np.sum(np.sin(2.0 * np.pi * np.array(LINES_HZ)[:, None] * t + 0.7 * places**2), axis=0)


def noise(t, rng):
    x = sosfilt(butter(4, 100.0, fs=BASE_HZ, output="sos"), rng.standard_normal(t.size))
    return 0.02 * x / x.std()


def rest(t, rng):
    return np.zeros(t.size)


EXCITATIONS = {one.__name__: one for one in (stepped, chirp, multisine, noise)}


@dataclass(frozen=True)
class Record:
    """A reference, an output, and what is true of it."""

    reference: Series
    output: Series
    clock: float
    delay: float

    def response(self, freq_hz):
        """Return the true response [-]: to the straight lines between samples of the base clock, which have sinc^2 of a
        sine, 1.2e-4 less at 121 Hz; the noise leaves 1e-4 unsure.
        """
        lines = np.sinc(freq_hz / BASE_HZ) ** 2
        return lines * transfer(NUMERATOR, DENOMINATOR, freq_hz) * np.exp(-2j * np.pi * freq_hz * self.delay)


def record(excitation, seed, *, length=20.0, clock=None, delay=0.35e-3, std=1e-4, reference_std=0.0, as_angle=False):
    """Return a record whose output runs by its own clock, up to 2000 ppm off unless it is given."""
    rng = np.random.default_rng(seed)
    clock = rng.uniform(-2e-3, 2e-3) if clock is None else clock
    t = np.arange(round(length * BASE_HZ)) / BASE_HZ
    rate = excitation(t, rng)
    reading = CubicSpline(t, LinearFilter(NUMERATOR, DENOMINATOR, BASE_HZ).process(rate))
    own = np.arange(int(length * OUTPUT_HZ / (1.0 + max(clock, 0.0))) - 2) / OUTPUT_HZ
    values = reading(np.maximum((1.0 + clock) * own - delay, 0.0)) + std * rng.standard_normal(own.size)
    stride = round(BASE_HZ / REFERENCE_HZ)
    if as_angle:
        given = CubicSpline(t, rate).antiderivative()(t[::stride])
        given = given - np.linspace(given[0], given[-1], given.size)
    else:
        given = rate[::stride] + reference_std * rng.standard_normal(t[::stride].size)
        given = given - given.mean()
    reference = Series(given, 0.0, REFERENCE_HZ, is_angle=as_angle)
    return Record(reference, Series(values - values.mean(), 0.0, OUTPUT_HZ), clock, delay)
