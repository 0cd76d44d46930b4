"""Paper 2's protocol on the simulated sensors: scale factor, linearity, noise at standstill, and its rivals.

Jiang, Li, Liu, Tuo, Chinese Journal of Sensors and Actuators 2022 no. 9. One clock reads both sensors, which feel the
same rate: the chain is driven by exact sines, since the table has no torque for 50 deg/s at 60 Hz.
"""

from __future__ import annotations

import copy
import csv
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Any, cast

import numpy as np

from testbed.fusion.belief import load_belief
from testbed.fusion.filters.allan_srkf import AllanSrkf, AllanSrkfParameters
from testbed.metrics.spectra import WelchDensity, log_average
from testbed.reproduce.paper2.figures import write_pictures
from testbed.reproduce.paper2.rivals import RIVALS, SineProtocol, rival_lines, rival_rows
from testbed.sensors import load_preset
from testbed.signals import BASE_RATE_HZ
from testbed.units import DEG

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator
    from pathlib import Path

    from testbed.sensors.mhd_ars import MhdArs
    from testbed.signals import ComplexArray, FloatArray

CHANNELS = ("mems_gyro", "mhd_ars", "fused")
# Volts per (deg/s) of the paper's fused output.
PAPER_SCALE = 0.04


@dataclass(frozen=True)
class BenchProtocol:
    """The paper's protocol: amplitudes [deg/s], frequencies [Hz] and times [s].

    Parameters
    ----------
    scale_amplitudes, scale_frequencies : tuple of float
        Grid of the scale factor, whose mean over the amplitudes counts [deg/s], [Hz].
    linear_amplitudes, linear_frequencies : tuple of float
        Grid of the linearity [deg/s], [Hz].
    settle, observe, linear_observe : float
        Time before each measurement, and least time of it for scale factor and linearity; it lasts a whole number of
        periods [s].
    warm_up, standstill : float
        Time at standstill before linearity and the record of the noise, until the gain of the gyro has settled, and
        that record's length [s].
    sines : SineProtocol
        Of the table of gain and phase errors.
    bend : float
        Nonlinearity of the MHD ARS in the second table of the linearity, over its full scale [-].
    """

    scale_amplitudes: tuple[float, ...] = (20.0, 30.0, 40.0, 50.0)
    scale_frequencies: tuple[float, ...] = (
        *(round(0.1 * k, 1) for k in range(1, 10)),
        *(float(k) for k in range(1, 21)),
        *(float(k) for k in range(25, 61, 5)),
    )
    linear_amplitudes: tuple[float, ...] = (1.0, *(float(k) for k in range(5, 51, 5)))
    linear_frequencies: tuple[float, ...] = (0.2, 2.0, 20.0, 50.0)
    settle: float = 1.0
    observe: float = 1.0
    linear_observe: float = 10.0
    warm_up: float = 300.0
    standstill: float = 600.0
    sines: SineProtocol = field(default_factory=SineProtocol)
    bend: float = 1e-3


def switched_on(**parameters: Any) -> AllanSrkf:
    """Return the filter `allan_srkf` with belief `paper2`, both sensors at the common clock.

    Parameters
    ----------
    **parameters : Any
        Of the filter.
    """
    clock = dict.fromkeys(CHANNELS[:2], BASE_RATE_HZ)
    return AllanSrkf(load_belief("paper2"), clock, AllanSrkfParameters(**{"start": "rest", **parameters}))


def bench_readings(rate: FloatArray, seed: int, stage: AllanSrkf, bend: float = 0.0) -> dict[str, FloatArray]:
    """Return the readings of both sensors and the fused rate.

    Parameters
    ----------
    rate : ndarray, shape (n_time,)
        True rate at the common clock [rad/s].
    seed : int
        Seed of the sensors' noise.
    stage : AllanSrkf
        The filter, which stays on.
    bend : float, optional
        Nonlinearity of the MHD ARS [-].

    Returns
    -------
    dict of str to ndarray, shape (n_time,)
        ``mems_gyro``, ``mhd_ars`` and ``fused`` [rad/s].
    """
    gyro = load_preset("crs03").model_copy(update={"sample_rate": BASE_RATE_HZ})
    bent = load_preset("mhd03").model_copy(update={"nonlinearity": bend})
    readings = {
        "mems_gyro": gyro.start(BASE_RATE_HZ, seed, "mems_gyro").process(rate),
        "mhd_ars": bent.start(BASE_RATE_HZ, seed, "mhd_ars").process(rate),
    }
    return readings | {"fused": stage.process(readings).rate}


