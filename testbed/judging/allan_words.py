"""An Allan analysis in other people's words: data sheets', Kalibr's, and what to know beside it."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any

import numpy as np

from testbed import units
from testbed.errors import Problem, ScenarioError
from testbed.judging.rounding import taken_off
from testbed.metrics.lines import spectral_lines
from testbed.pages.numbers import significant

if TYPE_CHECKING:
    from collections.abc import Sequence
    from pathlib import Path

    from testbed.judging.allan_analysis import Analysis
    from testbed.metrics.lines import SpectralLine

# The flat floor of flicker noise in an Allan deviation, over B.
FLOOR = math.sqrt(2.0 * math.log(2.0) / math.pi)


def data_sheet(analysis: Analysis) -> dict[str, dict[str, Any]]:
    """Return each identified coefficient as data sheets print it.

    Densities are one-sided: sqrt(2) N; of B, K and Q at 1 Hz, where sqrt(S) is B sqrt(1/pi), K sqrt(2) / (2 pi) and
    2 pi Q sqrt(2 / fs).

    Parameters
    ----------
    analysis : Analysis
        A fit that describes its curve.

    Returns
    -------
    dict
        By letter: ``density``, its unit, ``at_hz`` where it depends on frequency; of B also the floor 0.664 B.
    """
    rate, step = analysis.record.sample_rate_hz, 2.0 * math.pi
    shapes = {
        "N": ("angle_random_walk", math.sqrt(2.0), "deg/s/sqrt(Hz)", None),
        "B": ("bias_instability", math.sqrt(1.0 / math.pi), "deg/h/sqrt(Hz)", 1.0),
        "K": ("rate_random_walk", math.sqrt(2.0) / step, "deg/h/sqrt(Hz)", 1.0),
        "Q": ("quantization", step * math.sqrt(2.0 / rate), "deg/s/sqrt(Hz)", 1.0),
    }
    found: dict[str, dict[str, Any]] = {}
    for letter, (name, factor, unit, at) in shapes.items():
        coefficient = getattr(analysis.fit, name)
        if coefficient.identified:
            one = units.parse(f"1 {unit}", "rad*s^-0.5", cycle_is_number=True)
            found[letter] = {"one_sided_density": factor * coefficient.value / one, "density_unit": unit, "at_hz": at}
        if letter == "B" and coefficient.identified:
            found[letter]["allan_floor_deg_h"] = FLOOR * coefficient.value / units.DEG_H
    return found


def data_sheet_lines(analysis: Analysis) -> list[str]:
    """Return the same as sentences."""
    lines = []
    for letter, row in data_sheet(analysis).items():
        where = "" if row["at_hz"] is None else f" at {row['at_hz']:g} Hz"
        value = significant(row["one_sided_density"], 4)
        lines.append(f"{letter} as a one-sided density: {value} {row['density_unit']}{where}")
        if "allan_floor_deg_h" in row:
            floor = significant(row["allan_floor_deg_h"], 4)
            lines.append(f"B as data sheets print it (floor of the curve, {FLOOR:.3f} B): {floor} deg/h")
    return lines


def remarks_on(analysis: Analysis) -> list[str]:
    """Return what to know beside the coefficients: notes of the reader, lost samples, lines in the spectrum."""
    record = analysis.record
    said = list(record.notes)
    if without_text := taken_off(record):
        said.append(without_text)
    lost = int(np.count_nonzero(np.isnan(record.rate)))
    if lost:
        said.append(f"{lost} of {record.rate.size} samples are missing; the intervals count what is left")
    said += [line_text(line) for line in spectral_lines(record.rate, record.sample_rate_hz)]
    return said


def line_text(line: SpectralLine) -> str:
    """Return where a line stands and how large it is."""
    amplitude = significant(math.degrees(line.amplitude), 3)
    return f"a line in the spectrum at {line.frequency_hz:.5g} Hz with an amplitude of {amplitude} deg/s"


def write_imu(path: Path, analyses: Sequence[Analysis]) -> None:
    """Write the gyroscope's part of Kalibr's imu.yaml, which other visual-inertial tools read too.

    Its densities are the coefficients themselves, sigma = N / sqrt(dt). Of several axes the noisiest counts.

    Parameters
    ----------
    path : Path
        File to write.
    analyses : sequence of Analysis
        One for each axis.

    Raises
    ------
    ScenarioError
        If a fit does not describe its curve, or no record identifies N.
    RunError
        If it cannot be written.
    """
    from testbed.runs.atomic import write_text
    from testbed.runs.folder import failing_as_run_error

    refused = [analysis for analysis in analyses if not analysis.given]
    if refused:
        message = "expected coefficients, but the record does not give them; see the verdict without --imu"
        raise ScenarioError([Problem(message, key="--imu", file=refused[0].record.content)])
    noise, walk = (_worst(analyses, name) for name in ("angle_random_walk", "rate_random_walk"))
    text = "\n".join(
        [
            "# Gyroscope of " + "; ".join(analysis.record.content for analysis in analyses),
            "# Continuous-time densities as Kalibr takes them (sigma = density / sqrt(dt)), the noisiest axis.",
            f"gyroscope_noise_density: {noise[0]:.6g}  # [rad/s/sqrt(Hz)] N{noise[1]}",
            f"gyroscope_random_walk: {walk[0]:.6g}  # [rad/s^2/sqrt(Hz)] K{walk[1]}",
            f"update_rate: {analyses[0].record.sample_rate_hz:.9g}  # [Hz]",
            "",
        ]
    )
    with failing_as_run_error(str(path)):
        path.parent.mkdir(parents=True, exist_ok=True)
        write_text(path, text)


def _worst(analyses: Sequence[Analysis], name: str) -> tuple[float, str]:
    """Return the largest coefficient, or the largest limit where no record identifies it, and what it is."""
    found = [getattr(analysis.fit, name) for analysis in analyses]
    seen = [one.value for one in found if one.identified]
    if seen:
        return max(seen), ""
    return max(one.upper for one in found), ", upper limit: not identified"
