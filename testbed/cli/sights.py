"""What the command line prints of the lines of sight of a run."""

from __future__ import annotations

from typing import TYPE_CHECKING

from rich.text import Text

from testbed.cli.console import ruled
from testbed.pages.palette import color_of
from testbed.runs.table import window_text

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping

    from rich.console import Console

    from testbed.runs.metrics import PointingBudget, PointingMetrics
    from testbed.scenario.model import Scenario


def print_sights(console: Console, sights: Mapping[str, PointingMetrics]) -> None:
    """Print what is left of each line of sight, who makes it and what halving that would bring; nothing without any.

    Parameters
    ----------
    console : Console
        Where to.
    sights : mapping of str to PointingMetrics
        By filter.
    """
    if not sights:
        return
    windows = list(dict.fromkeys(key for sight in sights.values() for key in sight.rpe_urad))
    heads = ["residual", "knowledge", "tracker alone", *(f"RPE {window_text(key)}" for key in windows), "delay us"]
    table = ruled("", *heads, title="line of sight: urad rms behind each filter")
    for name, sight in sights.items():
        values = [sight.residual_rms_urad, sight.knowledge_rms_urad, sight.tracker_only_rms_urad]
        values += [sight.rpe_urad.get(key) for key in windows]
        cells = [*map(_number, values), _number(sight.delay_us)]
        table.add_row(Text(name, style=color_of(f"fusion/{name}")), *cells)
    console.print(table)
    for name, sight in sights.items():
        for words in _words(sight):
            console.print(f"{name}: {words}", soft_wrap=True, highlight=False)


def aim_words(scenario: Scenario) -> str:
    """Return what follows from the pointing of a scenario before it runs: margins, delays, and what the lead covers.

    Parameters
    ----------
    scenario : Scenario
        With pointing.
    """
    pointing = scenario.pointing
    assert pointing is not None
    mirror, margins = pointing.mirror, pointing.margins()
    loop = f"phase margin {margins.phase_deg:.3g} deg, gain margin {margins.gain_db:.3g} dB"
    late = f"{1e6 * (mirror.own_delay + mirror.latency):.4g} us late, {1e6 * sum(mirror.lead_times):.4g} us led"
    names = ", ".join(pointing.feed_forward or scenario.fusion)
    return f"{names} to a mirror {late}; tracker of {pointing.tracker.bandwidth:g} Hz: {loop}"


def _words(sight: PointingMetrics) -> Iterator[str]:
    if sight.budget is not None:
        yield budget_words(sight.budget)
    margins, link = sight.margins, sight.link
    crossover, phase, gain = (_number(margins.get(key)) for key in ("crossover_hz", "phase_deg", "gain_db"))
    yield f"tracker's loop: crossover {crossover} Hz, phase margin {phase} deg, gain margin {gain} dB"
    if link is not None:
        below = f"below {_number(link['outage_below_db'])} dB for {_number(link['outage'])} of the time"
        yield f"link: mean loss {_number(link['mean_loss_db'])} dB, {below}"
    stroke, rate = sight.saturated.get("stroke", 0.0), sight.saturated.get("rate", 0.0)
    if stroke or rate:
        yield (
            f"THE MIRROR IS AT ITS END for {100 * stroke:.3g} % of the time by its stroke, {100 * rate:.3g} % by its "
            "rate: give it more, or less to do"
        )


def budget_words(budget: PointingBudget) -> str:
    """Return who makes the residual, and what halving the largest part would bring.

    Parameters
    ----------
    budget : PointingBudget
        Shares that add up to one.
    """
    shares = ", ".join(
        f"{name.replace('_', ' ')} {100 * share:.1f} %" for name, share in budget.shares.items() if share
    )
    half = _number(budget.halved_urad[budget.dominant])
    return f"{shares}; {budget.dominant} dominates, half of it would leave {half} urad"


def _number(value: float | None) -> str:
    return "-" if value is None else f"{value:.3g}"
