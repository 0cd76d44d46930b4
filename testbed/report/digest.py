"""What the figures show, gathered from a run in one pass over each signal with memory flat in duration."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import numpy as np

from testbed.allan import AllanOctaves
from testbed.errors import Problem, ScenarioError
from testbed.metrics.spectra import SHORTEST_SEGMENT, WelchDensity, log_average, segment_length
from testbed.metrics.transfer import TransferSums
from testbed.pages.envelope import Envelope
from testbed.report.within import adapted, correlations
from testbed.runs.signals import OneSignal

if TYPE_CHECKING:
    from testbed.allan import AllanCurve
    from testbed.metrics.transfer import Transfer
    from testbed.report.within import Correlations
    from testbed.runs.metrics import RunMetrics
    from testbed.runs.results import RunRecord
    from testbed.signals import FloatArray

BLOCK = 2**18
# More than a page has columns; few enough for a figure of some 100 kB.
N_BINS = 700
# What a reader may zoom into by a factor of four.
N_CLOSE = 2800
# A constant error leaks into the first two bins of a Hann window; from the third on the spectrum is free of it.
FIRST_FREQ = 2
# Lost readings in a row that a straight line may stand for.
LONGEST_BRIDGE = 10
# Samples of a zoom without lines, at the least.
FEWEST = 1000


@dataclass(frozen=True)
class RateTrace:
    """A rate [rad/s] over the whole run, in the zoom, and over the whole run for who looks closer."""

    whole: Envelope
    zoom: Envelope
    close: Envelope


@dataclass(frozen=True)
class ErrorTrace:
    """An error against the truth [rad/s].

    `std` is the filter's own standard deviation [rad/s] and `inside` the share of samples after settle with |error|
    <= 2 std; None for a sensor. `transfer` is what came out over the truth. `density` is the two-sided power
    density after settle [rad^2/s^2/Hz] at `freq_hz`, empty if the record is too short; `band_rms` the error [rad/s]
    in each band of the noise budget, None where the spectrum does not reach. `allan` is the Allan deviation after
    settle, None if the record is too short.
    """

    whole: Envelope
    std: Envelope | None
    inside: float | None
    freq_hz: FloatArray
    density: FloatArray
    n_segments: int
    band_rms: tuple[float | None, ...] = ()
    transfer: Transfer | None = None
    close: Envelope | None = None
    allan: AllanCurve | None = None


@dataclass(frozen=True)
class ThermalTrace:
    """What the thermometer of a sensor read [K], and the sensor's true thermal drift [rad/s]."""

    temperature: Envelope
    drift: Envelope


@dataclass(frozen=True)
class Digest:
    """Traces of a run by name: ``commanded``, ``truth`` and every sensor and filter; `thermal` of those with a
    thermometer.

    Of a recording without a reference there is no truth and no error: the densities are those of the rates themselves.
    """

    duration_s: float
    settle_s: float
    zoom_s: tuple[float, float]
    line_freq_hz: list[float]
    rates: dict[str, RateTrace]
    sensor_errors: dict[str, ErrorTrace]
    filter_errors: dict[str, ErrorTrace]
    thermal: dict[str, ThermalTrace] = field(default_factory=dict)
    adapted: dict[str, dict[str, Envelope]] = field(default_factory=dict)
    correlations: dict[str, dict[str, Correlations]] = field(default_factory=dict)

    @property
    def transfers(self) -> dict[str, Transfer]:
        """By group, such as ``sensors/mhd_ars``, what came out over the truth."""
        errors = {"sensors": self.sensor_errors, "fusion": self.filter_errors}
        return {
            f"{kind}/{name}": trace.transfer
            for kind, traces in errors.items()
            for name, trace in traces.items()
            if trace.transfer is not None
        }

    @property
    def has_truth(self) -> bool:
        """Whether there is something that the errors are against."""
        return "truth" in self.rates


def zoom_window(metrics: RunMetrics, still: float = 1.0) -> tuple[float, float]:
    """Return (start, stop) [s] of the zoom: two periods of the slowest line, or `still` [s], from settle on, as far as
    the run reaches.
    """
    lines = [freq for freq in metrics.line_freq_hz if freq > 0]
    length = 2.0 / lines[0] if lines else still
    return metrics.settle_s, min(metrics.settle_s + length, metrics.duration_s)


