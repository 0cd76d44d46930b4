"""The complementary filter: a low-pass of the inverted slow sensor, the matching high-pass of the inverted fast one."""

from __future__ import annotations

from typing import TYPE_CHECKING, ClassVar, Literal

from pydantic import model_validator

from testbed.fusion.two_paths.base import TwoPathParameters, TwoPaths
from testbed.fusion.two_paths.design import input_psd
from testbed.fusion.two_paths.loop import shaped_loop

if TYPE_CHECKING:
    from collections.abc import Mapping
    from typing import Self

    from testbed.fusion.belief import SensorBelief
    from testbed.fusion.two_paths.base import Lag
    from testbed.fusion.two_paths.loop import Loop
    from testbed.parts import Part
    from testbed.signals import FloatArray


class ComplementaryParameters(TwoPathParameters):
    """What a complementary filter is made for.

    Parameters
    ----------
    poles : {1, 2}, optional
        Of L: one at a crossover, where the noise in all is least, or two that keep the fused density near the
        two-sensor bound everywhere. 2 if not given, 1 with a `crossover` of one's own.
    """

    poles: Literal[1, 2] | None = None

    @model_validator(mode="after")
    def _one_crossover_is_one_pole(self) -> Self:
        if self.poles == 2 and self.crossover is not None:
            msg = "poles: expected 1 beside a crossover, got 2: two poles are shaped from the belief's noise"
            raise ValueError(msg)
        return self


class Complementary(TwoPaths):
    r"""Fixed complementary filter of two inverted sensors.

    .. math:: \hat\omega = B \left( L \frac{z_{slow}}{G_{slow}} + (1 - L) \frac{z_{fast}}{G_{fast}} \right)

    The paths add up to B, which is 1 up to the bandwidth (`testbed.fusion.two_paths.design`). L has two poles, shaped
    so that the fused density comes nowhere further from the two-sensor bound than it must
    (`testbed.fusion.two_paths.loop.shaped_loop`), or one, L = w_c / (s + w_c): for a fast sensor whose noise rises as
    1/f towards low frequency and white noise of the slow one no causal L is better. From the start and through gaps:
    `TwoPaths`.

    Parameters
    ----------
    belief : mapping of str to SensorBelief
        Dynamics and noise of two sensors.
    sample_rate_hz : mapping of str to float
        Rate of each sensor [Hz].
    parameters : ComplementaryParameters
        What it is made for.

    References
    ----------
    Brown, Hwang, Introduction to Random Signals and Applied Kalman Filtering (2012), chapter 8 (complementary filter);
    Higgins, IEEE Trans. Aerospace and Electronic Systems 11 (1975) 321-325 (its equivalence to the settled Kalman
    filter).
    """

    Parameters: ClassVar[type[Part]] = ComplementaryParameters
    order = 1

    def __init__(
        self,
        belief: Mapping[str, SensorBelief],
        sample_rate_hz: Mapping[str, float],
        parameters: ComplementaryParameters,
    ) -> None:
        self._poles = parameters.poles
        super().__init__(belief, sample_rate_hz, parameters)

    def _best_loop(self, slow: SensorBelief, fast: SensorBelief, band: tuple[FloatArray, FloatArray], lag: Lag) -> Loop:
        if self._poles == 1:
            return super()._best_loop(slow, fast, band, lag)
        return shaped_loop(input_psd(slow), input_psd(fast), band, lag.of)
