"""What `testbed identify` prints."""

from __future__ import annotations

from contextlib import contextmanager
from typing import TYPE_CHECKING, Any

import numpy as np

from testbed.cli.console import ruled, terminal
from testbed.errors import Problem, ScenarioError
from testbed.units import DEG

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence
    from pathlib import Path

    from testbed.identification.session import Identification

# Rows of the table on the terminal; all of them stand in the document and in the figure.
_ROWS = 24
_PPM = 1e6


# What one channel's options say elsewhere, and only a map says of several.
_OF_A_MAP = ("--unit", "--time-unit", "--time", "--scale", "--kind", "--rate")


@contextmanager
def asking_for_a_map(log: Path, *, given: bool) -> Iterator[None]:
    """Add to what a recording's own words leave open that a map says it.

    Parameters
    ----------
    log : Path
        The recording.
    given : bool
        There is a map.
    """
    try:
        yield
    except ScenarioError as error:
        if given or not any(one.key in _OF_A_MAP for one in error.problems):
            raise
        remedy = (
            f"testbed log inspect {log} --out log.yaml writes a map, which says that of each channel: --map log.yaml"
        )
        raise ScenarioError([*error.problems, Problem(remedy, file=str(log))]) from error


def print_identified(found: Sequence[Identification], figure: Path) -> None:
    """Print each sensor's response with its 95 % intervals, its clock, what was fitted and its noise."""
    out = terminal()
    for one in found:
        response = one.measured.response
        out.print(f"{one.name}: {response.freq_hz.size} frequencies in {response.length:.6g} s", style="bold")
        half_gain, half_phase = response.half_widths
        grid = ruled("f [Hz]", "gain", "+-", "fit", "phase [deg]", "+-", "fit", "coherence")
        fitted = one.model.response(response.freq_hz)
        for i in np.unique(np.linspace(0, response.freq_hz.size - 1, _ROWS).round().astype(int)):
            row = (response.gain[i], half_gain[i], abs(fitted[i]))
            turn = (response.phase[i] / DEG, half_phase[i] / DEG, np.angle(fitted[i]) / DEG)
            cells = [
                f"{row[0]:.5f}",
                f"{row[1]:.1e}",
                f"{row[2]:.5f}",
                f"{turn[0]:.3f}",
                f"{turn[1]:.1e}",
                f"{turn[2]:.3f}",
            ]
            grid.add_row(f"{response.freq_hz[i]:.5g}", *cells, f"{response.coherence[i]:.6f}")
        out.print(grid)
        for line in _lines(one):
            out.print(line, soft_wrap=True)
    out.print(f"wrote {figure}", soft_wrap=True)


def _lines(one: Identification) -> list[str]:
    clock, model, noise = one.measured.response.clock, one.model, one.noise
    said = []
    if clock.std > 0.0:
        said.append(
            f"clock: 1 s by it is 1 s {_PPM * clock.error:+.4g} ppm (+- {1.96 * _PPM * clock.std:.2g}) of the reference"
        )
    said.append(
        f"fit: numerator {_coefficients(one.belief.numerator)}, denominator {_coefficients(one.belief.denominator)}; "
        f"misfit {model.misfit:.4g} for {model.freedom} degrees of freedom"
    )
    if model.delayed:
        said.append(f"dead time: {1e6 * model.delay:.2f} us +- {1.96e6 * model.delay_std:.2g} us")
    knee = "" if noise.knee is None else f", 1/f knee {noise.knee:.3g} Hz"
    knee += f", bias instability {noise.instability / DEG:.3g} deg/s" if noise.instability else ""
    said.append(
        f"noise, two-sided: {noise.inner / DEG:.3g} deg/s/sqrt(Hz) before the dynamics, {noise.outer / DEG:.3g} behind"
        f"{knee}"
    )
    return [*said, *one.notes]


def _coefficients(values: Sequence[float]) -> str:
    return f"[{', '.join(f'{value:.6g}' for value in values)}]"


def identified_document(found: Sequence[Identification], figure: str, written: str | None) -> dict[str, Any]:
    """Return all of it as plain data; units stand in the names."""
    return {"sensors": [_plain_sensor(one) for one in found], "figure": figure, "written": written}


def _plain_sensor(one: Identification) -> dict[str, Any]:
    response, model = one.measured.response, one.model
    half_gain, half_phase = response.half_widths
    return {
        "name": one.name,
        "length_s": response.length,
        "frequency_hz": response.freq_hz.tolist(),
        "gain": response.gain.tolist(),
        "gain_ci95": half_gain.tolist(),
        "phase_deg": (response.phase / DEG).tolist(),
        "phase_ci95_deg": (half_phase / DEG).tolist(),
        "coherence": response.coherence.tolist(),
        "clock_ppm": _PPM * response.clock.error,
        "clock_ci95_ppm": 1.96 * _PPM * response.clock.std,
        "numerator": model.numerator.tolist(),
        "denominator": model.denominator.tolist(),
        "delay_us": 1e6 * model.delay,
        "delay_ci95_us": 1.96e6 * model.delay_std,
        "delay_span_us": [1e6 * end for end in model.delay_span],
        "covariance": model.covariance.tolist(),
        "misfit": model.misfit,
        "freedom": model.freedom,
        "noise_frequency_hz": one.floor.freq_hz.tolist(),
        "noise_density_deg2_s2_hz": (one.floor.density / DEG**2).tolist(),
        "input_noise_deg_s_sqrt_hz": one.noise.inner / DEG,
        "output_noise_deg_s_sqrt_hz": one.noise.outer / DEG,
        "noise_knee_hz": one.noise.knee,
        "bias_instability_deg_s": one.noise.instability / DEG,
        "bias_deg_s": one.belief.bias / DEG,
        "notes": list(one.notes),
    }