def mhd_response(freq_hz: FloatArray) -> ComplexArray:
    """Return the response of the MHD ARS of `read` at frequencies [Hz], complex, shape (n_freq,) [-]."""
    return load_preset("mhd03").response(freq_hz)


def amplitudes(
    freq_hz: float, amplitude: float, seed: int, protocol: BenchProtocol, stage: AllanSrkf, bend: float = 0.0
) -> list[float]:
    """Return the amplitude of each channel for a sine.

    Three periods and more are weighted by the square of Hann's window: the fused rate drifts, as the MHD ARS's noise
    referred to the rate does, and what leaks of a drift into the k-th line falls as k^-5 then.

    Parameters
    ----------
    freq_hz, amplitude : float
        The sine [Hz], [deg/s].
    seed : int
        Seed of the noise.
    protocol : BenchProtocol
        Its times.
    stage : AllanSrkf
        The filter.
    bend : float, optional
        Nonlinearity of the MHD ARS [-].

    Returns
    -------
    list of float
        Fourier amplitudes over whole periods, in the order of `CHANNELS` [deg/s].
    """
    first = round(protocol.settle * BASE_RATE_HZ)
    periods = np.ceil(protocol.observe * freq_hz - 1e-9)
    n_time = first + round(periods / freq_hz * BASE_RATE_HZ)
    turns = 2.0 * np.pi * freq_hz * np.arange(n_time) / BASE_RATE_HZ
    signals = bench_readings(amplitude * DEG * np.sin(turns), seed, stage, bend)
    window = (1.0 - np.cos(turns[first:] / periods)) ** 2 / 1.5 if periods >= 3.0 else 1.0
    line = window * np.exp(-1j * turns[first:])
    return [float(2.0 * np.abs(np.mean(signals[name][first:] * line)) / DEG) for name in CHANNELS]


def scale_factor(seed: int, protocol: BenchProtocol, **parameters: Any) -> FloatArray:
    """Return indicated over true amplitude, mean over the amplitudes, shape (n_freq, 3) in the order of `CHANNELS` [-].

    Parameters
    ----------
    seed : int
        Seed of the noise.
    protocol : BenchProtocol
        Grid and times.
    **parameters : Any
        Of the filter.
    """
    return np.array(
        [
            np.mean(
                [
                    np.array(amplitudes(f, a, seed, protocol, switched_on(**parameters))) / a
                    for a in protocol.scale_amplitudes
                ],
                0,
            )
            for f in protocol.scale_frequencies
        ]
    )


def settle_filter(seed: int, protocol: BenchProtocol, **parameters: Any) -> Callable[[], AllanSrkf]:
    """Return what makes filters that have run through `warm_up` at standstill.

    Parameters
    ----------
    seed : int
        Seed of the noise.
    protocol : BenchProtocol
        Its `warm_up`.
    **parameters : Any
        Of the filter.
    """
    stage = switched_on(**parameters)
    for second in range(0, round(protocol.warm_up), 10):
        bench_readings(
            np.zeros(round(min(10.0, protocol.warm_up - second) * BASE_RATE_HZ)), 1000 * seed - 1 - second, stage
        )
    return lambda: copy.deepcopy(stage)


