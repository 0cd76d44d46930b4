"""The variational-Bayes adaptive Kalman filter of Sarkka and Nummenmaa, as published: nothing in it is tuned here."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Annotated, ClassVar

import numpy as np
from pydantic import Field

from testbed.fusion.base import Rows
from testbed.fusion.filters.kalman import KalmanParameters
from testbed.fusion.kernels.literature import vb_akf_kernel
from testbed.fusion.model_filter import FilterParameters, ModelFilter
from testbed.fusion.transitions import EVEN, Steps

if TYPE_CHECKING:
    from collections.abc import Mapping

    from testbed.fusion.belief import SensorBelief
    from testbed.parts import Part
    from testbed.signals import FloatArray


class VbAkfParameters(FilterParameters):
    """Parameters of `VbAkf`; its signal model is that of `kalman`.

    Parameters
    ----------
    forget : float
        rho of the variances' own dynamics, per reading, above 0 and at most 1. 1 - exp(-4) = 0.982 is what published
        implementations of the paper take; it forgets within 55 readings.
    iterations : int
        N of the fixed-point iteration in each step. Implementations recommend 2 or 3 and take 2 to 5; at 5 it has come
        to its fixed point.
    """

    default_q: ClassVar[dict[int, float]] = KalmanParameters.default_q

    forget: Annotated[float, Field(gt=0.0, le=1.0)] = 1.0 - math.exp(-4.0)
    iterations: Annotated[int, Field(ge=1, le=100)] = 5


class VbAkf(ModelFilter):
    r"""Kalman filter that estimates the variance of each sensor's readings beside the state, by variational Bayes.

    The posterior is taken as :math:`N(x \mid m, P) \prod_i \mathrm{InvGamma}(R_i \mid \alpha_i, \beta_i)`. Prediction:
    that of the Kalman filter, and :math:`\alpha_i^- = \rho \alpha_i,\; \beta_i^- = \rho \beta_i`. Update:
    :math:`\alpha_i = \alpha_i^- + 1/2`, and from :math:`\beta_i = \beta_i^-` on N times

    .. math:: R_i = \beta_i / \alpha_i,\quad m, P \text{ by the Kalman update of } m^-, P^- \text{ with } R,\quad
        \beta_i = \beta_i^- + \tfrac12 (z_i - H_i m)^2 + \tfrac12 H_i P H_i'

    Departures: a sensor's variance has its dynamics at its own readings only, since its rate is its own, and stands
    still while none comes. It begins at the belief's R with :math:`\alpha = 1`.

    Parameters
    ----------
    belief : mapping of str to SensorBelief
        Dynamics and noise of each sensor.
    sample_rate_hz : mapping of str to float
        Rate of each sensor [Hz].
    parameters : VbAkfParameters
        Signal model and adaptation.

    References
    ----------
    Sarkka, Nummenmaa, IEEE Trans. Automatic Control 54 (2009) 596-600 (doi 10.1109/TAC.2008.2008348), the algorithm of
    section II-D. rho and N are those of public implementations that cite it, its own example was not at hand:
    github.com/r9y9/bayesian-kalmanfilter (rho = 1 - exp(-4), N = 2), and a Matlab one that recommends N of 2 or 3 and
    rho near 1.
    """

    Parameters: ClassVar[type[Part]] = VbAkfParameters
    rows = Rows(per_sensor=("innovation", "innovation_variance", "R"))

    def __init__(
        self, belief: Mapping[str, SensorBelief], sample_rate_hz: Mapping[str, float], parameters: VbAkfParameters
    ) -> None:
        super().__init__(belief, sample_rate_hz, parameters)
        self._beta = self.measurement_noise("belief", {}, explicit=False).copy()
        self._alpha = np.ones(self._beta.size)
        self._forget, self._iterations, self._started = parameters.forget, parameters.iterations, False

    @property
    def step_seconds(self) -> float:
        """About how long a step takes, compiled, on a core of 2020 [s]."""
        return 1e-7 + (2 + self._iterations) * 3e-9 * self._x.size**2

    def _advance(self, Z: FloatArray, out: FloatArray, steps: Steps = EVEN) -> None:
        model, noise = (self._F, self._Q, self._H), (self._alpha, self._beta, self._forget, self._iterations)
        self._started = vb_akf_kernel(self._x, self._P, *model, *noise, self._started, Z, self._clocked(steps), out)
