"""The mirror's dynamics: a second-order Butterworth low-pass, or the rational function that meets a measured one."""

from __future__ import annotations

import csv
import io
import math
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from testbed.fusion.analysis.identify import identify
from testbed.inputs.files import read_bytes
from testbed.signals import transfer

if TYPE_CHECKING:
    from pathlib import Path

    from testbed.signals import ComplexArray, FloatArray

_MOST_BYTES = 1 << 20
# A measured response is met to this of itself at every frequency, or refused.
_MISFIT = 0.05
# (real poles, pairs) in the order in which they are tried.
_FORMS = ((0, 1), (1, 1), (0, 2), (1, 2), (0, 3), (0, 4))
_HEAD = "frequency [Hz], gain, phase [deg]"


class Dynamics(NamedTuple):
    """A transfer function in s [rad/s], highest power first.

    Parameters
    ----------
    numerator, denominator : tuple of float
        Coefficients.
    """

    numerator: tuple[float, ...]
    denominator: tuple[float, ...]

    def response(self, freq_hz: FloatArray) -> ComplexArray:
        """Return deflection over command [-] at frequencies [Hz], complex, shape (n_freq,)."""
        return transfer(list(self.numerator), list(self.denominator), freq_hz)

    @property
    def group_delay(self) -> float:
        """Group delay at zero frequency [s]: a_1 / a_0 - b_1 / b_0."""
        (*_, b1, b0), (*_, a1, a0) = (0.0, *self.numerator), self.denominator
        return a1 / a0 - b1 / b0


def butterworth_mirror(bandwidth_hz: float) -> Dynamics:
    """Return w^2 / (s^2 + sqrt(2) w s + w^2), of group delay sqrt(2) / w.

    Parameters
    ----------
    bandwidth_hz : float
        w / (2 pi), where the gain is 0.707 [Hz].
    """
    w = 2.0 * math.pi * bandwidth_hz
    return Dynamics((w**2,), (1.0, math.sqrt(2.0) * w, w**2))


def measured_mirror(path: Path) -> Dynamics:
    """Return the stable rational function of the fewest poles that meets a measured response to 5 %.

    Parameters
    ----------
    path : Path
        Text with the columns frequency [Hz], gain and phase [deg], separated by commas; one line may name them.

    Raises
    ------
    ValueError
        If the file is none such, has less than eight rows, or no function of at most eight poles comes close.
    """
    freq, response = _read(path)
    worst = math.inf
    for real, pairs in _FORMS:
        if freq.size < 2 * (real + 2 * pairs):
            continue
        fit = identify(freq, response, real_poles=real, pole_pairs=pairs)
        worst = min(worst, fit.worst)
        if fit.worst < _MISFIT:
            return Dynamics(tuple(fit.numerator.tolist()), tuple(fit.denominator.tolist()))
    msg = (
        f"{path.name}: expected a response that at most eight poles meet within {100 * _MISFIT:g} %, the best is off "
        f"by {100 * worst:.3g} %: smooth it, or leave out the frequencies where it is noise"
    )
    raise ValueError(msg)


def _read(path: Path) -> tuple[FloatArray, ComplexArray]:
    """Return frequencies [Hz], rising, and the response there."""
    text = read_bytes(path, _MOST_BYTES, "a mirror's response").decode("utf-8", errors="replace")
    rows = []
    for number, row in enumerate(csv.reader(io.StringIO(text)), 1):
        if not row or row[0].lstrip().startswith("#"):
            continue
        try:
            frequency, gain, phase = map(float, row)
        except ValueError as error:
            if number == 1:
                continue
            msg = f"{path.name}:{number}: expected three numbers, {_HEAD}"
            raise ValueError(msg) from error
        rows.append([frequency, gain, phase])
    table = np.array(rows, dtype=float).reshape(-1, 3)
    freq, gains, phases = table.T
    if len(table) < 8 or not (np.all(np.isfinite(table)) and freq[0] > 0.0 and np.all(np.diff(freq) > 0.0)):
        msg = f"{path.name}: expected at least eight rows of {_HEAD}, rising from above 0 Hz, got {len(table)}"
        raise ValueError(msg)
    if not np.all(gains > 0.0):
        msg = f"{path.name}: expected gains above 0"
        raise ValueError(msg)
    return freq, gains * np.exp(1j * np.deg2rad(phases))
