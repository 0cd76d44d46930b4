"""The spectral density of a record of rate, with intervals, and what it holds in bands: as a rate and as an angle."""

from __future__ import annotations

import functools
import itertools
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np
from scipy.fft import next_fast_len
from scipy.special import chdtri

from testbed.allan.freedom import chi_square_quantile
from testbed.errors import Problem, ScenarioError, quoted
from testbed.judging.allan_records import read
from testbed.judging.allan_words import line_text
from testbed.judging.faulty_readings import faulty_readings
from testbed.judging.run_signals import run_records
from testbed.logs.options import quantity
from testbed.metrics.lines import spectral_lines
from testbed.metrics.multitaper import TAPERS, multitaper_density
from testbed.metrics.spectra import LONGEST_SEGMENT, SHORTEST_SEGMENT, WelchDensity
from testbed.units import DEG

if TYPE_CHECKING:
    from collections.abc import Sequence
    from pathlib import Path

    from testbed.judging.allan_records import RateRecord
    from testbed.logs.selection import Selection, TextOptions
    from testbed.signals import FloatArray

METHODS = ("welch", "multitaper")
_SEGMENTS = 8
_FEWEST_SEGMENTS = 3
_MICRO = 1e-6
_TAIL = 0.025


@dataclass(frozen=True)
class BandRms:
    """What a record holds between two frequencies [Hz]: rms of the rate [rad/s] and of its integral [rad]."""

    low_hz: float
    high_hz: float
    rate: float
    angle: float


@dataclass(frozen=True)
class RateDensityEstimate:
    """A spectral density of a record.

    Parameters
    ----------
    record : RateRecord
        What it is of; its mean was taken off.
    freq_hz : ndarray, shape (n_freq,)
        Frequency [Hz], above zero.
    density : ndarray, shape (n_freq,)
        Density of the rate [rad^2/s^2/Hz].
    sides : int
        1: from zero on, all the power; 2: half of it, at positive frequencies.
    freedom : float
        Degrees of freedom of a value [-].
    method : str
        How it was made, for the reader.
    notes : tuple of str
        What was done to the record.
    """

    record: RateRecord
    freq_hz: FloatArray
    density: FloatArray
    sides: int
    freedom: float
    method: str
    notes: tuple[str, ...]

    @functools.cached_property
    def limits(self) -> tuple[float, float]:
        """Factors of the 95 % interval of a density [-]."""
        low, high = chdtri(self.freedom, _TAIL), chi_square_quantile(_TAIL, self.freedom)
        return self.freedom / float(low), self.freedom / float(high)

    @property
    def _power(self) -> FloatArray:
        """Mean square in each bin [rad^2/s^2], both sides counted."""
        width = float(self.freq_hz[1] - self.freq_hz[0])
        power: FloatArray = self.density * (width * self.sides)
        if self.record.rate.size and np.isclose(2.0 * self.freq_hz[-1], self.record.sample_rate_hz):
            # The last bin stands for both signs of half the sample rate.
            power[-1] /= 2.0
        return power

    def cumulative(self) -> tuple[FloatArray, FloatArray]:
        """Return the rms of the rate [rad/s] and of the angle [rad] up to each frequency, each of shape (n_freq,)."""
        angle = self._power / (2.0 * np.pi * self.freq_hz) ** 2
        return np.sqrt(np.cumsum(self._power)), np.sqrt(np.cumsum(angle))

    def bands(self, edges: Sequence[float]) -> list[BandRms]:
        """Return what stands between neighbouring edges [Hz]."""
        power = self._power
        angle = power / (2.0 * np.pi * self.freq_hz) ** 2
        rows = []
        for low, high in itertools.pairwise(edges):
            inside = (self.freq_hz >= low) & (self.freq_hz < high)
            rates, angles = float(power[inside].sum()), float(angle[inside].sum())
            rows.append(BandRms(low, high, float(np.sqrt(rates)), float(np.sqrt(angles))))
        return rows

    def decades(self) -> list[float]:
        """Return the ends of the record's frequencies and the powers of ten between [Hz]."""
        low, high = float(self.freq_hz[0]), float(self.freq_hz[-1])
        tens = [10.0**k for k in range(-9, 10) if low < 10.0**k < high]
        return [low, *tens, float(np.nextafter(high, np.inf))]

    def summary(self, edges: Sequence[float]) -> dict[str, Any]:
        """Return all of it as plain data; units stand in the names."""
        rate, angle = self.cumulative()
        low, high = self.limits
        density = np.sqrt(self.density) / DEG
        return {
            "name": self.record.name,
            "content": self.record.content,
            "sample_rate_hz": self.record.sample_rate_hz,
            "n_time": int(self.record.rate.size),
            "method": self.method,
            "sides": self.sides,
            "freedom": self.freedom,
            "mean_deg_s": float(np.nanmean(self.record.rate)) / DEG,
            "frequency_hz": self.freq_hz.tolist(),
            "density_deg_s_sqrt_hz": density.tolist(),
            "density_lower_deg_s_sqrt_hz": (density * np.sqrt(low)).tolist(),
            "density_upper_deg_s_sqrt_hz": (density * np.sqrt(high)).tolist(),
            "cumulative_rate_deg_s": (rate / DEG).tolist(),
            "cumulative_angle_urad": (angle / _MICRO).tolist(),
            "bands": [
                {"low_hz": b.low_hz, "high_hz": b.high_hz, "rate_deg_s": b.rate / DEG, "angle_urad": b.angle / _MICRO}
                for b in self.bands(edges)
            ],
            "notes": list(self.notes),
        }


