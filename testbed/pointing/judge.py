"""The metrics of a line of sight, accumulated block by block after `settle`."""

from __future__ import annotations

import itertools
import math
from typing import TYPE_CHECKING, Any

import numpy as np

from testbed.metrics.spectra import log_average
from testbed.pointing.budget import BudgetAccount
from testbed.pointing.delay import BAND_HZ, DelayRegression
from testbed.pointing.levels import Levels
from testbed.pointing.link import mean_loss, outage
from testbed.pointing.windows import Periodogram, WindowErrors, drift_weight, mpe_weight, rpe_weight, weighted_rms

if TYPE_CHECKING:
    from testbed.pointing.blend import Gains
    from testbed.pointing.knowledge import TermDensities
    from testbed.pointing.line_of_sight import PointingBlock
    from testbed.pointing.parameters import Link, PointingParameters, Window
    from testbed.signals import FloatArray

URAD = 1e6
_SIGNALS = ("residual", "knowledge", "tracker_only")
_PER_DECADE = 20


class PointingJudge:
    """Takes the blocks of one line of sight and returns its metrics.

    Parameters
    ----------
    parameters : PointingParameters
        Windows, link.
    gains : Gains
        Of the tracker's correction.
    sample_rate_hz : float
        Base clock [Hz].
    settle : int
        Base samples that are not judged.
    n_time : int
        Base samples of the run.
    terms : mapping
        Densities of the noise of each sensor by term [rad^2/s].
    """

    def __init__(
        self,
        parameters: PointingParameters,
        gains: Gains,
        sample_rate_hz: float,
        settle: int,
        n_time: int,
        terms: TermDensities,
    ) -> None:
        self._parameters, self._gains, self._rate = parameters, gains, sample_rate_hz
        self._settle, self._done, self._n_time = settle, 0, n_time - settle
        self._spectra = {name: Periodogram(sample_rate_hz, self._n_time) for name in _SIGNALS}
        self._square, self._peak = dict.fromkeys(_SIGNALS, 0.0), 0.0
        self._windows = [WindowErrors(one.length, one.separation, sample_rate_hz) for one in parameters.windows]
        self._levels = Levels(self._n_time)
        seen = sample_rate_hz > 4.0 * BAND_HZ[1]
        self._delay = DelayRegression(gains, sample_rate_hz) if seen else None
        self._budget = BudgetAccount(sample_rate_hz, self._n_time, terms)
        self._ends = np.zeros(3, dtype=np.int64)

    def process(self, block: PointingBlock, rate: FloatArray) -> None:
        """Take a block and the true rate over it [rad/s], shape (n_time,)."""
        settled = min(max(self._settle - self._done, 0), rate.size)
        self._done += rate.size
        if self._delay is not None:
            self._delay.process(block.residual, rate, settled)
        if settled == rate.size:
            return
        for name in _SIGNALS:
            signal = getattr(block, name)[settled:]
            self._spectra[name].process(signal)
            self._square[name] += float(signal @ signal)
        error = block.residual[settled:]
        self._peak = max(self._peak, float(np.max(np.abs(error))))
        self._levels.process(error)
        for window in self._windows:
            window.process(error)
        self._budget.process(block, settled)
        self._ends += np.bincount(block.ends[settled:], minlength=3)

    def result(self) -> dict[str, Any]:
        """Return the entry of metrics.json; None where undefined."""
        n = max(self._n_time, 1)
        rms = {name: math.sqrt(self._square[name] / n) for name in _SIGNALS}
        residual = self._spectra["residual"]
        delay = None if self._delay is None else self._delay.delay
        found = {
            **{f"{name}_rms_urad": URAD * rms[name] for name in _SIGNALS},
            "ape_urad": URAD * rms["residual"],
            "peak_urad": URAD * self._peak,
            **self._of_windows(),
            "spectral": self._by_spectrum(residual),
            "delay_us": None if delay is None else URAD * delay,
            "levels": [_in_urad(row) for row in self._levels.result()],
            "bands": self._bands(),
            "curves": self._curves(),
            "budget": self._budget.result(),
            "saturated": {"stroke": float(self._ends[1] / n), "rate": float(self._ends[2] / n)},
            "gains": {"angle_per_s": self._gains.angle, "rate_per_s2": self._gains.rate},
            "margins": self._margins(),
            "link": None if self._parameters.link is None else link_summary(rms["residual"], self._parameters.link),
        }
        finite: dict[str, Any] = _finite(found)
        return finite

    def _of_windows(self) -> dict[str, dict[str, float | None]]:
        """Return MPE, RPE, PDE and PRE from samples, by the key of each window."""
        table: dict[str, dict[str, float | None]] = {"rpe_urad": {}, "mpe_urad": {}, "pde_urad": {}, "pre_urad": {}}
        for window, errors in zip(self._parameters.windows, self._windows, strict=True):
            values = {"rpe": errors.rpe, "mpe": errors.mpe, "pde": errors.pde, "pre": errors.pde}
            for name, value in values.items():
                table[f"{name}_urad"][window.key] = None if value is None else URAD * value
        return table

    def _by_spectrum(self, spectrum: Periodogram) -> dict[str, Any]:
        """Return the same from the error's spectrum."""
        power, freq = spectrum.power, spectrum.freq_hz

        def of(window: Window, kind: str) -> float | None:
            if window.length * self._rate > self._n_time:
                return None
            if kind == "pde":
                apart = window.separation
                return None if apart is None else URAD * weighted_rms(power, drift_weight(freq, window.length, apart))
            weight = mpe_weight if kind == "mpe" else rpe_weight
            return URAD * weighted_rms(power, weight(freq, window.length))

        table = {
            f"{kind}_urad": {window.key: of(window, kind) for window in self._parameters.windows}
            for kind in ("rpe", "mpe", "pde")
        }
        return {"ape_urad": URAD * weighted_rms(power), **table}

    def _bands(self) -> list[dict[str, float]]:
        """Return the rms of each signal from decade to decade [urad]."""
        freq, half = self._spectra["residual"].freq_hz, 0.5 * self._rate
        edges = [0.0, *(10.0**k for k in range(7) if 10.0**k < half), half]
        power = {name: spectrum.power for name, spectrum in self._spectra.items()}
        rows = []
        for low, high in itertools.pairwise(edges):
            inside = (freq >= low) & ((freq < high) | (high == half))
            rms = {f"{name}_urad": URAD * weighted_rms(one[inside]) for name, one in power.items()}
            rows.append({"low_hz": low, "high_hz": high, **rms})
        return rows

    def _curves(self) -> dict[str, list[float]]:
        """Return two-sided densities [urad^2/Hz], and the rms below each frequency [urad], of each signal."""
        spectrum = self._spectra["residual"]
        if spectrum.freq_hz.size < 2:
            return {}
        step = spectrum.freq_hz[1]
        freq = log_average(spectrum.freq_hz[1:], spectrum.power[1:], _PER_DECADE)[0]
        curves = {"frequency_hz": freq.tolist()}
        for name, one in self._spectra.items():
            density = one.power[1:] / (2.0 * step)
            curves[f"{name}_urad2_hz"] = (URAD**2 * log_average(one.freq_hz[1:], density, _PER_DECADE)[1]).tolist()
            below = np.sqrt(np.cumsum(one.power))
            curves[f"{name}_below_urad"] = (URAD * np.interp(freq, one.freq_hz, below)).tolist()
        return curves

    def _margins(self) -> dict[str, float | None]:
        margins = self._parameters.margins(self._gains)
        return {
            "gain_db": margins.gain_db,
            "phase_deg": margins.phase_deg,
            "crossover_hz": margins.crossover_hz,
        }


def link_summary(jitter: float, link: Link) -> dict[str, float | None]:
    """Return mean loss and outage of a link by the closed forms, the jitter taken as Gaussian and alike on both axes.

    Parameters
    ----------
    jitter : float
        Rms about one axis [rad].
    link : Link
        The beam.
    """
    return {
        "mean_loss_db": -10.0 * math.log10(mean_loss(jitter, link.divergence)),
        "outage": outage(jitter, link.divergence, link.outage_below),
        "outage_below_db": 10.0 * math.log10(link.outage_below),
        "divergence_urad": URAD * link.divergence,
    }


def _in_urad(row: dict[str, float | None]) -> dict[str, float | None]:
    return {
        ("share" if key == "share" else f"{key}_urad"): value if key == "share" or value is None else URAD * value
        for key, value in row.items()
    }


def _finite(node: Any) -> Any:
    """Return the tree with None for every number that is none."""
    if isinstance(node, dict):
        return {key: _finite(value) for key, value in node.items()}
    if isinstance(node, list):
        return [_finite(value) for value in node]
    return None if isinstance(node, float) and not math.isfinite(node) else node
