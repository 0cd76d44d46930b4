"""Checks of the times of a scenario: what lies within the run, and in which order."""

from __future__ import annotations

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from testbed.document import Document
    from testbed.scenario.model import Scenario


def check_times(scenario: Scenario, document: Document) -> None:
    """Note in `document` every time of `scenario` that does not lie where it has to."""
    frame = scenario.frame
    if frame.settle >= frame.duration:
        document.find(
            ("settle",),
            f"expected less than the duration {frame.duration:g} s, got {frame.settle:g} s: "
            "no time is left for the metrics",
        )
    base = scenario.base_rate_hz
    if scenario.n_time < 1 or abs(scenario.n_time / base - frame.duration) > 1e-9 * frame.duration:
        document.find(
            ("duration",), f"expected a multiple of the base step {1e6 / base:g} us, got {frame.duration!r} s"
        )
    if frame.detail is not None and not frame.detail[0] < frame.detail[1] <= frame.duration:
        document.find(
            ("detail",),
            f"expected a start before the end, within the run, got {frame.detail[0]:g} s ... {frame.detail[1]:g} s",
        )
    _check_faults(scenario, document)
    if frame.fusion_from:
        _check_onset(scenario, document)


def _check_faults(scenario: Scenario, document: Document) -> None:
    for name, sensor in scenario.sensors.items():
        for i, fault in enumerate(sensor.faults):
            if fault.at >= scenario.frame.duration:
                document.find(
                    ("sensors", name, "faults", i, "at"),
                    f"expected a time within the run of {scenario.frame.duration:g} s, got {fault.at:g} s",
                )


def _check_onset(scenario: Scenario, document: Document) -> None:
    begin, settle = scenario.frame.fusion_from, scenario.frame.settle
    if begin >= scenario.frame.duration:
        document.find(
            ("fusion_from",), f"expected less than the duration {scenario.frame.duration:g} s, got {begin:g} s"
        )
    elif settle < begin:
        document.find(
            ("settle",), f"expected at least {begin:g} s, where the filters begin (fusion_from), got {settle:g} s"
        )
    for name, sensor in scenario.sensors.items():
        periods = begin * sensor.sample_rate
        if abs(periods - round(periods)) > 1e-6:
            document.find(
                ("fusion_from",),
                f"expected a time at which {name} has a reading, such as {round(periods) / sensor.sample_rate!r} s, "
                f"got {begin:g} s",
            )
    if scenario.pointing is not None:
        document.find(("fusion_from",), "expected none beside pointing, whose mirror is fed from t = 0 on")
