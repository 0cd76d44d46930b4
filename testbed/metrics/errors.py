"""Errors of readings and estimates against the truth, accumulated block by block."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from testbed.metrics.line_fit import Line, LineFit, Waves

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from testbed.signals import FloatArray

# Where the integral of the floor begins [Hz].
_LOWEST_HZ = 1e-6


class ErrorMetrics:
    r"""Error of one rate signal against the truth at the same instants.

    .. math:: \mathrm{rmse}^2 = \langle e^2 \rangle, \qquad
        \mathrm{rmse\_aligned}^2 = \langle r^2 \rangle + \sum_i A_i^2 (|g_i| - 1)^2 / 2

    with e = estimate - truth, r what is left of e after the least-squares fit of the commanded lines, A_i the amplitude
    of the truth and g_i = estimate/truth the complex gain at line i. Only sums are kept (normal equations), so memory
    does not grow with duration; they are added block by block, so that another division into blocks changes the last
    digits only (below 1e-9 relative).

    Parameters
    ----------
    lines : sequence of float or Waves
        Commanded line frequencies [Hz]; as `Waves` they are worked out once for all that share it.
    gaps : bool, optional
        NaN estimates are lost readings: left out and counted as `missing`. Otherwise they leave the result undefined.
    span : tuple of two floats, optional
        From when to when samples come [s]; without it gain and phase have no interval.
    """

    def __init__(
        self, lines: Sequence[float] | Waves, *, gaps: bool = False, span: tuple[float, float] | None = None
    ) -> None:
        self._fit = LineFit(lines if isinstance(lines, Waves) else Waves(lines), span)
        self._gaps, self._missing = gaps, 0
        self._n = 0
        self._square = 0.0
        self._peak = 0.0
        self._variance = 0.0
        self._inside = 0

    def add(self, t: FloatArray, estimate: FloatArray, truth: FloatArray, std: FloatArray | None = None) -> None:
        """Add samples.

        Parameters
        ----------
        t : ndarray, shape (n_time,)
            Time [s].
        estimate, truth : ndarray, shape (n_time,)
            Rates [rad/s].
        std : ndarray, shape (n_time,), optional
            Standard deviation that the filter claims [rad/s].
        """
        if self._gaps:
            there = ~np.isnan(estimate)
            missing = int(t.size - np.count_nonzero(there))
            self._missing += missing
            if missing:
                t, estimate, truth = t[there], estimate[there], truth[there]
        if not t.size:
            return
        error = estimate - truth
        self._n += t.size
        self._square += float(error @ error)
        self._peak = max(self._peak, float(np.max(np.abs(error))))
        self._fit.add(t, error, truth)
        if std is not None:
            self._variance += float(std @ std)
            self._inside += int(np.count_nonzero(np.abs(error) <= 2.0 * std))

    def result(self) -> dict[str, Any]:
        """Return the metrics in deg/s and degrees, None where undefined; `missing` is the number of lost readings.

        `gain_ci95` and `phase_ci95_deg` are half the width of the 95 % interval.
        """
        missing = {"missing": self._missing} if self._gaps else {}
        if not self._n:
            return {"rmse_deg_s": None, "rmse_aligned_deg_s": None, "peak_error_deg_s": None, "lines": [], **missing}
        lines = self._fit.result()
        rest = self._rest() if lines else 0.0
        return {
            "rmse_deg_s": finite(np.rad2deg(np.sqrt(self._square / self._n))),
            "rmse_aligned_deg_s": self._aligned(lines, rest),
            "peak_error_deg_s": finite(np.rad2deg(self._peak)),
            "lines": [_row(freq, line, rest) for freq, line in zip(self._fit.lines, lines, strict=True)],
            **missing,
        }

    def consistency(self) -> dict[str, Any]:
        """Return the claimed standard deviation (root mean square) and the share of errors within two of it."""
        if not self._n:
            return {"mean_std_deg_s": None, "inside_2_std": None}
        return {
            "mean_std_deg_s": finite(np.rad2deg(np.sqrt(self._variance / self._n))),
            "inside_2_std": self._inside / self._n,
        }

    def truth_lines(self) -> list[tuple[float, float]]:
        """Return frequency [Hz] and amplitude [rad/s] of the commanded lines in the truth; none without samples or
        lines.
        """
        if not self._n:
            return []
        return [(freq, line.amplitude) for freq, line in zip(self._fit.lines, self._fit.result(), strict=True)]

    def _rest(self) -> float:
        """Return the mean square of the error once the lines are fitted out [rad^2/s^2]."""
        return max((self._square - self._fit.explained()) / self._n, 0.0)

    def _aligned(self, lines: list[Line], rest: float) -> float | None:
        if not lines or any(line.gain is None for line in lines):
            return None
        of_lines = sum(line.amplitude**2 * (abs(line.gain) - 1.0) ** 2 / 2.0 for line in lines if line.gain is not None)
        return finite(np.rad2deg(np.sqrt(rest + of_lines)))


def _row(frequency: float, line: Line, rest: float) -> dict[str, float | None]:
    """Return the metrics of a line, `rest` being the mean square of the error on no line [rad^2/s^2]."""
    g, half, phase_half = line.gain, line.half_width, line.phase_half_width()
    return {
        "frequency_hz": frequency,
        "gain": None if g is None else finite(abs(g)),
        "gain_ci95": None if half is None else finite(half),
        "phase_deg": None if g is None else finite(np.angle(g, deg=True)),
        "phase_ci95_deg": None if phase_half is None else finite(phase_half),
        "error_deg_s": None if g is None else finite(np.rad2deg(_hypot(rest, line.amplitude * abs(g - 1.0)))),
    }


def _hypot(rest: float, amplitude: float) -> float:
    """Return the rms of a sine and something else of the mean square `rest`."""
    return float(np.sqrt(rest + 0.5 * amplitude**2))


def finite(value: Any) -> float | None:
    """Return a number, or None where it is undefined: metrics.json never holds NaN.

    Parameters
    ----------
    value : float
        Any unit.
    """
    return float(value) if np.isfinite(value) else None


def floor_density(psds: Sequence[Callable[[FloatArray], FloatArray]], freq_hz: FloatArray) -> FloatArray:
    """Return the two-sided density [rad^2/s] that the best combination of all sensors leaves: 1 / sum of 1/S_i.

    Parameters
    ----------
    psds : sequence of callable
        Input-referred two-sided noise density of each sensor, Hz -> rad^2/s; inf where it is blind.
    freq_hz : ndarray, shape (n_freq,)
        Frequencies [Hz].
    """
    information = np.zeros_like(freq_hz)
    for psd in psds:
        information += 1.0 / psd(freq_hz)
    with np.errstate(divide="ignore"):
        floor: FloatArray = 1.0 / information
    return floor


def floor_rmse(
    psds: Sequence[Callable[[FloatArray], FloatArray]], bandwidth_hz: float, from_hz: float = 0.0
) -> float | None:
    r"""Return the noise that no filter of an unknown signal gets below, :math:`\sqrt{2\int_{f_0}^W df / \sum_i 1/S_i}`
    [rad/s].

    Non-causal (Wiener); None if no sensor sees some part of the band. The integral runs over ln f from 1e-6 Hz, 200
    points per decade (trapezoid); below that the density is taken as constant.

    Parameters
    ----------
    psds : sequence of callable
        Input-referred two-sided noise density of each sensor, Hz -> rad^2/s.
    bandwidth_hz : float
        W [Hz].
    from_hz : float, optional
        f_0, below which the signal is known to have nothing [Hz].
    """
    if not psds or from_hz >= bandwidth_hz:
        return None
    lowest = max(from_hz, _LOWEST_HZ)
    freq = np.geomspace(lowest, bandwidth_hz, max(int(200 * np.log10(bandwidth_hz / lowest)), 2))
    density = floor_density(psds, freq)
    if not np.all(np.isfinite(density)):
        return None
    below = density[0] * max(freq[0] - from_hz, 0.0)
    return float(np.sqrt(2.0 * (np.trapezoid(density * freq, np.log(freq)) + below)))
