"""Checks between the parts of a scenario: what each part alone cannot know."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from pydantic import ValidationError

from testbed.document import findings
from testbed.errors import RunError, ScenarioError
from testbed.fusion.checked import CheckedFilter
from testbed.inputs.plugins import PluginError, running
from testbed.models.turntable.floor import Floor
from testbed.models.turntable.modal import check_modal
from testbed.models.turntable.realisation import grid
from testbed.models.turntable.servo import count_torque
from testbed.models.turntable.turntable import Turntable, check_plant
from testbed.scenario.model import METRICS
from testbed.scenario.peaks import command_peaks
from testbed.scenario.pointing import check_pointing, known_pointing_metrics
from testbed.scenario.step_choice import excerpt, exposed, given_step
from testbed.scenario.times import check_times
from testbed.sensors import SENSORS
from testbed.sensors.checked import try_sensor

if TYPE_CHECKING:
    from testbed.document import Document
    from testbed.models.turntable.parameters import TurntableParameters
    from testbed.scenario.model import Scenario

# Samples of the base clock that a run may have.
MOST_SAMPLES = 1 << 40
_MOST_PARTS = 64


def cross_check(scenario: Scenario, document: Document) -> None:
    """Note in `document` everything that does not fit together in `scenario`."""
    _check_sizes(scenario, document)
    if document.problems:
        return
    check_times(scenario, document)
    _check_clocks(scenario, document)
    check_pointing(scenario, document)
    _check_expectations(scenario, document)
    _check_plant(scenario, document)
    _check_sensors(scenario, document)
    _check_filters(scenario, document)
    if not document.problems:
        _check_motion(scenario, document)


def _check_sizes(scenario: Scenario, document: Document) -> None:
    """Refuse what no run could hold, before anything is worked out with it."""
    duration, base = scenario.frame.duration, scenario.base_rate_hz
    if not duration * base <= MOST_SAMPLES:
        most = f"{MOST_SAMPLES / base:.4g} s, {MOST_SAMPLES} samples of the base clock"
        document.find(("duration",), f"expected at most {most}, got {duration:g} s")
    for kind, parts in (("sensors", scenario.sensors), ("fusion", scenario.fusion)):
        if len(parts) > _MOST_PARTS:
            document.find((kind,), f"expected at most {_MOST_PARTS}, got {len(parts)}")
    for i, band in enumerate(scenario.turntable.floor.bands):
        try:
            grid((band.low, band.high), duration)
        except ScenarioError as error:
            document.find(("turntable", "floor", "bands", i), _reasons(error))


def _check_clocks(scenario: Scenario, document: Document) -> None:
    base = scenario.base_rate_hz
    examples = ", ".join(f"{base / n:g} Hz" for n in (1, 2, 4, 5, 10, 20))
    for name, sensor in scenario.sensors.items():
        ratio = base / sensor.sample_rate
        whole = abs(ratio - round(ratio)) <= 1e-9 * ratio and round(ratio) >= 1
        if not whole and (ratio < 1.0 or not sensor.any_clock):
            document.find(
                ("sensors", name, "sample_rate"),
                f"expected {base:g} Hz divided by a whole number ({examples}, ...), got {sensor.sample_rate:g} Hz",
            )
        if sensor.clock is not None and not sensor.any_clock:
            document.find(("sensors", name, "clock"), f"{scenario.sensor_types[name]} reads at samples of the run only")
    if not document.problems and any(sensor.clocked(base) for sensor in scenario.sensors.values()):
        _check_own_clocks(scenario, document)
    if scenario.fusion and not scenario.sensors:
        document.find(("fusion",), "there is nothing to fuse: name at least one sensor under 'sensors:'")


def _check_own_clocks(scenario: Scenario, document: Document) -> None:
    """Find what does not go with sensors that read between the samples of the run."""
    fastest = max(scenario.sensors, key=lambda name: scenario.sensors[name].sample_rate)
    if scenario.fusion and scenario.sensors[fastest].clocked(scenario.base_rate_hz):
        document.find(
            ("sensors", fastest),
            "expected the fastest sensor, at whose readings the filters estimate, on the clock of the run: no clock of "
            f"its own, and {scenario.base_rate_hz:g} Hz divided by a whole number",
        )
    if scenario.pointing is not None:
        document.find(("pointing",), "expected sensors on the clock of the run, whose angles are compared")
    if scenario.frame.fusion_from:
        document.find(("fusion_from",), "expected sensors on the clock of the run, whose readings are counted")


def _check_plant(scenario: Scenario, document: Document) -> None:
    parameters = scenario.turntable
    try:
        step = given_step(parameters)
    except ScenarioError as error:
        document.find(("turntable", "step"), _reasons(error))
        return
    try:
        check_plant(parameters, scenario.base_rate_hz, step.substeps, step.holds)
    except ScenarioError as error:
        document.find(("turntable",), _reasons(error))
        return
    if parameters.engine == "modal":
        try:
            check_modal(parameters, exposed(scenario))
            # Whether its modes can be told apart shows when they are computed; its disturbances do not change them.
            still = parameters.model_copy(update={"floor": Floor(), "wobble": ()})
            Turntable(still, {}, scenario.base_rate_hz, modal=True).process(excerpt(scenario).process(1))
        except ScenarioError as error:
            document.find(("turntable", "engine"), _reasons(error))
        except RunError as error:
            document.find(("turntable",), f"{error}: the first step asks for more than the motor has")


def _reasons(error: ScenarioError) -> str:
    return "; ".join(problem.message for problem in error.problems)


def _check_expectations(scenario: Scenario, document: Document) -> None:
    subjects = {**scenario.sensors, **scenario.fusion}
    for bound in scenario.expect:
        if bound.subject not in subjects:
            document.find(
                ("expect", bound.subject), f"is no sensor or filter of this scenario (there are {', '.join(subjects)})"
            )
            continue
        known = (*METRICS, *known_pointing_metrics(scenario, bound.subject))
        if bound.metric not in known:
            document.find(("expect", bound.subject, bound.metric), f"is no metric (known: {', '.join(known)})")


def _check_sensors(scenario: Scenario, document: Document) -> None:
    """Start the sensors: what their values cannot be together would else show when the run begins, and the faults of
    plug-ins in the middle of it.
    """
    if document.problems:
        return
    for name, sensor in scenario.sensors.items():
        try:
            if scenario.sensor_types[name] in SENSORS:
                sensor.start(scenario.base_rate_hz, scenario.frame.seed, name)
            else:
                try_sensor(sensor, scenario.base_rate_hz)
        except ValidationError as error:
            for place, message in findings(error, type(sensor), {}):
                document.find(("sensors", name), ": ".join((*map(str, place), message)))
        except (ValueError, ArithmeticError) as error:
            document.find(("sensors", name), str(error))


def _check_filters(scenario: Scenario, document: Document) -> None:
    if document.problems:
        return
    rates = {name: sensor.sample_rate for name, sensor in scenario.sensors.items()}
    own = any(sensor.clocked(scenario.base_rate_hz) for sensor in scenario.sensors.values())
    for name, spec in scenario.fusion.items():
        try:
            stage = spec.start(rates)
            if own:
                CheckedFilter(name, stage, max(rates.values()), shipped=True).check_clocks()
        except (ValueError, TypeError) as error:
            document.find(("fusion", name), f"{spec.type}: {error}")


def _check_motion(scenario: Scenario, document: Document) -> None:
    for i, (kind, motion) in enumerate(scenario.motion):
        try:
            with running(f"motion {kind}"):
                top, _ = float(motion.top_frequency()), motion.n_term()
        except ScenarioError as error:
            document.adopt(error)
            continue
        except PluginError as error:
            document.find(("motion", i, kind), str(error))
            continue
        for name, sensor in scenario.sensors.items():
            if top >= sensor.sample_rate / 2:
                document.find(
                    ("motion", i, kind),
                    f"contains {top:g} Hz, but {name} at {sensor.sample_rate:g} Hz sees only what is below "
                    f"{sensor.sample_rate / 2:g} Hz: lower the frequency or raise the sample rate",
                )
    if not document.problems:
        _check_reach(scenario, document)


def _check_reach(scenario: Scenario, document: Document) -> None:
    """Compare the peaks of the commanded motion with ranges and torque."""
    try:
        peaks = command_peaks(scenario)
    except ScenarioError as error:
        _adopt(error, document)
        return
    except RunError as error:
        document.find(("motion",), str(error))
        return
    for name, sensor in scenario.sensors.items():
        if peaks.rate > sensor.full_scale():
            document.find(
                ("motion",),
                f"reaches {np.rad2deg(peaks.rate):.4g} deg/s, beyond the range of {name}, "
                f"+-{np.rad2deg(sensor.full_scale()):.4g} deg/s: reduce the amplitude",
            )
    if scenario.turntable.has_plant and peaks.torque > scenario.turntable.torque_limit:
        _find_torque(scenario.turntable, peaks.torque, document)


def _find_torque(parameters: TurntableParameters, torque: float, document: Document) -> None:
    """Say what asks for more torque than the motor has: the encoder's counts alone, or the motion."""
    limit, digital = parameters.torque_limit, parameters.digital
    count = count_torque(parameters)
    if count > 0.5 * torque:
        document.find(
            ("turntable", "digital", "encoder_bits"),
            f"one count of the encoder, {1e6 * digital.resolution:.3g} urad, times the gain of the loop, "
            f"{count / digital.resolution:.3g} N m/rad, is a torque of {count:.3g} N m, in all "
            f"{torque:.3g} N m where the motor has {limit:g} N m, also at standstill: take more bits, or a lower "
            "rate_bandwidth or position_bandwidth",
        )
        return
    document.find(
        ("motion",),
        f"needs a torque of {torque:.3g} N m, more than the motor's {limit:g} N m: "
        "reduce the amplitude or use turntable mode 'ideal'",
    )


def _adopt(error: ScenarioError, document: Document) -> None:
    """Note the findings about another file as they are, those about the motion itself at their place here."""
    for problem in error.problems:
        if problem.file:
            document.problems.append(problem)
        else:
            document.find(("motion",), problem.message)
