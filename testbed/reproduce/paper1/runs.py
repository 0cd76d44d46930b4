"""Paper 1's experiment on the simulated table and sensors: its four signals, its sensors and the filters, each with one
parameter set.

Su et al., IEEE Trans. Instrum. Meas. 2024, doi 10.1109/TIM.2024.3375962. The table moves once per signal (the truth
does not depend on the seed); the sensors read it anew for every seed, and every filter has its default parameters and
believes in equation (39).
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from testbed.fusion import estimate
from testbed.metrics.errors import ErrorMetrics
from testbed.models.motion import MotionProfile
from testbed.models.motions.sine import Sine
from testbed.models.turntable.parameters import Mounting, TurntableParameters
from testbed.models.turntable.turntable import Turntable
from testbed.sensors import load_preset
from testbed.signals import BASE_RATE_HZ, random_stream, sample_times
from testbed.units import DEG

if TYPE_CHECKING:
    from collections.abc import Mapping

    from testbed.fusion.base import EstimateBlock
    from testbed.sensors.base import Sensor
    from testbed.signals import FloatArray

SENSORS = {"mems_gyro": "adis16505_filtered", "mhd_ars": "sx300"}
FILTERS = ("kalman", "shakf", "arw_shakf", "arw_shakf_literal")
SIGNALS = {
    "0.5 Hz": (Sine(frequency=0.5, rate=DEG),),
    "4 Hz": (Sine(frequency=4.0, rate=DEG),),
    "10 Hz": (Sine(frequency=10.0, rate=DEG),),
    "mixed": (Sine(frequency=0.5, angle=5.555e-3), Sine(frequency=10.0, angle=50e-6)),
}


@dataclass(frozen=True)
class FusionProtocol:
    """Times of a run [s]: its length, and where the metrics start.

    Parameters
    ----------
    duration, settle : float
        [s].
    """

    duration: float = 20.0
    settle: float = 10.0


def presets() -> dict[str, Sensor]:
    """Return the paper's two sensors as their presets have them."""
    return {name: load_preset(preset) for name, preset in SENSORS.items()}


def truth(signal: str, protocol: FusionProtocol) -> FloatArray:
    """Return the inertial rate of the table under its servo [rad/s], shape (n_time,), at 20 kHz.

    Parameters
    ----------
    signal : str
        One of `SIGNALS`.
    protocol : FusionProtocol
        Its length.
    """
    terms = [sine.start(protocol.duration, random_stream(0, "motion")) for sine in SIGNALS[signal]]
    table = Turntable(TurntableParameters(), {"mhd_ars": Mounting()}, BASE_RATE_HZ)
    motion, seconds = MotionProfile(terms, 0.5, BASE_RATE_HZ), round(protocol.duration)
    return np.concatenate([table.process(motion.process(round(BASE_RATE_HZ))).rate for _ in range(seconds)])


def sensor_readings(rate: FloatArray, seed: int, sensors: Mapping[str, Sensor]) -> dict[str, FloatArray]:
    """Return the readings of the sensors [rad/s], each at its own rate.

    Parameters
    ----------
    rate : ndarray, shape (n_time,)
        True rate at 20 kHz [rad/s].
    seed : int
        Seed of the noise.
    sensors : mapping of str to Sensor
        Instruments by name.
    """
    return {name: sensor.start(BASE_RATE_HZ, seed, name).process(rate) for name, sensor in sensors.items()}


def fuse(readings: Mapping[str, FloatArray], sensors: Mapping[str, Sensor]) -> dict[str, EstimateBlock]:
    """Return what each of `FILTERS` makes of the readings.

    Parameters
    ----------
    readings : mapping of str to ndarray, shape (n_sample,)
        As from `read` [rad/s].
    sensors : mapping of str to Sensor
        Instruments by name, of which the filters learn the sample rates only.
    """
    rates = {name: sensor.sample_rate for name, sensor in sensors.items()}
    # Defects are planted on purpose.
    return {name: estimate(name, readings, sample_rate_hz=rates, start="rest", verdict=False) for name in FILTERS}


def outputs(rate: FloatArray, seed: int, sensors: Mapping[str, Sensor]) -> dict[str, FloatArray]:
    """Return the rates [rad/s] of the sensors and of the filters, each at its own rate; arguments as `read`."""
    readings = sensor_readings(rate, seed, sensors)
    return readings | {name: block.rate for name, block in fuse(readings, sensors).items()}


def errors(
    found: Mapping[str, FloatArray], rate: FloatArray, signal: str, protocol: FusionProtocol
) -> dict[str, tuple[float, float]]:
    """Return complex and aligned RMSE [deg/s] of every rate.

    Parameters
    ----------
    found : mapping of str to ndarray, shape (n_sample,)
        Rates as from `outputs` [rad/s].
    rate : ndarray, shape (n_time,)
        True rate at 20 kHz [rad/s].
    signal : str
        One of `SIGNALS`.
    protocol : FusionProtocol
        Its times.
    """
    lines = [sine.frequency for sine in SIGNALS[signal]]
    judged = {}
    for name, values in found.items():
        stride = rate.size // values.size
        metrics, first = ErrorMetrics(lines), round(protocol.settle * BASE_RATE_HZ / stride)
        t = sample_times(first, values.size - first, BASE_RATE_HZ / stride)
        metrics.add(t, values[first:], rate[::stride][first:])
        result = metrics.result()
        judged[name] = result["rmse_deg_s"], result["rmse_aligned_deg_s"]
    return judged
