"""Closed-loop blending: the integrated fast sensor, its drift held by the inverse of the slow one through a
proportional-integral loop.
"""

from __future__ import annotations

from testbed.fusion.two_paths.base import TwoPaths


class Blending(TwoPaths):
    r"""Closed-loop blending of an inverted fast sensor with a slow one.

    .. math:: \hat\omega = B\, z_{fast} / G_{fast} + u, \quad \dot u = \sqrt 2 w e + c, \quad \dot c = w^2 e, \quad
        e = B\, z_{slow} / G_{slow} - \hat\omega

    The inverse integrates what the fast sensor does not see at low frequency, and with it the noise; u takes that drift
    away. The loop is a Butterworth low-pass of order 2, the error 1 - L starts with s^2: an offset of the fast sensor,
    which the complementary filter of order 1 turns into a constant error, is integrated away.

    Parameters
    ----------
    belief : mapping of str to SensorBelief
        Dynamics and noise of two sensors.
    sample_rate_hz : mapping of str to float
        Rate of each sensor [Hz].
    parameters : TwoPathParameters
        What it is made for.

    References
    ----------
    Brown, Hwang, Introduction to Random Signals and Applied Kalman Filtering (2012), chapter 8 (feedback form of the
    complementary filter); Franklin, Powell, Workman, Digital Control of Dynamic Systems (1998), chapter 4 (sampled
    loops).
    """

    order = 2
