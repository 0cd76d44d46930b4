"""A transfer function and a dead time, how well they are known, and how likely they are."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from testbed.signals import ComplexArray, FloatArray

# How often a sensor is early, or has a zero on the right that its response shows: to a record of few frequencies such a
# zero, or a pole beside an output that is early, is what a dead time is.
_ODDS = 1e-4
# Standard deviations from which on a value is no chance.
SURE = 4.0
# How many times its own interval those of other structures make that of the dead time before it is said.
_OPEN = 3.0


@dataclass(frozen=True)
class SensorModel:
    """A transfer function with dead time, and how well it is known.

    Parameters
    ----------
    numerator, denominator : ndarray, shapes (n_num,), (n_den,)
        Coefficients in s, highest power first; the denominator starts with 1.
    delay : float
        Dead time [s]; below zero the output is early, as it is where the clocks did not begin together.
    covariance : ndarray, shape (n_parameter, n_parameter)
        Of the numerator without its zeros by form, of the denominator without its 1, and of the delay if `delayed`.
    free : int
        Number of coefficients of the numerator that were fitted, the first ones.
    delayed : bool
        Whether a dead time was fitted.
    misfit, freedom : float, int
        -2 ln of the likelihood over that of the measured values themselves, and its degrees of freedom [-].
    n_data : int
        Number of real values that those are from.
    worst : float
        Largest |fit / measured - 1| [-].
    turned : float
        By how many standard deviations of one frequency's phase zeros on the right turn it, at most [-].
    delay_span : tuple of float
        The dead times of all structures that the record allows, each with its 95 % interval [s].
    """

    numerator: FloatArray
    denominator: FloatArray
    delay: float
    covariance: FloatArray
    free: int
    delayed: bool
    misfit: float
    freedom: int
    n_data: int
    worst: float
    turned: float
    delay_span: tuple[float, float] = (0.0, 0.0)

    def response(self, freq_hz: FloatArray) -> ComplexArray:
        """Return the response at frequencies [Hz], complex, shape (n_freq,) [-]."""
        s = 2j * np.pi * np.asarray(freq_hz)
        value: ComplexArray = np.polyval(self.numerator, s) / np.polyval(self.denominator, s) * np.exp(-s * self.delay)
        return value

    @property
    def delay_std(self) -> float:
        """Standard deviation of the dead time [s], 0 where there is none by form."""
        return float(np.sqrt(self.covariance[-1, -1])) if self.delayed else 0.0

    @property
    def delay_is_open(self) -> bool:
        """Whether other structures that the record allows have other dead times, so that it does not decide."""
        low, high = self.delay_span
        return high - low > _OPEN * 2.0 * 1.96 * self.delay_std

    @property
    def criterion(self) -> float:
        """Bayes' criterion: of two models the one with less is the more likely [-]."""
        strange = (self.delay < -SURE * self.delay_std) + (self.turned > SURE)
        return self.misfit + len(self.covariance) * float(np.log(self.n_data)) - 2.0 * strange * float(np.log(_ODDS))
