"""The settled filter that is nowhere much worse than the best one: a design for a signal of unknown frequency."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from testbed.fusion.analysis.optimum import DECADES, settled_filters

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from testbed.fusion.belief import SensorBelief

_FREQ_HZ = np.geomspace(0.1, 500.0, 31)


@dataclass(frozen=True)
class EvenDesign:
    """A signal model and how far from the best it may be.

    Parameters
    ----------
    order : int
        Order m of the signal model.
    q : float
        Its noise [rad^2/s^(2m+1)].
    largest_ratio : float
        Largest error over the optimum of the same sine [-].
    """

    order: int
    q: float
    largest_ratio: float


def most_even(
    belief: Mapping[str, SensorBelief],
    sample_rate_hz: Mapping[str, float],
    amplitude: float,
    *,
    orders: Sequence[int] = (1, 2, 3),
) -> EvenDesign:
    r"""Return the settled filter whose largest error over the optimum, for sines from 0.1 to 500 Hz, is least.

    .. math:: \min_{m, q} \max_f \frac{\sigma_{m,q}^2 + A^2 |E_{m,q}(f)|^2 / 2}{\min_{m', q'} (\ldots)}

    over the orders and the decades of q of the optimum, white noise.

    Parameters
    ----------
    belief : mapping of str to SensorBelief
        What the sensors are.
    sample_rate_hz : mapping of str to float
        Rate of each [Hz].
    amplitude : float
        A [rad/s].
    orders : sequence of int, optional
        Orders of the signal model.
    """
    truth = np.array([belief[name].realisation().response(_FREQ_HZ) for name in sample_rate_hz])
    designs, errors = [], []
    for order in orders:
        low, high = DECADES[order]
        q = np.logspace(low, high, high - low + 1)
        filters = settled_filters(belief, sample_rate_hz, order=order, q=q)
        lag = filters.line_error(_FREQ_HZ, truth) ** 2 * amplitude**2 / 2.0
        errors.append(np.sqrt(filters.noise_variance().sum(axis=0)[:, None] + lag))
        designs += [(order, float(one)) for one in q]
    # A filter that never settles, as of a lone sensor that sees no constant, has no error.
    every = np.concatenate(errors)
    every = np.where(np.isfinite(every), every, np.inf)
    ratio = (every / every.min(axis=0)).max(axis=1)
    best = int(np.argmin(ratio))
    return EvenDesign(*designs[best], float(ratio[best]))
