"""What the figures of paper 1 show, from our simulation: one or more tables of columns per figure.

Frequencies [Hz], times [s], rates in deg/s and N_k / dT and R in (deg/s)^2, as the paper's axes have them; the column
names carry the unit.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, cast

import numpy as np

from testbed.fusion.belief import default_belief
from testbed.models.mhd_channel.channel import MhdChannel, one_mode_response
from testbed.reproduce.paper1.runs import SIGNALS, FusionProtocol, fuse, presets, sensor_readings
from testbed.signals import BASE_RATE_HZ
from testbed.units import DEG

if TYPE_CHECKING:
    from testbed.sensors.base import Sensor
    from testbed.sensors.mhd_ars import MhdArs
    from testbed.signals import ComplexArray, FloatArray

    Table = dict[str, FloatArray]

# Beside the paper's fields in mercury: it states no height; 10 mm makes its "a about 0.1 1/s" of 0.036 T.
PAPER_FIELDS = {"0p036t": 0.036, "0p1t": 0.1}
PAPER_HEIGHT = 10e-3
SWEEP_HZ = np.array([0.1, 0.2, 0.35, 0.7, 1, 1.4, 2, 2.8, 4, 5.6, 8, 11, 16, 25, 50, 100, 200, 400, 800])
N_TOP_HZ = 25.0
WINDOW_STRIDE = 10
FOLLOWERS = ("shakf", "arw_shakf", "arw_shakf_literal")


def slip_error() -> dict[str, Table]:
    """Figure 2: error e_M of the channel, |H - 1|, by equation (6) (one mode) and by the whole of equation (2)."""
    freq = np.geomspace(1e-3, 1e3, 241)
    sx300 = cast("MhdArs", presets()["mhd_ars"]).channel
    channels = {name: MhdChannel(fluid="mercury", height=PAPER_HEIGHT, field=b) for name, b in PAPER_FIELDS.items()}
    table = {"frequency_hz": freq}
    for name, channel in {**channels, "sx300": sx300}.items():
        table[f"one_mode_{name}"] = np.abs(one_mode_response(channel, freq) - 1.0)
        table[f"full_{name}"] = np.abs(channel.response(freq) - 1.0)
    return {"figure_2": table}


def bode(points: dict[str, tuple[ComplexArray, FloatArray]]) -> dict[str, Table]:
    """Figure 6: gain and phase of both sensors by equation (39), by their physics, and as measured.

    Parameters
    ----------
    points : dict of str to tuple
        As from `stepped_sine`.
    """
    freq = np.geomspace(0.05, 1e3, 216)
    curves, measured = {"frequency_hz": freq}, {"frequency_hz": SWEEP_HZ}
    belief = default_belief()
    for name, sensor in presets().items():
        curves |= _gain_and_phase(f"{name}_eq39", belief[name].realisation().response(freq))
        curves |= _gain_and_phase(name, sensor.response(freq))
        measured |= _gain_and_phase(name, points[name][0])
    return {"figure_6": curves, "figure_6_measured": measured}


def increments(points: dict[str, tuple[ComplexArray, FloatArray]]) -> dict[str, Table]:
    """Figure 7: N_k / dT of both sensors at 1 deg/s by formula and as measured; argument as `bode`."""
    freq, shown = np.geomspace(0.1, N_TOP_HZ, 121), SWEEP_HZ <= N_TOP_HZ
    curves, measured = {"frequency_hz": freq}, {"frequency_hz": SWEEP_HZ[shown]}
    for name, sensor in presets().items():
        curves[f"{name}_deg2_s2"] = increment_formula(sensor, freq) / DEG**2
        measured[f"{name}_deg2_s2"] = points[name][1][shown] / DEG**2
    return {"figure_7": curves, "figure_7_measured": measured}


def increment_formula(sensor: Sensor, freq_hz: FloatArray, amplitude: float = DEG) -> FloatArray:
    r"""Return N_k / dT of (30) for a sine and the sensor's own noise: :math:`A^2 |G|^2 \sin^2(\pi f T) + \int S |G|^2
    (1 - \cos 2 \pi f T) df`.

    Parameters
    ----------
    sensor : Sensor
        Instrument with readings every T.
    freq_hz : ndarray, shape (n_freq,)
        Frequency of the sine [Hz].
    amplitude : float
        Its amplitude A [rad/s].

    Returns
    -------
    ndarray, shape (n_freq,)
        Mean of half the squared increments [rad^2/s^2].
    """
    signal = (amplitude * np.abs(sensor.response(freq_hz)) * np.sin(np.pi * freq_hz / sensor.sample_rate)) ** 2
    # The noise enters at the base clock; of a slower sensor, more than half its own rate folds in.
    f = np.linspace(0.25, 0.5 * BASE_RATE_HZ, 40_000)
    density = sensor.input_noise_psd(f) * np.abs(sensor.response(f)) ** 2
    noise = 2.0 * np.trapezoid(density * (1.0 - np.cos(2.0 * np.pi * f / sensor.sample_rate)), f)
    total: FloatArray = signal + noise
    return total


def stepped_sine(seed: int = 1) -> dict[str, tuple[ComplexArray, FloatArray]]:
    """Return, per sensor, what a sine of 1 deg/s in time shows at each of `SWEEP_HZ`: indicated over true rate [-] and
    N_k / dT [rad^2/s^2].

    Each frequency has a run of its own from rest, with noise; NaN beyond half the sensor's sample rate.

    Parameters
    ----------
    seed : int
        Seed of the noise of the first step, and one more for each further.
    """
    found = {}
    for name, sensor in presets().items():
        steps = [_step(sensor, f, seed + i) for i, f in enumerate(SWEEP_HZ)]
        found[name] = np.array([gain for gain, _ in steps]), np.array([level for _, level in steps])
    return found


def _step(sensor: Sensor, freq_hz: float, seed: int) -> tuple[complex, float]:
    if freq_hz > 0.45 * sensor.sample_rate:
        return complex(np.nan, np.nan), np.nan
    # The gyro's slow pole, 0.1 rad/s, has 4 % of the gain and has to settle where the sine is slow enough to excite it.
    settle, measure = (40.0 if freq_hz < 1.0 else 5.0), np.ceil(2.0 * freq_hz) / freq_hz
    rate = DEG * np.sin(2.0 * np.pi * freq_hz * np.arange(round((settle + measure) * BASE_RATE_HZ)) / BASE_RATE_HZ)
    readings = sensor.sample(rate, BASE_RATE_HZ, seed)
    first = round(settle * sensor.sample_rate)
    turns = 2.0 * np.pi * freq_hz * np.arange(first, readings.size) / sensor.sample_rate
    basis = np.stack([np.sin(turns), np.cos(turns), np.ones_like(turns)], axis=1)
    (in_phase, quadrature, _), *_ = np.linalg.lstsq(basis, readings[first:])
    return complex(in_phase, quadrature) / DEG, 0.5 * float(np.mean(np.diff(readings[first:]) ** 2))


def following(rate: FloatArray, signal: str, protocol: FusionProtocol, seed: int = 1) -> dict[str, Table]:
    """Return the three tables of one signal's run: `rates` and `fused` over two periods (mixed: one), `adaptation` over
    the whole run.

    rates (figures 8-10, 13): table, fused (`arw_shakf`), gyro and MHD ARS. fused (11, 14): the adaptive filters and
    their errors. adaptation (12, 15): R of each filter, N_k / dT of both sensors, with fading memory (`arw_shakf`) and
    as printed (`arw_shakf_literal`).

    Parameters
    ----------
    rate : ndarray, shape (n_time,)
        True rate [rad/s].
    signal : str
        One of `SIGNALS`.
    protocol : FusionProtocol
        Times of the run.
    seed : int
        Seed of the noise.
    """
    sensors = presets()
    readings = sensor_readings(rate, seed, sensors)
    blocks = fuse(readings, sensors)
    lines = [sine.frequency for sine in SIGNALS[signal]]
    length = min(2.0 / min(lines), 20.0 / max(lines))
    start = max(0.0, min(protocol.settle, protocol.duration - length))
    shown = np.arange(
        round(start * BASE_RATE_HZ), round(min(start + length, protocol.duration) * BASE_RATE_HZ), WINDOW_STRIDE
    )
    time, true = shown / BASE_RATE_HZ, rate[shown] / DEG
    rates = {"time_s": time, "turntable_deg_s": true, "arw_shakf_deg_s": blocks["arw_shakf"].rate[shown] / DEG}
    for name, values in readings.items():
        rates[f"{name}_deg_s"] = values[shown // (rate.size // values.size)] / DEG
    fused = {"time_s": time, "turntable_deg_s": true}
    fused |= {f"{name}_deg_s": blocks[name].rate[shown] / DEG for name in FOLLOWERS}
    fused |= {f"{name}_error_deg_s": fused[f"{name}_deg_s"] - true for name in FOLLOWERS}
    # Logarithmic in time, at readings of the gyro, so that every value is defined.
    picked = WINDOW_STRIDE * np.unique(np.round(np.geomspace(1, rate.size // WINDOW_STRIDE - 1, 600)).astype(int))
    adaptation = {"time_s": picked / BASE_RATE_HZ}
    for name in FOLLOWERS:
        known = blocks[name].diagnostics
        shown_here = [f"{what}_{sensor}" for what in "RN" for sensor in sensors if f"{what}_{sensor}" in known]
        adaptation |= {f"{name}_{key}_deg2_s2": known[key][picked] / DEG**2 for key in shown_here}
    return {"rates": rates, "fused": fused, "adaptation": adaptation}


def csv_text(table: Table) -> str:
    """Return the columns as comma-separated text under their names; undefined values are left empty.

    Parameters
    ----------
    table : dict of str to ndarray, shape (n_row,)
        Columns of equal length.
    """
    rows = zip(*(column.tolist() for column in table.values()), strict=True)
    lines = [",".join("" if np.isnan(value) else f"{value:.9g}" for value in row) for row in rows]
    return "\n".join([",".join(table), *lines]) + "\n"


def _gain_and_phase(name: str, response: ComplexArray) -> Table:
    return {f"{name}_gain_db": 20.0 * np.log10(np.abs(response)), f"{name}_phase_deg": np.angle(response, deg=True)}
