"""The Sage-Husa adaptive Kalman filter (SHAKF) with the guards that the paper lacks."""

from __future__ import annotations

from typing import TYPE_CHECKING, Annotated, ClassVar, Literal

import numpy as np
from pydantic import Field

from testbed.fusion.base import Rows
from testbed.fusion.kernels.covariance import SENSOR, adaptive_kernel
from testbed.fusion.model_filter import CovarianceParameters, ModelFilter, Variance
from testbed.fusion.transitions import EVEN, Steps
from testbed.units import DEG

if TYPE_CHECKING:
    from collections.abc import Mapping

    from testbed.fusion.belief import SensorBelief
    from testbed.parts import Part
    from testbed.signals import FloatArray


class SageHusaParameters(CovarianceParameters):
    """Parameters of the Sage-Husa recursions.

    Parameters
    ----------
    adapt : tuple of {"R", "Q", "Q_rate", "r"}
        What adapts: R by (17); Q by the diagonal of (15) in its standard form, on all states or on the rate only (Q
        then stays diagonal); r by (16). Q and r each spoil even the signal that the filter is tuned for; they are here
        to show it.
    beta : float
        Forgetting factor, above 0 and below 1.
    R0 : dict of str to float
        R at the start [rad^2/s^2]; sensors not named start from their belief.
    R_floor : float
        Lowest R that (17) may reach [rad^2/s^2]. It matters at the start, when (17) sees little but H P H': a gyro
        believed to 1e-10 (deg/s)^2 fixes its slow state at a wrong value for the rest of the record.
    """

    adapt: tuple[Literal["R", "Q", "Q_rate", "r"], ...] = ("R",)
    beta: Annotated[float, Field(gt=0.0, lt=1.0)] = 0.999
    R0: dict[str, Variance] = Field(default={"mems_gyro": 1e-4 * DEG**2, "mhd_ars": 6.5e-7 * DEG**2})
    R_floor: Variance = 1e-8 * DEG**2


class ShakfParameters(SageHusaParameters):
    """Parameters of `Shakf`: tuned at 0.5 Hz, 1 deg/s, and without input noise, as in the paper."""

    default_q: ClassVar[dict[int, float]] = {1: 0.0056 * DEG**2}

    use_input_noise: bool = False


class AdaptiveFilter(ModelFilter):
    """The Kalman filter of `Kalman` on the adaptive kernel, as yet without any adaptation; base of the adaptive
    filters.
    """

    # The kernel's other rows have a meaning only where there are bands.
    rows = Rows(("Q_rate", "guard_hits"), ("innovation", "innovation_variance", "R", None, None, None))

    def __init__(
        self, belief: Mapping[str, SensorBelief], sample_rate_hz: Mapping[str, float], parameters: CovarianceParameters
    ) -> None:
        super().__init__(belief, sample_rate_hz, parameters)
        n_sensor = len(self.model.sensors)
        self._sensors = _sensor_records(n_sensor)
        self._windows = np.zeros((n_sensor, 1))
        self._chosen = np.zeros(self._x.size, dtype=np.bool_)
        self._progress = np.array([0.0, 1.0, 0.0])
        self._forget = 0.0
        self._run = adaptive_kernel(self._x.size, n_sensor, self._form, self.model.n_slow)

    def _advance(self, Z: FloatArray, out: FloatArray, steps: Steps = EVEN) -> None:
        state = (self._clocked(steps), self._sensors, self._windows, self._chosen, self._progress, self._forget)
        self._run(self._x, self._P, self._F, self._Q, self._H, Z, *state, out)


def _sensor_records(n_sensor: int) -> np.ndarray:
    """Return one SENSOR record per sensor that adapts nothing."""
    records = np.zeros(n_sensor, dtype=SENSOR)
    records["power"] = records["offset_power"] = 1.0
    records["highest"] = records["clamp"] = np.inf
    records["previous_innovation"] = records["previous_reading"] = np.nan
    records["band"] = -1
    return records


class SageHusa(AdaptiveFilter):
    """The Kalman filter of `Kalman` whose R, Q or r follow the innovations; base of `Shakf` and `ArwShakf`."""

    Parameters: ClassVar[type[Part]] = SageHusaParameters

    def __init__(
        self, belief: Mapping[str, SensorBelief], sample_rate_hz: Mapping[str, float], parameters: SageHusaParameters
    ) -> None:
        super().__init__(belief, sample_rate_hz, parameters)
        self._sensors["R"] = self.measurement_noise("R0", parameters.R0, explicit="R0" in parameters.model_fields_set)
        self._sensors["lowest"] = self._sensors["floor"] = parameters.R_floor
        self._sensors["adapt_R"] = "R" in parameters.adapt
        self._sensors["adapt_offset"] = "r" in parameters.adapt
        self._sensors["forget"] = self._forget = parameters.beta
        self._chosen[0] = "Q_rate" in parameters.adapt
        self._chosen |= "Q" in parameters.adapt
        if self._chosen.any():
            self._Q = self.carried(np.diag(np.diag(self.model.Q)))

    def check_clocks(self) -> None:
        """Raise ValueError if Q adapts, which it does from one regular step to the next."""
        super().check_clocks()
        if self._chosen.any():
            msg = f"adapt: {type(self).__name__} adapts Q at regular steps only; expected R or r between stamps"
            raise ValueError(msg)


class Shakf(SageHusa):
    r"""Sage-Husa adaptive Kalman filter; by default only R adapts.

    .. math:: R \leftarrow (1 - d_k) R + d_k (e e' - H P^- H'), \quad d_k = (1 - \beta) / (1 - \beta^{k+1})

    on the diagonal, k counting the readings of that sensor. With the default q, tuned at 0.5 Hz and 1 deg/s, (17)
    counts the filter's lag at 4 and 10 Hz as sensor noise and R runs away: the failure that paper 1 reports. It needs q
    > (T/2) sum A^2 w^2 over the lines of the signal (T the step, A [rad/s], w [rad/s]).

    (14) is not used, since (8) does not use its q. R is kept above a floor; `guard_hits` counts how often.

    Parameters
    ----------
    belief : mapping of str to SensorBelief
        Dynamics and noise of each sensor.
    sample_rate_hz : mapping of str to float
        Rate of each sensor [Hz].
    parameters : ShakfParameters
        Signal model and adaptation.

    References
    ----------
    Paper 1 (doi 10.1109/TIM.2024.3375962), equations (8)-(17); (15) with + P.
    """

    Parameters: ClassVar[type[Part]] = ShakfParameters
    # (17) sees little but H P H' at first: R of the gyro falls to its floor and fixes a wrong slow state; std is 10 to
    # 25 times too small.
    dishonest = (
        "R follows the lag, P follows R through a gain that no longer fits: the paper's failure, kept to show it"
    )