def digest_run(run: RunRecord) -> Digest:
    """Gather what the figures show.

    Parameters
    ----------
    run : RunRecord
        In memory or on disk.

    Returns
    -------
    Digest
        Traces [rad/s] and densities [rad^2/s^2/Hz].

    Raises
    ------
    ScenarioError
        If the run lacks a signal that its metrics name, or its units or time base are wrong.
    """
    metrics = run.metrics
    tops = ["truth"] if metrics.replay else ["commanded", "truth"]
    tops = [group for group in tops if group in run.groups or not metrics.replay]
    truth = _column(run, "truth", "rate") if "truth" in tops else None
    fastest = max((one.sample_rate_hz for one in run.groups.values()), default=1.0)
    zoom = zoom_window(metrics, max(1.0, FEWEST / fastest))
    rates = {}
    for group in tops:
        signal = _column(run, group, "rate")
        trace = _rate_trace(signal, zoom)
        for first, rate in signal.blocks(BLOCK):
            _add_rate(trace, first, rate)
        rates[group] = trace
    errors = {}
    for group in [f"sensors/{name}" for name in metrics.sensors] + [f"fusion/{name}" for name in metrics.fusion]:
        rates[group], errors[group] = _follow(run, group, truth, zoom)
    return Digest(
        duration_s=metrics.duration_s,
        settle_s=metrics.settle_s,
        zoom_s=zoom,
        line_freq_hz=[freq for freq in metrics.line_freq_hz if freq > 0],
        rates=rates,
        sensor_errors={name: errors[f"sensors/{name}"] for name in metrics.sensors},
        filter_errors={name: errors[f"fusion/{name}"] for name in metrics.fusion},
        adapted=adapted(run),
        correlations=correlations(run),
        thermal={name: _thermal(run, name) for name in metrics.sensors if "temperature" in run.sensors[name]},
    )


def _column(run: RunRecord, group: str, name: str, unit: str = "rad/s") -> OneSignal:
    """Return a signal, its presence and unit checked."""
    signals = run.groups.get(group)
    if signals is None or name not in signals:
        raise _bad(run, f"{group}/{name}", "expected a variable with the coordinate time, got none")
    if signals.units[name] != unit:
        raise _bad(run, f"{group}/{name}", f"expected units {unit!r}, got {signals.units[name]!r}")
    return OneSignal(signals, name)


def _stride(run: RunRecord, group: str, signal: OneSignal, reference: OneSignal) -> int:
    """Return how many samples of `reference` lie in one step of `signal`; it must be a whole number."""
    ratio = reference.sample_rate_hz / signal.sample_rate_hz
    stride = round(ratio)
    # Rates may come from the last time stamp: rounding leaves a relative error of about 1e-12, a drift of one sample
    # over the run is 1 / n.
    if stride < 1 or abs(ratio - stride) * signal.n_time > 0.5 or (signal.n_time - 1) * stride >= reference.n_time:
        message = f"expected a time that steps by whole samples of truth inside its span, got a ratio of {ratio:.9g}"
        raise _bad(run, f"{group}/time", message)
    return stride


def _bad(run: RunRecord, key: str, message: str) -> ScenarioError:
    return ScenarioError([Problem(message, key, "" if run.folder is None else str(run.folder / "run.nc"))])


def _thermal(run: RunRecord, name: str) -> ThermalTrace:
    temperature = _column(run, f"sensors/{name}", "temperature", "K")
    return ThermalTrace(_whole(temperature), _whole(_column(run, "truth", f"{name}_drift")))


def _whole(signal: OneSignal) -> Envelope:
    envelope = Envelope(0, signal.n_time, signal.sample_rate_hz, N_BINS)
    for first, values in signal.blocks(BLOCK):
        envelope.process(first, values)
    return envelope


def _rate_trace(signal: OneSignal, zoom: tuple[float, float]) -> RateTrace:
    fs = signal.sample_rate_hz
    start, stop = min(round(zoom[0] * fs), signal.n_time - 1), min(round(zoom[1] * fs) + 1, signal.n_time)
    whole, close = (Envelope(0, signal.n_time, fs, n_bins) for n_bins in (N_BINS, N_CLOSE))
    return RateTrace(whole, Envelope(start, stop, fs, N_BINS), close)


def _add_rate(trace: RateTrace, first: int, rate: FloatArray) -> None:
    trace.whole.process(first, rate)
    trace.zoom.process(first, rate)
    trace.close.process(first, rate)