def estimate_density(
    record: RateRecord, method: str = "welch", segment: float | None = None, *, two_sided: bool = False
) -> RateDensityEstimate:
    """Return the density of a record less its mean.

    Parameters
    ----------
    record : RateRecord
        Even samples, NaN where one is lost.
    method : str
        ``welch`` (Hann window, half overlap) or ``multitaper`` (seven tapers over the whole record).
    segment : float, optional
        Length of a segment of Welch's method [s]; an eighth of the record if left out.
    two_sided : bool
        Half of the one-sided density.

    Returns
    -------
    RateDensityEstimate
        Above zero frequency.

    Raises
    ------
    ScenarioError
        If the record is too short, or the method is none of these.
    """
    if method not in METHODS:
        raise ScenarioError([Problem(f"expected {' or '.join(METHODS)}, got {quoted(method)}", key="--method")])
    if np.nanmin(record.rate) == np.nanmax(record.rate):
        message = f"expected a rate that changes, all are {np.degrees(np.nanmin(record.rate)):g} deg/s"
        raise ScenarioError([Problem(message, file=record.content)])
    rate = record.rate - np.nanmean(record.rate)
    lost = int(np.count_nonzero(np.isnan(rate)))
    make = _welch if method == "welch" else _multitaper
    freq, density, freedom, words, bridged = make(rate, record, segment)
    notes = list(record.notes)
    if lost:
        low = f"bridged by straight lines: near half the sample rate up to {200.0 * lost / rate.size:.2g} % is missing"
        notes.append(f"{lost} of {rate.size} samples are missing, {low if bridged else 'left out with their segments'}")
    notes += [f"{one.text}: the density is of them too" for one in faulty_readings(record)]
    notes += [line_text(line) for line in spectral_lines(record.rate, record.sample_rate_hz)]
    sides = 2 if two_sided else 1
    return RateDensityEstimate(record, freq[1:], density[1:] * (2.0 / sides), sides, freedom, words, tuple(notes))


