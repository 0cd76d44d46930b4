"""Drift compensation on the terminal."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from testbed.cli.console import ruled, terminal
from testbed.drift.summary import LETTERS, audit_summary, start_summary
from testbed.pages.numbers import significant

if TYPE_CHECKING:
    from collections.abc import Mapping
    from pathlib import Path

    from testbed.drift.page import Audited


def print_training(found: Mapping[str, Any]) -> None:
    """Print what was trained, and where the model is."""
    error = f"error of the cross-validation {found['blocked_error_deg_h']:.4g} deg/h, noise of the means included"
    _print(f"method {found['method']}, {len(found['cycles'])} cycles; {error}", found)


def print_application(found: Mapping[str, Any]) -> None:
    """Print how far a model had to be extrapolated, and where the compensated record is."""
    _print(f"{found['extrapolated']:.2%} of the samples outside the trained range{_elsewhere(found)}", found)


def _elsewhere(found: Mapping[str, Any]) -> str:
    """Return what is to be said of a start at another temperature, empty if nothing is."""
    if not found["starts_elsewhere"]:
        return ""
    return (
        f"; it starts {found['start_distance_k']:.1f} K from the nearest start of a training cycle: "
        "its first hours are compensated worse"
    )


def _print(line: str, found: Mapping[str, Any]) -> None:
    console = terminal()
    console.print(line)
    console.print(f"wrote {found['written']}", soft_wrap=True)


def print_audit(audited: Audited, folder: Path) -> None:
    """Print the findings of an audit.

    Parameters
    ----------
    audited : Audited
        The audit.
    folder : Path
        Where its page is.
    """
    console, figures = terminal(), audit_summary(audited.audit)
    table = ruled("", "100 s std", "sigma 1 h", *LETTERS, title=f"{audited.thermal.name}: {audited.method}")
    names = {"before": "record", "after": "compensated", "low_passed": "equal low-pass", "oracle": "oracle"}
    for key, label in names.items():
        if figures[key] is not None:
            table.add_row(label, *_row(figures[key]))
    console.print(table)
    console.print(
        "std and sigma in deg/h, Q in urad, N in deg/sqrt(h), B in deg/h; none where the noise model fails",
        soft_wrap=True,
    )
    shown = {
        "drift reduction": "drift_reduction",
        "sigma at 1 h over the oracle's": "oracle_ratio_1h",
        "100 s std over the oracle's": "block_std_over_oracle",
        "bandwidth left [Hz]": "bandwidth_hz",
        "least gain of a slow true rate": "least_gain_in_drift_band",
        "gain of a step": "step_gain",
        "gain of Earth-rate steps": "earth_rate_gain",
        "gain of a rate that follows temperature": "temperature_rate_gain",
    }
    for label, key in shown.items():
        if figures[key] is not None:
            console.print(f"{label}: {significant(figures[key], 4)}")
    if audited.extrapolated is not None:
        where = _elsewhere(start_summary(audited.start_distance))
        console.print(f"outside the trained range: {audited.extrapolated:.2%} of the samples{where}", soft_wrap=True)
    for leak in figures["leaks"]:
        console.print(f"LEAK: {leak}", style="red", soft_wrap=True)
    for excess in figures["excess"]:
        console.print(f"NO COMPENSATION: {excess}", style="red", soft_wrap=True)
    console.print(f"verdict: {_verdict(figures)}")
    console.print(f"wrote {folder / 'audit.html'}", soft_wrap=True)


def _verdict(figures: Mapping[str, Any]) -> str:
    if figures["leaks"]:
        return "a leak; do not believe this result"
    return "no leak found" if figures["passed"] else "no leak found, and no compensation; do not use this result"


def _row(quality: dict[str, object]) -> list[str]:
    found = quality["coefficients"]
    row = [
        significant(quality[key])  # type: ignore[arg-type]
        for key in ("block_std_100s_deg_h", "allan_deviation_1h_deg_h")
    ]
    if not isinstance(found, dict):
        return [*row, *("-" for _ in LETTERS)]
    return [
        *row,
        *(
            f"< {significant(found[letter]['upper'])}"
            if found[letter]["value"] is None
            else significant(found[letter]["value"], 4)
            for letter in LETTERS
        ),
    ]
