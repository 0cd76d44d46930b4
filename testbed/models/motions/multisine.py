"""Many sines of one amplitude with a low crest factor."""

from __future__ import annotations

from typing import TYPE_CHECKING, Annotated, Any, ClassVar, Literal

import numpy as np
from pydantic import Field, model_validator

from testbed.models.motion import Motion, RateFunction
from testbed.units import Angle, Frequency, Rate

if TYPE_CHECKING:
    from typing import Self

    from testbed.signals import FloatArray


class Multisine(Motion):
    r"""Sum of sines of equal amplitude with a low crest factor.

    :math:`\sum_i a_i \sin(2\pi f_i t + \varphi_i)` with n frequencies.
    Schroeder's phases :math:`\varphi_i = -\pi i (i - 1)/n` (i = 1 ... n) keep the crest factor low (M. Schroeder, IEEE
    Trans. Inf. Theory, 1970).

    Parameters
    ----------
    frequencies : tuple of float
        Frequencies [Hz], all different.
    rate : float, optional
        Rate amplitude of every line [rad/s]; exactly one of `rate` and `angle` is given.
    angle : float, optional
        Angle amplitude of every line [rad]; the rate amplitude is 2 pi f times it.
    phases : {"schroeder", "random", "zero"}, optional
        How the phases are chosen; random ones come from the scenario's seed.

    Raises
    ------
    ValueError
        If neither or both amplitudes are given or a frequency is repeated.
    """

    example: ClassVar[dict[str, Any]] = {"frequencies": ["1 Hz", "3 Hz"], "rate": "1 deg/s"}

    frequencies: Annotated[tuple[Frequency, ...], Field(min_length=1)]
    rate: Rate | None = None
    angle: Angle | None = None
    phases: Literal["schroeder", "random", "zero"] = "schroeder"

    @model_validator(mode="after")
    def _consistent(self) -> Self:
        if (self.rate is None) == (self.angle is None):
            msg = "expected exactly one of rate (such as '1 deg/s') and angle (such as '5 mrad')"
            raise ValueError(msg)
        if len(set(self.frequencies)) != len(self.frequencies):
            msg = "frequencies: expected all different"
            raise ValueError(msg)
        return self

    @property
    def draws(self) -> bool:
        """Whether it is random; see `Motion.draws`."""
        return self.phases == "random"

    def start(self, duration: float, rng: np.random.Generator) -> RateFunction:
        """Return the rate [rad/s] as a function of time [s]."""
        w = 2.0 * np.pi * np.array(self.frequencies)
        n = w.size
        i = np.arange(1, n + 1)
        phase = {
            "schroeder": -np.pi * i * (i - 1) / n,
            "random": rng.uniform(0.0, 2.0 * np.pi, n),
            "zero": np.zeros(n),
        }[self.phases]
        amplitude = np.full(n, self.rate) if self.rate is not None else (self.angle or 0.0) * w

        def rate(t: FloatArray) -> FloatArray:
            # Line by line: memory stays that of one block, however many lines there are.
            total = np.zeros_like(t)
            for a, w_i, p in zip(amplitude, w, phase, strict=True):
                total += a * np.sin(w_i * t + p)
            return total

        return rate

    def lines(self) -> tuple[float, ...]:
        """Return the frequencies [Hz]."""
        return self.frequencies

    def top_frequency(self) -> float:
        """Return the highest frequency [Hz]."""
        return max(self.frequencies)
