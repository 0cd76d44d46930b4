"""What an engineer asks of the turntable: its modes, its torque, how it follows, and how quiet its truth is."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np

from testbed.checks import command_peaks
from testbed.metrics import ErrorMetrics
from testbed.models.motion import CommandBlock, MotionProfile
from testbed.models.table_modes import coupled_modes
from testbed.models.turntable import Turntable, TurntableParameters
from testbed.scenario import BASE_RATE_HZ
from testbed.signals import random_stream

if TYPE_CHECKING:
    from testbed.pipeline import RunBlock
    from testbed.scenario import Scenario
    from testbed.signals import FloatArray

# What the plant is made of, less everything that depends on the angle or moves by itself.
_SMOOTH = (
    "gravity",
    "platform_mass",
    "platform_inertia",
    "platform_com_height",
    "isolation_frequency",
    "isolation_damping",
    "bearing_height",
    "rotor_mass",
    "rotor_inertia",
    "mounting_height",
    "radial_frequency",
    "axial_frequency",
    "tilt_frequency",
    "bearing_damping",
    "spindle_drag",
    "rate_bandwidth",
    "position_bandwidth",
)
_NOISE_STEPS = 2000


@dataclass(frozen=True)
class TableFacts:
    """What is known of the turntable of a scenario before the run.

    Parameters
    ----------
    freq_hz, damping : ndarray, shapes (n_mode,)
        Coupled modes of the whole table with its servo [Hz], [-]; empty where nothing but the spindle moves.
    required_torque : float
        Peak torque that the motion asks of the motor [N m].
    torque_limit : float or None
        What the motor gives [N m]; None where the mode knows no limit.
    truth_noise : float
        Arithmetic noise of the truth, rms [rad/s].
    """

    freq_hz: FloatArray
    damping: FloatArray
    required_torque: float
    torque_limit: float | None
    truth_noise: float


def table_facts(scenario: Scenario) -> TableFacts:
    """Compute what is known before the run; it plays the command once, without a plant.

    Parameters
    ----------
    scenario : Scenario
        What would run.
    """
    parameters = scenario.turntable
    moves = parameters.mode not in {"ideal", "fixed"}
    modes = coupled_modes(parameters) if moves else (np.empty(0), np.empty(0))
    torque = 0.0 if parameters.mode == "fixed" else command_peaks(scenario)[1]
    noise = truth_noise(parameters, excerpt(scenario, 0, min(_NOISE_STEPS, scenario.n_time)))
    return TableFacts(*modes, torque, parameters.torque_limit if moves else None, noise)


def excerpt(scenario: Scenario, start: int, n_time: int) -> CommandBlock:
    """Return a part of the commanded motion at its full size, without the ramp-in, as a block from 0.

    Parameters
    ----------
    scenario : Scenario
        Whose motion.
    start, n_time : int
        First base step and number of steps.
    """
    frame, begin = scenario.frame, start / BASE_RATE_HZ
    terms = [
        motion.start(frame.duration, random_stream(frame.seed, "motion", str(i), kind))
        for i, (kind, motion) in enumerate(scenario.motion)
    ]
    whole = MotionProfile(terms, 0.0, BASE_RATE_HZ)

    def part(t: FloatArray) -> FloatArray:
        return whole.rate(t + begin)

    return MotionProfile([part], 0.0, BASE_RATE_HZ).process(n_time)


def truth_noise(parameters: TurntableParameters, command: CommandBlock) -> float:
    """Return the arithmetic noise of the true rate, rms [rad/s], at angles of about a radian.

    Nothing in a balanced table without cogging depends on its angle, so the same motion about another angle gives the
    same rates but for rounding: the noise is the rms of their difference over sqrt(2).

    Parameters
    ----------
    parameters : TurntableParameters
        Of the plant; its smooth, axisymmetric part is used.
    command : CommandBlock
        Motion to play [rad/s].
    """
    if parameters.mode == "fixed":
        return 0.0
    mode = "ideal" if parameters.mode == "ideal" else "servo"
    smooth = {name: getattr(parameters, name) for name in _SMOOTH}
    balanced = TurntableParameters(
        **smooth, mode=mode, torque_limit=1e6, cogging=(), rotor_com=(0.0, 0.0, parameters.rotor_com[2])
    )
    turned = replace(command, angle=command.angle + 1.0, angle_mid=command.angle_mid + 1.0)
    rates = [Turntable(balanced, {}, BASE_RATE_HZ).process(block).rate for block in (command, turned)]
    return float(np.sqrt(np.mean((rates[0] - rates[1]) ** 2) / 2.0))


class TableMetrics:
    """Accumulates how the table followed its command after `settle`, and its peak torque in the whole run.

    Parameters
    ----------
    scenario : Scenario
        What runs.
    """

    def __init__(self, scenario: Scenario) -> None:
        self._scenario = scenario
        self._settle = round(scenario.frame.settle * BASE_RATE_HZ)
        self._errors = {name: ErrorMetrics(scenario.lines) for name in ("encoder", "inertial")}
        self._peak = 0.0

    def write(self, block: RunBlock) -> None:
        """Add a block."""
        first = min(max(self._settle - block.start, 0), block.n_time)
        t = np.arange(block.start + first, block.start + block.n_time) / BASE_RATE_HZ
        command = block.command.rate[first:-1]
        self._errors["encoder"].add(t, block.truth.encoder_rate[first:], command)
        self._errors["inertial"].add(t, block.truth.rate[first:], command)
        if block.n_time:
            self._peak = max(self._peak, float(np.max(np.abs(block.truth.torque))))

    def result(self) -> dict[str, Any]:
        """Return the entry "turntable" of metrics.json; deg/s, N m, Hz, None where undefined."""
        facts = table_facts(self._scenario)
        limit = facts.torque_limit
        entry: dict[str, Any] = {"mode": self._scenario.turntable.mode, "step_s": 1.0 / BASE_RATE_HZ}
        for name, errors in self._errors.items():
            result = errors.result()
            entry[f"command_to_{name}_rms_deg_s"] = result["rmse_deg_s"]
            entry[f"command_to_{name}_lines"] = result["lines"]
        return entry | {
            "peak_torque_nm": self._peak,
            "required_torque_nm": facts.required_torque,
            "torque_limit_nm": limit,
            "torque_margin": None if limit is None else 1.0 - self._peak / limit,
            "truth_noise_deg_s": float(np.rad2deg(facts.truth_noise)),
            "modes_hz": facts.freq_hz.tolist(),
            "modes_damping": facts.damping.tolist(),
        }
