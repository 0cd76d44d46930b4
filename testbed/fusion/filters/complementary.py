"""The complementary filter: a low-pass of the inverted slow sensor, the matching high-pass of the inverted fast one."""

from __future__ import annotations

from testbed.fusion.two_paths.base import TwoPaths


class Complementary(TwoPaths):
    r"""Fixed complementary filter of two inverted sensors.

    .. math:: \hat\omega = B \left( L \frac{z_{slow}}{G_{slow}} + (1 - L) \frac{z_{fast}}{G_{fast}} \right)

    L = w_c / (s + w_c): the paths add up to B, which is 1 up to the bandwidth (`testbed.fusion.two_paths.design`). For
    a fast sensor whose noise rises as 1/f towards low frequency and white noise of the slow one no causal L is better.
    From the start and through gaps: `TwoPaths`.

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
    Brown, Hwang, Introduction to Random Signals and Applied Kalman Filtering (2012), chapter 8 (complementary filter);
    Higgins, IEEE Trans. Aerospace and Electronic Systems 11 (1975) 321-325 (its equivalence to the settled Kalman
    filter).
    """

    order = 1