def _follow(
    run: RunRecord, group: str, truth: OneSignal | None, zoom: tuple[float, float]
) -> tuple[RateTrace, ErrorTrace]:
    """Read one sensor or filter beside the truth, if there is one."""
    signal = _column(run, group, "rate")
    std = _column(run, group, "std") if group.startswith("fusion/") else None
    against = _Against(run, group, signal, truth)
    fs = signal.sample_rate_hz
    settle = min(int(np.ceil(run.metrics.settle_s * fs - 1e-6)), signal.n_time)
    n_segment = segment_length(signal.n_time - settle)
    welch = WelchDensity(fs, n_segment) if n_segment >= SHORTEST_SEGMENT else None
    transfer = TransferSums(fs, signal.n_time - settle, [line for line in run.metrics.line_freq_hz if line > 0])
    octaves = AllanOctaves(fs)
    trace = _rate_trace(signal, zoom)
    whole, band = Envelope(0, signal.n_time, fs, N_BINS), Envelope(0, signal.n_time, fs, N_BINS)
    close = None if std is None else Envelope(0, signal.n_time, fs, N_CLOSE)
    n_inside, n_judged = 0, 0
    n_block = max(1, BLOCK // against.stride)
    for first in range(0, signal.n_time, n_block):
        stop = min(first + n_block, signal.n_time)
        rate = signal.read(first, stop)
        true = against.truth(first, stop)
        error = rate if true is None else rate - true
        settled = max(settle - first, 0)
        _add_rate(trace, first, rate)
        whole.process(first, error)
        if true is not None:
            transfer.process(true[settled:], rate[settled:])
        judged = _bridged(error[settled:]) if std is None else error[settled:]
        octaves.process(judged)
        if welch is not None:
            welch.process(judged)
        if std is not None and close is not None:
            close.process(first, error)
            sigma = std.read(first, stop)
            band.process(first, sigma)
            if truth is None:
                continue
            inside, counted = _count_inside(error[settled:], sigma[settled:])
            n_inside, n_judged = n_inside + inside, n_judged + counted
    freq_hz, density = _plotted(welch)
    return trace, ErrorTrace(
        whole=whole,
        std=None if std is None else band,
        inside=n_inside / n_judged if n_judged else None,
        freq_hz=freq_hz,
        density=density,
        n_segments=0 if welch is None else welch.n_segments,
        band_rms=_band_rms(welch, run.metrics),
        transfer=transfer.result(),
        close=close,
        allan=octaves.curve(),
    )


class _Against:
    """What a signal is compared with: the truth at its samples; without one nothing."""

    def __init__(self, run: RunRecord, group: str, signal: OneSignal, truth: OneSignal | None) -> None:
        # The reference of a recording is on the clock of the fastest sensor; a slower one may have its own.
        self._own = truth is not None and signal.signals.stamped
        self._truth, self._signal = truth, signal
        self.stride = 1 if truth is None or self._own else _stride(run, group, signal, truth)

    def truth(self, first: int, stop: int) -> FloatArray | None:
        """Return the truth [rad/s] at the signal's samples `first` <= k < `stop`; None where there is none."""
        if self._truth is None:
            return None
        if not self._own:
            return self._truth.read(first * self.stride, (stop - 1) * self.stride + 1)[:: self.stride]
        return self._at(np.asarray(self._signal.signals.read("time", first, stop)))

    def _at(self, times: FloatArray) -> FloatArray:
        """Return the truth at other instants [s], by straight lines between its samples."""
        assert self._truth is not None
        fs = self._truth.sample_rate_hz
        margin = 2 + int(1e-3 * self._truth.n_time)
        first = max(int(times[0] * fs) - margin, 0)
        stop = min(int(times[-1] * fs) + margin, self._truth.n_time)
        known = np.asarray(self._truth.signals.read("time", first, stop))
        return np.interp(times, known, self._truth.read(first, stop), left=np.nan, right=np.nan)


def _bridged(error: FloatArray) -> FloatArray:
    """Put straight lines across a sensor's lost readings, unless many are lost in a row: a gap leaves no spectrum."""
    there = np.flatnonzero(np.isfinite(error))
    if not 0 < there.size < error.size:
        return error
    bridged = np.interp(np.arange(error.size), there, error[there])
    edges = np.concatenate([[-1], there, [error.size]])
    for i in np.flatnonzero(np.diff(edges) > LONGEST_BRIDGE + 1):
        bridged[edges[i] + 1 : edges[i + 1]] = np.nan
    return bridged


def _count_inside(error: FloatArray, sigma: FloatArray) -> tuple[int, int]:
    """Return the number of samples with |error| <= 2 sigma and of those where both are defined."""
    judged = np.isfinite(error) & np.isfinite(sigma)
    inside = np.abs(error[judged]) <= 2.0 * sigma[judged]
    return int(np.count_nonzero(inside)), int(np.count_nonzero(judged))


def _band_rms(welch: WelchDensity | None, metrics: RunMetrics) -> tuple[float | None, ...]:
    """Return the root mean square in each band of the noise budget; None for a band that the spectrum covers in part
    only.
    """
    found: list[float | None] = []
    for band in metrics.budget.bands if metrics.budget else []:
        if welch is None or welch.n_segments == 0 or band.low_hz < welch.freq_hz[FIRST_FREQ]:
            found.append(None)
        else:
            inside = (welch.freq_hz >= band.low_hz) & (welch.freq_hz < band.high_hz)
            found.append(float(np.sqrt(2.0 * welch.density[inside].sum() * welch.freq_hz[1])))
    return tuple(found)


def _plotted(welch: WelchDensity | None) -> tuple[FloatArray, FloatArray]:
    if welch is None or welch.n_segments == 0:
        return np.empty(0), np.empty(0)
    return log_average(welch.freq_hz[FIRST_FREQ:], welch.density[FIRST_FREQ:])