def _welch(
    rate: FloatArray, record: RateRecord, segment: float | None
) -> tuple[FloatArray, FloatArray, float, str, bool]:
    """Return frequency, two-sided density, degrees of freedom, words, and whether lost samples were bridged."""
    wanted = min(rate.size // _SEGMENTS, LONGEST_SEGMENT) if segment is None else round(segment * record.sample_rate_hz)
    n_segment = min(next_fast_len(max(wanted, 1), real=True), LONGEST_SEGMENT, rate.size)
    if n_segment < SHORTEST_SEGMENT or wanted > min(rate.size, LONGEST_SEGMENT):
        message = f"expected segments of {SHORTEST_SEGMENT} to {min(rate.size, LONGEST_SEGMENT)} samples, got {wanted}"
        raise ScenarioError([Problem(message, key="--segment", file=record.content)])
    found = WelchDensity(record.sample_rate_hz, n_segment)
    found.process(rate)
    bridged = bool(np.isnan(rate).any()) and found.n_segments < _FEWEST_SEGMENTS
    if bridged:
        found = WelchDensity(record.sample_rate_hz, n_segment)
        found.process(_bridge(rate))
    n = found.n_segments
    # Of Hann windows that overlap by half (Percival and Walden 1993, section 6.17).
    freedom = 36.0 * n**2 / (19.0 * n - 1.0) if n > 1 else 2.0
    words = f"Welch, {n} segments of {n_segment / record.sample_rate_hz:g} s, Hann window, half overlap"
    return found.freq_hz, found.density, freedom, words, bridged


def _multitaper(
    rate: FloatArray, record: RateRecord, segment: float | None
) -> tuple[FloatArray, FloatArray, float, str, bool]:
    if segment is not None:
        raise ScenarioError([Problem("expected Welch's method with it: --method welch", key="--segment")])
    if not SHORTEST_SEGMENT * TAPERS <= rate.size <= 2 * LONGEST_SEGMENT:
        message = f"expected {SHORTEST_SEGMENT * TAPERS} to {2 * LONGEST_SEGMENT} samples, got {rate.size}: take welch"
        raise ScenarioError([Problem(message, key="--method", file=record.content)])
    freq, density = multitaper_density(_bridge(rate), record.sample_rate_hz)
    return freq, density, 2.0 * TAPERS, f"multitaper, {TAPERS} tapers", True


def _bridge(rate: FloatArray) -> FloatArray:
    known = np.isfinite(rate)
    places = np.arange(rate.size)
    bridged: FloatArray = np.interp(places, places[known], rate[known])
    return bridged


def difference(record: RateRecord, other: RateRecord) -> RateRecord:
    """Return a record less another, at the instants of the slower one.

    Parameters
    ----------
    record, other : RateRecord
        Both begin at the same instant; one rate is a whole multiple of the other.

    Raises
    ------
    ScenarioError
        If it is not.
    """
    ratio = max(record.sample_rate_hz, other.sample_rate_hz) / min(record.sample_rate_hz, other.sample_rate_hz)
    if abs(ratio - round(ratio)) > 1e-6 * ratio:
        message = f"expected rates of a whole ratio, got {record.sample_rate_hz:g} and {other.sample_rate_hz:g} Hz"
        raise ScenarioError([Problem(message, key="--minus", file=record.content)])
    stride = round(ratio)
    slow = min(record.sample_rate_hz, other.sample_rate_hz)
    first, second = (one.rate[:: stride if one.sample_rate_hz > 1.001 * slow else 1] for one in (record, other))
    n_time = min(first.size, second.size)
    return replace(
        record,
        name=f"{record.name}_difference",
        rate=first[:n_time] - second[:n_time],
        sample_rate_hz=slow,
        content=f"{record.content} less {other.content}",
        word=0.0,
    )


def densities(
    source: Path,
    wanted: Selection,
    text: TextOptions,
    minus: str | None,
    *,
    method: str,
    segment: float | None,
    two_sided: bool,
) -> list[RateDensityEstimate]:
    """Return the densities that the command line asks for.

    Parameters
    ----------
    source : Path
        Recording or run folder.
    wanted, text : Selection, TextOptions
        Which columns of a recording, or signals of a run, and how a text is written.
    minus : str, optional
        Column or signal to take off each.
    method, segment, two_sided : str, float, bool
        As `estimate_density`.

    Raises
    ------
    ScenarioError
        If something is missing, not understood or belongs to the other kind of source.
    """
    if source.is_dir():
        if given := wanted.of_files:
            raise ScenarioError(
                [Problem("expected a file with it; a run folder knows its signals", key=given[0], file=str(source))]
            )
        records = run_records(source, wanted.column or [])
        other = run_records(source, [minus])[0] if minus else None
    else:
        records = read(source, wanted, text)
        other = read(source, replace(wanted, column=[minus]), text)[0] if minus else None
    chosen = [difference(record, other) for record in records if record.content != other.content] if other else records
    return [estimate_density(record, method, segment, two_sided=two_sided) for record in chosen]


def band_edges(text: str) -> list[float]:
    """Return the edges of bands [Hz] of a list such as ``0.1, 1, 100 Hz``.

    Raises
    ------
    ScenarioError
        If they are not two at least that increase.
    """
    edges = [quantity(part, "Hz", "10 Hz", "--bands") for part in text.split(",")]
    if len(edges) < 2 or any(a >= b for a, b in itertools.pairwise(edges)):
        raise ScenarioError(
            [Problem(f"expected edges that increase, such as '0.1, 1, 100 Hz', got {quoted(text)}", key="--bands")]
        )
    return edges
