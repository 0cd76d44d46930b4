"""The pointing of a scenario: which filters feed the mirror, what does not fit together, which bounds may be set."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from testbed.fusion.two_paths.design import input_psd
from testbed.pointing.blend import Gains, best_gains, butterworth_gains

if TYPE_CHECKING:
    from testbed.document import Document
    from testbed.pointing.parameters import PointingParameters
    from testbed.scenario.model import Scenario
    from testbed.signals import FloatArray

# Metrics of a filter's line of sight that may be bounded; the second kind has a value for each window.
POINTING_METRICS = (
    "residual_rms_urad",
    "knowledge_rms_urad",
    "tracker_only_rms_urad",
    "ape_urad",
    "peak_urad",
    "delay_us",
    "outage",
    "mean_loss_db",
)
# Base samples in a window.
_FEWEST = 10
WINDOW_METRICS = ("rpe_urad", "mpe_urad", "pde_urad", "pre_urad")


def fed_forward(scenario: Scenario) -> tuple[str, ...]:
    """Return the names of the filters that feed the mirror forward, nothing without pointing.

    Parameters
    ----------
    scenario : Scenario
        The scenario.
    """
    pointing = scenario.pointing
    if pointing is None:
        return ()
    return tuple(scenario.fusion) if pointing.feed_forward is None else pointing.feed_forward


def gains_of(scenario: Scenario, name: str) -> Gains:
    """Return the gains of the tracker's correction behind a filter: the best for what the filter believes.

    The density of the rate's error is 1 / sum 1/S over the sensors, 1/f noise and random walk in S; a turn-on bias
    counts as a Markov process as long as the run, since it has to be learnt in it.

    Parameters
    ----------
    scenario : Scenario
        With pointing.
    name : str
        The filter.
    """
    assert scenario.pointing is not None
    tracker, length = scenario.pointing.tracker, scenario.frame.duration
    belief = scenario.fusion[name].belief
    if tracker.noise == 0.0:
        return butterworth_gains(tracker.bandwidth)
    psds = {one: input_psd(believed) for one, believed in belief.items()}

    def density(freq_hz: FloatArray) -> FloatArray:
        turn = 2.0 * np.pi * freq_hz
        information = np.zeros_like(freq_hz)
        for one, believed in belief.items():
            walk = (believed.rate_random_walk / turn) ** 2
            bias = 2.0 * believed.turn_on_bias**2 * length / (1.0 + (turn * length) ** 2)
            information += 1.0 / (psds[one](freq_hz) + walk + bias)
        found: FloatArray = 1.0 / information
        return found

    return best_gains(density, tracker.noise, tracker.bandwidth)


def check_pointing(scenario: Scenario, document: Document) -> None:
    """Note in `document` what does not fit together.

    Parameters
    ----------
    scenario : Scenario
        The scenario.
    document : Document
        Takes the findings.
    """
    pointing = scenario.pointing
    if pointing is None:
        return
    if not scenario.fusion:
        document.find(("pointing",), "there is no rate to feed forward: name a filter under 'fusion:'")
        return
    for i, name in enumerate(pointing.feed_forward or ()):
        if name not in scenario.fusion:
            known = ", ".join(scenario.fusion)
            document.find(("pointing", "feed_forward", i), f"is no filter of this scenario (there are {known})")
    _check_clocks(scenario, pointing, document)
    _check_windows(scenario, pointing, document)
    if not document.problems:
        _check_loop(pointing, document)


def _check_clocks(scenario: Scenario, pointing: PointingParameters, document: Document) -> None:
    base, mirror, tracker = scenario.base_rate_hz, pointing.mirror, pointing.tracker
    if mirror.rate is not None:
        ratio = base / mirror.rate
        if round(ratio) < 1 or abs(ratio - round(ratio)) > 1e-9 * ratio:
            document.find(
                ("pointing", "mirror", "rate"),
                f"expected {base:g} Hz divided by a whole number, got {mirror.rate:g} Hz",
            )
    if tracker.bandwidth >= 0.1 * base:
        document.find(
            ("pointing", "tracker", "bandwidth"),
            f"expected less than a tenth of the base clock, {0.1 * base:g} Hz, got {tracker.bandwidth:g} Hz",
        )
    if mirror.latency >= scenario.frame.duration:
        document.find(("pointing", "mirror", "latency"), f"expected less than the run, got {mirror.latency:g} s")
    for i, fade in enumerate(tracker.fades):
        if fade.at + fade.length > scenario.frame.duration:
            document.find(
                ("pointing", "tracker", "fades", i),
                f"expected a fade within the run of {scenario.frame.duration:g} s, got one that ends at "
                f"{fade.at + fade.length:g} s",
            )


def _check_windows(scenario: Scenario, pointing: PointingParameters, document: Document) -> None:
    judged = scenario.frame.duration - scenario.frame.settle
    seen: set[str] = set()
    for i, window in enumerate(pointing.windows):
        place = ("pointing", "windows", i)
        whole = window.length + (window.separation or 0.0)
        if whole > judged:
            document.find(place, f"expected windows within the {judged:g} s after settle, got {whole:g} s")
        # Sums over fewer are no integrals: the variance of m samples is off by 1/m^2.
        if round(window.length * scenario.base_rate_hz) < _FEWEST:
            least = 1e6 * _FEWEST / scenario.base_rate_hz
            document.find(place, f"expected at least {_FEWEST} base samples, {least:g} us, got {window.length:g} s")
        if window.key in seen:
            document.find(place, f"there is another window of {window.key} s: metrics are named by the length")
        seen.add(window.key)


def _check_loop(pointing: PointingParameters, document: Document) -> None:
    margins = pointing.margins()
    if not margins.stable:
        document.find(
            ("pointing", "tracker"),
            f"the tracker's loop is unstable behind mirror and delays: gain margin {margins.gain_db:.3g} dB, phase "
            f"margin {margins.phase_deg:.3g} deg at {margins.crossover_hz:.3g} Hz; lower its bandwidth or the "
            "latencies",
        )


def known_pointing_metrics(scenario: Scenario, subject: str) -> tuple[str, ...]:
    """Return the metrics of pointing that may be bounded for a filter, nothing if it feeds no mirror.

    Parameters
    ----------
    scenario : Scenario
        The scenario.
    subject : str
        The filter.
    """
    if scenario.pointing is None or subject not in fed_forward(scenario):
        return ()
    windows = [f"{metric}.{window.key}" for metric in WINDOW_METRICS for window in scenario.pointing.windows]
    return (*POINTING_METRICS, *windows)
