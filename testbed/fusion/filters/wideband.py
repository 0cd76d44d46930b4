"""One filter for every frequency: a bank of Kalman filters, one per bandwidth, mixed by how well each foresees the
readings.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Annotated, ClassVar

import numpy as np
from pydantic import Field, field_validator

from testbed.fusion.analysis.indicator import FrequencyRows
from testbed.fusion.base import Rows, Switch
from testbed.fusion.kernels.bank import bank_kernel
from testbed.fusion.kernels.covariance import JOSEPH, NODES
from testbed.fusion.model import TIME_UNIT
from testbed.fusion.model_filter import FormParameters, ModelFilter
from testbed.fusion.transitions import EVEN, Steps, even, transition_nodes
from testbed.units import DEG, PositiveDuration

if TYPE_CHECKING:
    from collections.abc import Mapping

    from testbed.fusion.belief import SensorBelief
    from testbed.parts import Part
    from testbed.signals import FloatArray


class WidebandParameters(FormParameters):
    """Parameters of `Wideband`; q, here the lowest of the bank, is 1e4 (deg/s)^2/s^5 for order 3.

    Parameters
    ----------
    decades : float
        The highest q of the bank over the lowest, in powers of ten.
    filters : int
        Number of filters, their q evenly spaced in logarithm.
    memory : float
        Time constant with which old readings lose their say on the weights [s]; 50 ms is a factor of 0.999 per sample
        at 20 kHz.
    restart : float
        A filter slower than the most likely one, and by the factor exp(-restart) less likely, starts again from that
        one's state.
    surprise : float
        A reading is refused if the mixture finds it that many standard deviations off.
    patience : int
        Readings that the gate may refuse in a row: what lasts longer is taken for the signal.
    """

    default_q: ClassVar[dict[int, float]] = {3: 1e4 * DEG**2}

    coloured: Switch = True
    order: Annotated[int, Field(ge=1, le=3)] = 3
    decades: Annotated[float, Field(gt=0.0, le=30.0)] = 15.0
    filters: Annotated[int, Field(ge=2, le=32)] = 16
    memory: PositiveDuration = 0.05
    restart: Annotated[float, Field(gt=0.0)] = 20.0
    surprise: Annotated[float, Field(ge=3.0, le=1e6)] = 10.0
    patience: Annotated[int, Field(ge=0)] = 10

    @field_validator("q", mode="after")
    @classmethod
    def _a_multiple_of_it_is_more(cls, value: float) -> float:
        if not value > 0.0:
            msg = f"expected more than 0, since the highest q of the bank is a multiple of it, got {value:g}"
            raise ValueError(msg)
        return value


class Wideband(ModelFilter):
    r"""Bank of Kalman filters, one per level of process noise, mixed by innovation likelihood.

    .. math:: w_i \propto e^{s_i}, \quad s_i \leftarrow \lambda s_i - \tfrac12 (\ln C_i + e_i^2 / C_i), \quad
        \hat x = \sum w_i \hat x_i, \quad P = \sum w_i (P_i + (\hat x_i - \hat x)^2)

    with e_i the innovation of filter i, C_i its variance and :math:`\lambda = e^{-T/\mathrm{memory}}`. The filters run
    side by side and differ in how fast a signal they expect. One that is too slow for the signal spoils its slow
    states, which take half a minute to recover: it is given state and covariance of the best filter until it does
    better. A square beyond that of `surprise` counts by its logarithm. No band, no threshold on the signal.
    Refused readings (spikes) are treated as missing; the diagnostic `refused_<sensor>` counts them, `log10_q` is the
    weighted mean of log10 q [rad^2/s^(2m+1)].

    Parameters
    ----------
    belief : mapping of str to SensorBelief
        Dynamics and noise of each sensor.
    sample_rate_hz : mapping of str to float
        Rate of each sensor [Hz].
    parameters : WidebandParameters
        Bank, mixing, and what is refused.

    References
    ----------
    Magill, IEEE Trans. Automatic Control 10 (1965) 434-439 (bank of filters weighted by likelihood); Bar-Shalom, Li,
    Kirubarajan, Estimation with Applications to Tracking and Navigation (2001), section 11.6.2 (static multiple
    models), here with forgetting.
    """

    Parameters: ClassVar[type[Part]] = WidebandParameters
    rows = Rows(("log10_q",), ("innovation", "innovation_variance", "refused"))
    fault_leaves = (0.4 * DEG, 0.1 * DEG)

    def __init__(
        self, belief: Mapping[str, SensorBelief], sample_rate_hz: Mapping[str, float], parameters: WidebandParameters
    ) -> None:
        super().__init__(belief, sample_rate_hz, parameters)
        self.frequency = FrequencyRows(belief, sample_rate_hz)
        q = parameters.q * np.logspace(0.0, parameters.decades, parameters.filters)
        self._R = self.measurement_noise("R", {}, explicit=False)
        self._Q = self._noise_of_bank(belief, sample_rate_hz, parameters, q)
        self._even = even(self.model.F, self._Q, self.model.Q)
        self._levels, self._parameters = np.log10(q), parameters
        self._x = np.repeat(self._x[:, None], q.size, axis=1)
        self._P = np.repeat(self._P[:, :, None], q.size, axis=2)
        self._score = np.zeros(q.size)
        self._watch = np.zeros((self._R.size, 2))
        forget = math.exp(-1.0 / (self.model.sample_rate_hz * parameters.memory))
        self._setting = np.array([0.0, forget, parameters.surprise, parameters.patience, parameters.restart])
        self._columns = _columns(self.model.F), _columns(self.model.H)
        self._run = bank_kernel(len(self._x), self._R.size, q.size, self._form, self.model.n_slow)

    @property
    def step_seconds(self) -> float:
        """About how long a step of all filters of the bank takes, compiled, on a core of 2020 [s]."""
        return self._levels.size * super().step_seconds

    def _noise_of_bank(
        self,
        belief: Mapping[str, SensorBelief],
        sample_rate_hz: Mapping[str, float],
        parameters: WidebandParameters,
        q: FloatArray,
    ) -> FloatArray:
        """Return Q of each filter as the recursion carries it, shape (n_state, n_state, n_filter)."""
        models = [parameters.build(belief, sample_rate_hz, float(one)) for one in q]
        return np.ascontiguousarray(np.stack([self.carried(model.Q) for model in models], axis=2))

    def _tables(self) -> tuple[FloatArray, ...]:
        """Return the tables of F, of Q for each filter of the bank, and of what is the same for all."""
        model, parameters = self.model, self._parameters
        unit = np.zeros_like(model.Qc)
        last = parameters.order - 1
        unit[last, last] = TIME_UNIT ** (2 * last)
        step = 1.0 / model.sample_rate_hz
        F, slow = transition_nodes(model.A, model.Qc - parameters.q * unit, step)
        _, fast = transition_nodes(model.A, unit, step)
        n = len(F[0]) - model.n_slow if self._form == JOSEPH else len(F[0])
        Q = np.empty((len(F), n, n, self._levels.size))
        for j, (own, of_signal) in enumerate(zip(slow, fast, strict=True)):
            for m, q in enumerate(10.0**self._levels):
                Q[j, :, :, m] = self.carried(own + q * of_signal)[:n, :n]
        # To the bit what it has at regular steps.
        Q[NODES] = self._Q[:n, :n]
        shared = slow + parameters.q * fast
        shared[NODES] = model.Q
        return F, Q, shared

    def _advance(self, Z: FloatArray, out: FloatArray, steps: Steps = EVEN) -> None:
        model, (of_F, of_H) = self.model, self._columns
        mixing = (self._clocked(steps), self._score, self._watch, self._setting, self._levels)
        self._run(self._x, self._P, model.F, of_F, self._Q, model.Q, model.H, of_H, self._R, Z, *mixing, out)


def _columns(matrix: FloatArray) -> np.ndarray:
    """Return for each row the columns that are not zero, then unused places, their number last; shape (n_row, n_column
    + 1).
    """
    columns = np.zeros((matrix.shape[0], matrix.shape[1] + 1), dtype=np.int64)
    for row, values in zip(columns, matrix, strict=True):
        (at,) = np.nonzero(values)
        row[: at.size], row[-1] = at, at.size
    return columns
