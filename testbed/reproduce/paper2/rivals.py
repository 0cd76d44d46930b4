"""Worst error of gain and phase over the band, for every filter, beside what paper 2's introduction quotes."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from testbed.fusion import FILTERS, estimate
from testbed.fusion.belief import load_belief
from testbed.parts import resolve
from testbed.sensors import load_preset
from testbed.signals import BASE_RATE_HZ
from testbed.units import DEG

if TYPE_CHECKING:
    from collections.abc import Iterator

    from testbed.signals import ComplexArray, FloatArray

    Row = tuple[str, str, str, str, list[tuple[float, float, float]]]

SENSORS = {"mems_gyro": "crs03", "mhd_ars": "mhd03"}


@dataclass(frozen=True)
class Rival:
    """A published result.

    Parameters
    ----------
    name : str
        Whose, and with what.
    band : tuple of two float
        From and to [Hz].
    gain, phase : str
        Largest errors, as quoted.
    """

    name: str
    band: tuple[float, float]
    gain: str
    phase: str


# As paper 2's introduction quotes them; a band from 0 is judged from 0.1 Hz.
RIVALS = (
    Rival("Zhou: MHD + MEMS, complementary", (0.1, 40.0), "1 %", "1 deg"),
    Rival("Tuo: MHD + MEMS, closed loop", (0.1, 60.0), "0.9 dB", "34 deg"),
    Rival("Mao: MEMS gyro + accelerometers, closed loop", (1.0, 100.0), "2.1 dB", "17 deg"),
)


@dataclass(frozen=True)
class SineProtocol:
    """Sines of the table.

    Parameters
    ----------
    frequencies : tuple of float
        [Hz].
    amplitude : float
        What the filters' defaults are made for [deg/s].
    settle, observe : float
        Time before, and least time of, each measurement; neither is less than a period [s].
    """

    frequencies: tuple[float, ...] = (0.1, 0.2, 0.5, 1.0, 2.0, 5.0, 10.0, 20.0, 30.0, 40.0, 50.0, 60.0, 80.0, 100.0)
    amplitude: float = 1.0
    settle: float = 2.0
    observe: float = 1.0


def table_filters() -> list[str]:
    """Return the filters of the table: all that need no choice of another one in them."""
    return [name for name in FILTERS if not any(field.is_required() for field in _fields(name).values())]


def _fields(name: str) -> dict[str, Any]:
    """Return the parameters of a filter."""
    return dict(resolve("filter", name, FILTERS).Parameters.model_fields)


def fused_lines(seed: int, protocol: SineProtocol) -> dict[str, ComplexArray]:
    """Return fused over true rate at every frequency, by filter.

    Parameters
    ----------
    seed : int
        Of the sensors' noise.
    protocol : SineProtocol
        The sines.

    Returns
    -------
    dict of str to ndarray of complex, shape (n_freq,)
        Indicated over true line [-]; an offset and a drift of the estimate are taken off.
    """
    found: dict[str, list[complex]] = {name: [] for name in table_filters()}
    clock, belief = dict.fromkeys(SENSORS, BASE_RATE_HZ), load_belief("paper2")
    for i, freq in enumerate(protocol.frequencies):
        first = round(max(protocol.settle, 1.0 / freq) * BASE_RATE_HZ)
        n_time = first + round(np.ceil(protocol.observe * freq - 1e-9) / freq * BASE_RATE_HZ)
        turns = 2.0 * np.pi * freq * np.arange(n_time) / BASE_RATE_HZ
        rate = protocol.amplitude * DEG * np.sin(turns)
        readings = {
            name: load_preset(part)
            .model_copy(update={"sample_rate": BASE_RATE_HZ})
            .sample(rate, BASE_RATE_HZ, 1000 * seed + i)
            for name, part in SENSORS.items()
        }
        for name, lines in found.items():
            rest: dict[str, Any] = {"start": "rest"} if "start" in _fields(name) else {}
            block = estimate(name, readings, sample_rate_hz=clock, belief=belief, verdict=False, **rest)
            lines.append(_line(block.rate[first:], turns[first:]) / (protocol.amplitude * DEG))
    return {name: np.array(lines) for name, lines in found.items()}


def _line(rate: FloatArray, turns: FloatArray) -> complex:
    """Return the complex amplitude of sin(turns), beside an offset and a drift that are fitted with it."""
    ramp = np.linspace(-1.0, 1.0, rate.size)
    basis = np.stack([np.sin(turns), np.cos(turns), np.ones_like(ramp), ramp], axis=1)
    in_phase, ahead, *_ = np.linalg.lstsq(basis, rate, rcond=None)[0]
    return complex(in_phase, ahead)


def worst(response: ComplexArray, freq_hz: FloatArray, band: tuple[float, float]) -> tuple[float, float, float]:
    """Return the largest errors in a band: gain [%] and [dB], phase [deg].

    Parameters
    ----------
    response : ndarray of complex, shape (n_freq,)
        Fused over true rate [-].
    freq_hz : ndarray, shape (n_freq,)
        [Hz].
    band : tuple of two float
        From and to [Hz].
    """
    inside = response[(freq_hz >= band[0]) & (freq_hz <= band[1])]
    gain = np.abs(inside)
    decibels = 20.0 * np.abs(np.log10(gain))
    return (
        100.0 * float(np.max(np.abs(gain - 1.0))),
        float(np.max(decibels)),
        float(np.degrees(np.max(np.abs(np.angle(inside))))),
    )


def rival_rows(seed: int, protocol: SineProtocol) -> Iterator[Row]:
    """Yield the rows of the table: one per published result and per filter.

    Parameters
    ----------
    seed : int
        Of the sensors' noise.
    protocol : SineProtocol
        The sines.

    Yields
    ------
    tuple
        Name, band, gain and phase as quoted (empty for ours), and our errors in the band of each of `RIVALS` (empty for
        theirs).
    """
    for rival in RIVALS:
        yield rival.name, f"{rival.band[0]:g}-{rival.band[1]:g} Hz", rival.gain, rival.phase, []
    freq = np.array(protocol.frequencies)
    for name, response in fused_lines(seed, protocol).items():
        yield name, "", "", "", [worst(response, freq, rival.band) for rival in RIVALS]


def rival_lines(rows: list[Row]) -> Iterator[str]:
    """Yield the table as it is printed.

    Parameters
    ----------
    rows : list of tuple
        As from `rival_rows`.
    """
    yield "worst error of gain and phase over the band (rivals.csv): ours in the bands of the three quoted results"
    for name, band, gain, phase, ours in rows:
        if ours:
            words = [f"{percent:8.3f} % {decibels:7.3f} dB {phase:8.2f} deg" for percent, decibels, phase in ours]
            yield f"{name:20s}" + "".join(words)
        else:
            yield f"{name:46s}{band:>14s}{gain:>9s}{phase:>9s}"
    yield ""
