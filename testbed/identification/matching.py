"""The clock of the output fitted together with the local responses, so that both channels meet at the same times."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from testbed.identification.alignment import MOST_APART, rough_clock, rough_lags
from testbed.identification.local import LocalFit, fit_local
from testbed.identification.spectrum import RecordGrid, Series, spectrum
from testbed.identification.windows import quiet_parts, spectrum_parts

if TYPE_CHECKING:
    from collections.abc import Sequence

    from testbed.identification.windows import SpectrumPart
    from testbed.signals import ComplexArray

# Of the lower sample rate; a record of fewer bins says nothing.
_HIGHEST, _FEWEST_BINS = 0.45, 32
# A clock is told by what comes back to the same frequency later: the spread in time has to be more of the record than a
# sweep spends in a part of the spectrum.
_SPREAD = 5e-3
_ROUNDS, _SETTLED = 12, 0.05
# What the drift may be at the highest frequency of the first stage [periods].
_FIRST_STAGE = 0.25


@dataclass(frozen=True)
class OutputClock:
    """How the clock of the output runs: it counts 1 s in (1 + error) s of the reference's.

    Parameters
    ----------
    error, std : float
        Its error and the standard deviation of that [-]: 0 and 0 for channels of one clock, infinite where nothing
        tells it.
    """

    error: float
    std: float


@dataclass(frozen=True)
class Matched:
    """Two channels at the same times, and the responses that follow.

    Parameters
    ----------
    grid : RecordGrid
        Part of the record and frequencies.
    clock : OutputClock
        Of the output.
    lag : float
        Delay that was taken off before the fits [s].
    fits, quiet : list of LocalFit
        In the order of frequency; those of the parts where the reference has nothing of its own tell the noise alone.
    """

    grid: RecordGrid
    clock: OutputClock
    lag: float
    fits: list[LocalFit]
    quiet: list[LocalFit]

    @property
    def misfit(self) -> float:
        """Logarithm of what the fits leave, over their degrees of freedom: least where the clock is right."""
        return _misfit(self.fits)


def match(reference: Series, output: Series, *, one_clock: bool = False) -> Matched:
    r"""Return both channels at the same times, with the local responses.

    The clock's error e is found by Gauss-Newton on what all local fits leave, with dY/de as one more column: from the
    fine structure of the spectra, and from zero by stages of rising frequency; the one that leaves less is taken.

    Parameters
    ----------
    reference, output : Series
        Channels; their clocks agree at time zero.
    one_clock : bool, optional
        Both were sampled by one clock.

    Raises
    ------
    ValueError
        If they have too little time in common.
    """
    if one_clock:
        return _matched(reference, output, OutputClock(0.0, 0.0))
    found = [_matched(reference, output, OutputClock(0.0, np.inf), staged=True)]
    rough = rough_clock(reference, output)
    if rough:
        found.append(_matched(reference, output, OutputClock(rough, np.inf)))
    best = min(found, key=lambda one: one.misfit)
    return _matched(reference, output, best.clock)


def _matched(reference: Series, output: Series, clock: OutputClock, *, staged: bool = False) -> Matched:
    """Return the channels matched from a clock near enough, or by stages from one that is not."""
    grid = common_grid(reference, [(output, clock.error)])
    X = spectrum(reference, grid)[0]
    lags = rough_lags(X, spectrum(output, grid, clock.error)[0], grid.length)
    parts = spectrum_parts(np.abs(X) ** 2)
    work = min((_Work(output, grid, X, parts, lag) for lag in lags), key=lambda one: _misfit(one.fits(clock, parts)))
    if staged:
        edge = _FIRST_STAGE / (MOST_APART * grid.length)
        while edge < grid.freq_hz[-1]:
            parts = [part for part in work.parts if grid.freq_hz[part.bins[0]] < edge]
            clock = work.improved(clock, parts)
            edge *= 2.0
    for _ in range(_ROUNDS):
        before, clock = clock, work.improved(clock, work.parts)
        if not abs(clock.error - before.error) > _SETTLED * clock.std:
            break
    return Matched(grid, clock, work.lag, *work.settled(clock))


def _misfit(fits: Sequence[LocalFit]) -> float:
    return float(sum(one.freedom * np.log(max(one.noise, 1e-300)) for one in fits))


@dataclass(frozen=True)
class _Work:
    output: Series
    grid: RecordGrid
    X: ComplexArray
    parts: list[SpectrumPart]
    lag: float

    def transformed(self, clock: OutputClock) -> tuple[ComplexArray, ComplexArray]:
        back = np.exp(2j * np.pi * self.grid.freq_hz * self.lag)
        Y, Z = spectrum(self.output, self.grid, clock.error)
        return back * Y, back * Z

    def fits(self, clock: OutputClock, parts: Sequence[SpectrumPart]) -> list[LocalFit]:
        Y, Z = self.transformed(clock)
        return [fit_local(part, self.grid.freq_hz, self.X, Y, Z) for part in parts]

    def settled(self, clock: OutputClock) -> tuple[list[LocalFit], list[LocalFit]]:
        """Return the fits, and those of the parts between them."""
        freq, X, (Y, Z) = self.grid.freq_hz, self.X, self.transformed(clock)
        fits = [fit_local(part, freq, X, Y, Z) for part in self.parts]
        between = quiet_parts(self.parts, np.abs(X) ** 2, np.abs(Y) ** 2)
        return fits, [fit_local(part, freq, X, Y, Z) for part in between]

    def improved(self, clock: OutputClock, parts: Sequence[SpectrumPart]) -> OutputClock:
        """Return the clock after one step."""
        if clock.std == 0.0 or not parts:
            return clock
        told = [one for one in self.fits(clock, parts) if one.spread > _SPREAD * self.grid.length]
        curvature = sum(one.curvature for one in told)
        if not curvature > 0.0:
            return OutputClock(clock.error, np.inf)
        step = -sum(one.pull for one in told) / curvature
        # A clock has one real number, noise has two parts.
        return OutputClock(float(np.clip(clock.error + step, -MOST_APART, MOST_APART)), float(np.sqrt(0.5 / curvature)))


def common_grid(reference: Series, outputs: Sequence[tuple[Series, float]]) -> RecordGrid:
    """Return the time in common, in whole samples of the reference, so that its bins are independent.

    Parameters
    ----------
    reference : Series
        Its clock counts.
    outputs : sequence of tuple of Series and float
        The others, each with the error of its clock [-].

    Raises
    ------
    ValueError
        If there is too little.
    """
    start = max(reference.start, *(one.start * (1.0 + error) for one, error in outputs))
    end = min(reference.end, *(one.end * (1.0 + error) for one, error in outputs))
    n_time = int((end - start) * reference.sample_rate_hz + 1e-6)
    length = n_time / reference.sample_rate_hz
    slowest = min(reference.sample_rate_hz, *(one.sample_rate_hz for one, _ in outputs))
    n_freq = int(_HIGHEST * slowest * length)
    if n_freq < _FEWEST_BINS:
        msg = f"expected more time in common of both channels, got {max(length, 0.0):g} s"
        raise ValueError(msg)
    return RecordGrid(start, length, n_freq)