def linearity(seed: int, protocol: BenchProtocol, bend: float = 0.0, **parameters: Any) -> FloatArray:
    """Return the largest deviation from the fitted line over the largest reading, shape (n_freq, 3) in the order of
    `CHANNELS` [-].

    Every amplitude has noise of its own: the same noise in all of them would cancel. The filter has settled at
    standstill before each frequency.

    Parameters
    ----------
    seed : int
        Seed of the noise.
    protocol : BenchProtocol
        Grid and times.
    bend : float, optional
        Nonlinearity of the MHD ARS [-].
    **parameters : Any
        Of the filter.
    """
    truth = np.array(protocol.linear_amplitudes)
    longer = replace(protocol, observe=protocol.linear_observe)
    settled = settle_filter(seed, protocol, **parameters)
    rows = []
    for i, f in enumerate(protocol.linear_frequencies):
        noises = [1000 * seed + 100 * i + j for j in range(truth.size)]
        found = np.array(
            [amplitudes(f, a, noise, longer, settled(), bend) for a, noise in zip(truth, noises, strict=True)]
        )
        slope, offset = np.polyfit(truth, found, 1)
        deviation = np.abs(found - truth[:, None] * slope - offset)
        rows.append(deviation.max(axis=0) / found[-1])
    return np.array(rows)


def noise_density(seed: int, protocol: BenchProtocol, **parameters: Any) -> tuple[FloatArray, FloatArray]:
    """Return Welch densities at standstill, averaged in logarithmic bins.

    Parameters
    ----------
    seed : int
        Seed of the noise.
    protocol : BenchProtocol
        Times.
    **parameters : Any
        Of the filter.

    Returns
    -------
    freq_hz, density : ndarray, shapes (n_bin,), (n_bin, 4)
        Frequency [Hz]; gyro, MHD ARS, fused, and MHD ARS referred to the rate by its response, two-sided [rad^2/s].
    """
    n_time = round((protocol.warm_up + protocol.standstill) * BASE_RATE_HZ)
    signals = bench_readings(np.zeros(n_time), seed, switched_on(**parameters))
    columns = []
    for name in CHANNELS:
        welch = WelchDensity(BASE_RATE_HZ, round(BASE_RATE_HZ * min(4.0, protocol.standstill / 2.0)))
        welch.process(signals[name][round(protocol.warm_up * BASE_RATE_HZ) :])
        freq = welch.freq_hz[2:]  # what is below is the window's own leakage
        columns.append(welch.density[2:])
    columns.append(columns[1] / np.abs(mhd_response(freq)) ** 2)
    binned = [log_average(freq, column, bins_per_decade=10) for column in columns]
    return binned[0][0], np.array([density for _, density in binned]).T


def report(seeds: int, out: Path, protocol: BenchProtocol | None = None, **parameters: Any) -> Iterator[str]:
    """Run the whole protocol, write its figures and tables (scale_factor, linearity, linearity_bent, noise_psd,
    rivals), and yield the tables line by line.

    Parameters
    ----------
    seeds : int
        Seeds 1 to this; every entry is the median over them [-].
    out : Path
        Folder to write to.
    protocol : BenchProtocol, optional
        The paper's if not given.
    **parameters : Any
        Of the filter.

    Yields
    ------
    str
        One line.
    """
    protocol = protocol or BenchProtocol()
    run = range(1, seeds + 1)
    scale = np.median([scale_factor(seed, protocol, **parameters) for seed in run], axis=0)
    yield from _table(
        out / "scale_factor.csv",
        ["frequency_hz", *CHANNELS],
        protocol.scale_frequencies,
        scale,
        "scale factor, indicated / true",
    )
    linear = 100.0 * np.median([linearity(seed, protocol, **parameters) for seed in run], axis=0)
    columns = ["frequency_hz", *(f"{name}_percent" for name in CHANNELS)]
    yield from _table(
        out / "linearity.csv", columns, protocol.linear_frequencies, linear, "linearity, % of the largest reading"
    )
    bent = 100.0 * np.median([linearity(seed, protocol, protocol.bend, **parameters) for seed in run], axis=0)
    title = f"linearity with a nonlinearity of {100.0 * protocol.bend:g} % of full scale in the MHD ARS, %"
    yield from _table(out / "linearity_bent.csv", columns, protocol.linear_frequencies, bent, title)
    noise = [noise_density(seed, protocol, **parameters) for seed in run]
    freq, density = noise[0][0], np.median([value for _, value in noise], axis=0)
    columns = ["frequency_hz", *(f"{name}_rad2_s" for name in (*CHANNELS, "mhd_ars_input_referred"))]
    _write(out / "noise_psd.csv", columns, freq, density)
    rows = list(rival_rows(1, protocol.sines))
    _write_rivals(out / "rivals.csv", rows)
    yield from rival_lines(rows)
    yield from write_pictures(lambda rate: bench_readings(rate, 1, switched_on(**parameters)), freq, density, out)
    yield ""
    yield from _claims(protocol, scale[:, 2], linear, freq, [value for _, value in noise])


