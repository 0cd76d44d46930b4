"""What an engineer asks of the turntable: its modes, its torque, how it follows, and how quiet its truth is."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np

from testbed.metrics.errors import ErrorMetrics
from testbed.models.turntable.modes import coupled_modes
from testbed.models.turntable.parameters import TurntableParameters
from testbed.models.turntable.turntable import Turntable
from testbed.scenario.peaks import command_peaks
from testbed.scenario.step_choice import StepChoice, choose_step, excerpt
from testbed.signals import BASE_RATE_HZ

if TYPE_CHECKING:
    from testbed.models.motion import CommandBlock
    from testbed.runs.block import RunBlock
    from testbed.scenario.model import Scenario
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
    step : StepChoice
        How the plant is integrated.
    """

    freq_hz: FloatArray
    damping: FloatArray
    required_torque: float
    torque_limit: float | None
    truth_noise: float
    step: StepChoice

    def summary(self) -> dict[str, Any]:
        """Return the facts with units in their names, as they stand in metrics.json."""
        limit = self.torque_limit
        return {
            "modes_hz": self.freq_hz.tolist(),
            "modes_damping": self.damping.tolist(),
            "required_torque_nm": self.required_torque,
            "torque_limit_nm": limit,
            "torque_margin": None if limit is None else 1.0 - self.required_torque / limit,
            "truth_noise_deg_s": float(np.rad2deg(self.truth_noise)),
            "engine": self.step.engine,
            "step_s": self.step.step,
            "step_factor": self.step.holds / self.step.substeps,
            "step_error": self.step.error,
        }


def table_facts(scenario: Scenario, step: StepChoice | None = None) -> TableFacts:
    """Compute what is known before the run; it plays the command once, without a plant.

    Parameters
    ----------
    scenario : Scenario
        What would run.
    step : StepChoice, optional
        How its plant is integrated, if that is known already.
    """
    parameters = scenario.turntable
    moves = parameters.mode not in {"ideal", "fixed"}
    modes = coupled_modes(parameters) if moves else (np.empty(0), np.empty(0))
    torque = 0.0 if parameters.mode == "fixed" else command_peaks(scenario).torque
    noise = truth_noise(parameters, excerpt(scenario).process(min(_NOISE_STEPS, scenario.n_time)))
    return TableFacts(*modes, torque, parameters.torque_limit if moves else None, noise, step or choose_step(scenario))


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
    step : StepChoice, optional
        How its plant is integrated, if that is known already.
    """

    def __init__(self, scenario: Scenario, step: StepChoice | None = None) -> None:
        self._scenario, self._step = scenario, step
        self._settle = round(scenario.frame.settle * scenario.base_rate_hz)
        self._errors = {name: ErrorMetrics(scenario.lines) for name in ("encoder", "inertial")}
        self._peak = 0.0

    def write(self, block: RunBlock) -> None:
        """Add a block."""
        first = min(max(self._settle - block.start, 0), block.n_time)
        t = np.arange(block.start + first, block.start + block.n_time) / self._scenario.base_rate_hz
        command = block.command.rate[first:-1]
        self._errors["encoder"].add(t, block.truth.encoder_rate[first:], command)
        self._errors["inertial"].add(t, block.truth.rate[first:], command)
        if block.n_time:
            self._peak = max(self._peak, float(np.max(np.abs(block.truth.torque))))

    def result(self) -> dict[str, Any]:
        """Return the entry "turntable" of metrics.json; deg/s, N m, Hz, None where undefined."""
        facts = table_facts(self._scenario, self._step)
        limit = facts.torque_limit
        entry: dict[str, Any] = {"mode": self._scenario.turntable.mode, **facts.summary()}
        for name, errors in self._errors.items():
            result = errors.result()
            entry[f"command_to_{name}_rms_deg_s"] = result["rmse_deg_s"]
            entry[f"command_to_{name}_lines"] = result["lines"]
        return entry | {
            "peak_torque_nm": self._peak,
            "torque_margin": None if limit is None else 1.0 - self._peak / limit,
        }
