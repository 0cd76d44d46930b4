"""What jitter costs an optical link: the mean loss and the outage of a Gaussian beam."""

from __future__ import annotations

import math


def mean_loss(jitter: float, divergence: float) -> float:
    r"""Return the mean received power over that of a beam that does not move, :math:`1 / (1 + 4 s^2 / w^2)`.

    For Gaussian jitter of s about each of two axes and the intensity exp(-2 r^2 / w^2).

    Parameters
    ----------
    jitter : float
        s, rms about one axis [rad].
    divergence : float
        w, half angle at 1/e^2 of the intensity [rad].

    Returns
    -------
    float
        Ratio of powers [-].
    """
    return 1.0 / (1.0 + 4.0 * (jitter / divergence) ** 2)


def outage(jitter: float, divergence: float, level: float) -> float:
    r"""Return the share of time below a level of the power, :math:`P = L^{w^2 / 4 s^2}`.

    Parameters
    ----------
    jitter, divergence : float
        s and w, as for `mean_loss` [rad].
    level : float
        L over the power of a beam that does not move, between 0 and 1 [-].

    Returns
    -------
    float
        Probability [-]; 0 without jitter.
    """
    if jitter == 0.0:
        return 0.0
    return math.exp(math.log(level) * (divergence / jitter) ** 2 / 4.0)