def _claims(
    protocol: BenchProtocol, scale: FloatArray, linear: FloatArray, freq: FloatArray, densities: list[FloatArray]
) -> Iterator[str]:
    low = scale[np.array(protocol.scale_frequencies) < 1.0]
    half = 50.0 * np.ptp(low) / np.mean(low)
    judged = np.array(protocol.linear_frequencies) >= 2.0
    corner = cast("MhdArs", load_preset("mhd03")).channel.corner_freq_hz
    band = (freq >= corner) & (freq <= 500.0)
    excess = [10.0 * np.log10(np.max(one[band, 2] / one[band, 3])) for one in densities]
    span = f" ({min(excess):.2f} to {max(excess):.2f})" if len(excess) > 1 else ""
    yield "fused output beside the paper"
    yield f"{'':34s}{'paper':>22s}{'target':>16s}{'ours':>26s}"
    rows = [
        ("ripple, highest less lowest", "2.5 %", "1 %", f"{100.0 * np.ptp(scale) / np.mean(scale):.3f} %"),
        (
            "low band, V/(deg/s)",
            "0.04 +- 0.0005",
            "-",
            f"{PAPER_SCALE * np.mean(low):.5f} +- {PAPER_SCALE * half / 100.0:.1g}",
        ),
        (
            "linearity (MHD ARS), from 2 Hz",
            "as the MHD ARS",
            "as the MHD ARS",
            f"{linear[judged, 2].max():.1e} ({linear[judged, 1].max():.1e}) %",
        ),
        (
            f"noise over MHD ARS, {corner:.1f}-500 Hz",
            "equal level",
            "1 dB",
            f"{np.median(excess):.2f} dB{span}",
        ),
    ]
    for row in rows:
        yield f"{row[0]:34s}{row[1]:>22s}{row[2]:>16s}{row[3]:>26s}"


def _table(path: Path, columns: list[str], first: tuple[float, ...], values: FloatArray, title: str) -> Iterator[str]:
    _write(path, columns, first, values)
    yield f"{title} ({path.name})"
    yield "".join(f"{name:>20s}" for name in columns)
    for key, row in zip(first, values, strict=True):
        yield f"{key:20g}" + "".join(f"{value:20.6g}" for value in row)
    yield ""


def _write(path: Path, columns: list[str], first: tuple[float, ...] | FloatArray, values: FloatArray) -> None:
    with path.open("w", newline="", encoding="utf-8") as file:
        writer = csv.writer(file)
        writer.writerow(columns)
        writer.writerows([float(key), *map(float, row)] for key, row in zip(first, values, strict=True))


def _write_rivals(path: Path, rows: list[tuple[str, str, str, str, list[tuple[float, float, float]]]]) -> None:
    bands = [f"{rival.band[0]:g}_{rival.band[1]:g}_hz" for rival in RIVALS]
    errors = [f"{error}_{band}" for band in bands for error in ("gain_percent", "gain_db", "phase_deg")]
    with path.open("w", newline="", encoding="utf-8") as file:
        writer = csv.writer(file)
        writer.writerow(["name", "band", "gain_quoted", "phase_quoted", *errors])
        for *words, ours in rows:
            values = [value for each in ours for value in each]
            writer.writerow([*words, *map(str, values), *[""] * (len(errors) - len(values))])
