"""The interacting multiple model of Blom and Bar-Shalom, as published: nothing in it is tuned here."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Annotated, Any, ClassVar

import numpy as np
from pydantic import Field

from testbed.fusion.base import BlockFilter, Rows
from testbed.fusion.filters.kalman import KalmanParameters
from testbed.fusion.kernels.literature import imm_kernel
from testbed.fusion.model_filter import FilterParameters, initial_state
from testbed.fusion.transitions import EVEN, Steps, even, transition_nodes
from testbed.units import DEG, Quantity

if TYPE_CHECKING:
    from collections.abc import Mapping

    from testbed.fusion.belief import SensorBelief
    from testbed.parts import Part
    from testbed.signals import FloatArray

# Beyond that the chance to leave within a step is none in double precision, and a model once out never returns.
Sojourn = Annotated[float, Quantity("s", "1 s", above=0.0, at_most=1e6)]
Share = Annotated[float, Field(ge=1e-12, le=1e12)]


class ImmParameters(FilterParameters):
    """Parameters of `Imm`; its signal model is that of `kalman`.

    Parameters
    ----------
    ratios : tuple of float
        The q of each model over `q` [-]: calm, as usual, agile.
    sojourn : float
        Mean time that the signal stays with a model [s].
    """

    default_q: ClassVar[dict[int, float]] = KalmanParameters.default_q

    ratios: Annotated[tuple[Share, ...], Field(min_length=1, max_length=8)] = (0.01, 1.0, 100.0)
    sojourn: Sojourn = 1.0


class Imm(BlockFilter):
    r"""Interacting multiple model: Kalman filters whose signal noise q differs, under a Markov chain.

    With :math:`p_{ij}` the chance to go from model i to model j within a step, each step

    .. math:: c_j = \sum_i p_{ij} \mu_i,\quad \mu_{i|j} = p_{ij} \mu_i / c_j,\quad
        x_{0j} = \sum_i \mu_{i|j} x_i,\quad P_{0j} = \sum_i \mu_{i|j} [P_i + (x_i - x_{0j})(x_i - x_{0j})'],

    predicts and updates each filter from :math:`x_{0j}, P_{0j}`, weighs it by the likelihood of its innovations,
    :math:`\mu_j \propto c_j \prod N(e_j; 0, S_j)`, and gives :math:`x = \sum \mu_j x_j` and
    :math:`P = \sum \mu_j [P_j + (x_j - x)(x_j - x)']`. Where no reading is due the chain goes on by itself.

    Parameters
    ----------
    belief : mapping of str to SensorBelief
        Dynamics and noise of each sensor.
    sample_rate_hz : mapping of str to float
        Rate of each sensor [Hz].
    parameters : ImmParameters
        Signal model, the models and their chain.

    References
    ----------
    Blom, Bar-Shalom, IEEE Trans. Automatic Control 33 (1988) 780-783 (doi 10.1109/9.1299).
    """

    Parameters: ClassVar[type[Part]] = ImmParameters
    any_clock = True
    caution = (
        "from an unknown start a model too slow for the signal spoils what the start leaves open, and all models mix "
        "it in: for seven seconds the error may be ten times the claim"
    )
    start_leaves = (0.0045 * DEG, 0.0045 * DEG)

    def __init__(
        self, belief: Mapping[str, SensorBelief], sample_rate_hz: Mapping[str, float], parameters: ImmParameters
    ) -> None:
        super().__init__(belief, sample_rate_hz, parameters)
        self.model, self._calmest = (parameters.build(belief, sample_rate_hz, q) for q in (parameters.q, 0.0))
        self._ratios = parameters.ratios
        self._Q = self._mixed(self.model.Q, self._calmest.Q)
        self._even = even(self.model.F, self._Q)
        self._nodes: tuple[FloatArray, FloatArray] | None = None
        if not np.all(self.model.R > 0.0):
            msg = f"belief: expected an output_noise above 0 for each of {list(self.model.sensors)}"
            raise ValueError(msg)
        count = len(parameters.ratios)
        self.rows = Rows(tuple(f"probability_{j}" for j in range(count)), ("innovation", "innovation_variance"))
        self._X = np.tile(initial_state(self.model, parameters), (count, 1))
        self._P = np.tile(self.model.P0, (count, 1, 1))
        self._mu, self._started = np.full(count, 1.0 / count), False
        self._stay = math.exp(-1.0 / (parameters.sojourn * self.model.sample_rate_hz))

    @property
    def step_seconds(self) -> float:
        """About how long a step takes, compiled, on a core of 2020 [s]."""
        count, n = self._X.shape
        return 1e-7 + 2e-9 * float(count * (2 + count) * n**2)

    def _mixed(self, usual: FloatArray, calmest: FloatArray) -> FloatArray:
        """Return Q of each model: they differ in the part alone that is proportional to q."""
        return np.array([calmest + ratio * (usual - calmest) for ratio in self._ratios])

    def _clocked(self, steps: Steps) -> tuple[Any, ...]:
        """Return `steps` and the tables as the kernel takes them."""
        if steps is EVEN:
            return self._even
        if self._nodes is None:
            A, step = self.model.A, 1.0 / self.model.sample_rate_hz
            F, usual = transition_nodes(A, self.model.Qc, step)
            self._nodes = F, self._mixed(usual, transition_nodes(A, self._calmest.Qc, step)[1])
        return (*steps, *self._nodes)

    def _advance(self, Z: FloatArray, out: FloatArray, steps: Steps = EVEN) -> None:
        model, chain = (self.model.F, self._Q, self.model.H, self.model.R), (self._stay, self._mu, self._started)
        self._started = imm_kernel(self._X, self._P, *model, *chain, Z, self._clocked(steps), out)
