"""A filter that corrects gain and delay of one of its two sensors while it runs."""

from __future__ import annotations

import math
from collections import deque
from copy import copy
from typing import TYPE_CHECKING, Annotated, Any, ClassVar

import numpy as np
from pydantic import Field, ValidationError, ValidationInfo, field_validator

from testbed.errors import quoted, shortened
from testbed.fusion.analysis.calibration import Calibrated, Calibration
from testbed.fusion.analysis.indicator import FrequencyRows
from testbed.fusion.base import BlockFilter, CommonParameters, Rows
from testbed.fusion.belief import SensorBelief
from testbed.fusion.kernels.covariance import HEADER_ROWS
from testbed.fusion.model_filter import FilterParameters, ModelFilter
from testbed.fusion.realisation import Realisation
from testbed.parts import resolve
from testbed.units import DEG, PositiveDuration

if TYPE_CHECKING:
    from collections.abc import Mapping

    from testbed.fusion.model import FusionModel
    from testbed.parts import Part
    from testbed.signals import FloatArray

    Held = tuple[FloatArray, ...]

# What goes on with another belief from the state that it has, and the attributes that are that state.
_INNER = {
    "kalman": ("testbed.fusion.filters.kalman:Kalman", ("_x", "_P", "_started")),
    "wideband": ("testbed.fusion.filters.wideband:Wideband", ("_x", "_P", "_score", "_watch")),
}
# The lag of a sensor without any [s], so that there always is a state of it. The estimate leads by it: 10 us would cost
# 15 % on the jitter of a wheel.
_LEAST_LAG = 1e-6
# From this change of gain [-] and lag [s] on, and from this share of their standard deviations on, the last seconds, as
# many at the most, are filtered again: less is no news, and each time costs as much as these seconds did.
_GAIN_CHANGE, _LAG_CHANGE, _NEWS, _AGAIN = 5e-4, 2e-5, 0.5, 10
_MOST_FINDINGS = 5
_OWN = ("gain", "gain_std", "delay", "delay_std")


class LateBelief(SensorBelief):
    """A belief with one pole more behind the dynamics, which stays one state whatever its lag is.

    Parameters
    ----------
    lag : float
        Its time constant [s].
    """

    lag: PositiveDuration = _LEAST_LAG

    @property
    def n_state(self) -> int:
        """Number of states of the realisation, the last one that of the lag."""
        return super().n_state + 1

    def realisation(self) -> Realisation:
        """Return the realisation of the dynamics, then the lag: y' = (C x + D u - y) / lag."""
        one = super().realisation()
        n = one.B.size
        A = np.zeros((n + 1, n + 1))
        A[:n, :n], A[n, :n], A[n, n] = one.A, one.C / self.lag, -1.0 / self.lag
        C = np.zeros(n + 1)
        C[n] = 1.0
        return Realisation(A, np.append(one.B, one.D / self.lag), C, 0.0)


class SelfCalibratingParameters(CommonParameters):
    """Parameters of `SelfCalibrating`.

    Parameters
    ----------
    filter : mapping
        The filter that estimates, by its type, with its parameters: ``{wideband: {}}`` or ``{kalman: {order: 3}}``.
    gain_std : float
        How far from one the gain may be, as a standard deviation [-].
    delay_std : float
        How late one sensor may be against the other, likewise [s].
    """

    filter: dict[str, dict[str, Any]] = Field(default={"wideband": {}}, min_length=1, max_length=1)
    gain_std: Annotated[float, Field(gt=0.0, le=1.0)] = 0.01
    delay_std: PositiveDuration = 5e-4

    @field_validator("filter")
    @classmethod
    def _check_filter(cls, value: dict[str, dict[str, Any]], info: ValidationInfo) -> dict[str, dict[str, Any]]:
        ((name, given),) = value.items()
        if name not in _INNER:
            msg = f"expected one of {list(_INNER)}, which can go on with another belief, got {quoted(name)}"
            raise ValueError(msg)
        try:
            inner = _inner_class(name).Parameters.model_validate(given, context=info.context)
        except ValidationError as error:
            found = [f"{name}.{shortened('.'.join(map(str, one['loc'])))}: {one['msg']}" for one in error.errors()]
            msg = "; ".join(found[:_MOST_FINDINGS])
            raise ValueError(msg) from error
        if isinstance(inner, FilterParameters) and inner.order == 1:
            msg = f"{name}: expected order 2 or 3, since one of order 1 cannot extrapolate over a delay"
            raise ValueError(msg)
        return value


class SelfCalibrating(BlockFilter):
    r"""Another filter, whose belief in gain and delay follows what its two sensors say of each other.

    Second after second gain and delay of the noisy sensor against the clean one are estimated from all readings so far
    (`testbed.fusion.analysis.calibration`), and hold for the next second. The readings of one sensor are divided by the
    gain, of the one that is blind to a constant rate; the delay is a pole behind the dynamics of whichever sensor is
    late. After a change the filter goes once more through the last ten seconds. What both sensors share cannot be seen.

    Stamps, and rates without a whole ratio, are refused: the spectra that are compared need both sensors at the same
    instants, and two clocks share none. Interpolated to them a sensor loses gain by where they fall between its
    readings, and clocks that drift apart, where the stamps do not tell, are a delay that grows, not one that lasts.

    Parameters
    ----------
    belief : mapping of str to SensorBelief
        Dynamics and noise of two sensors, one of which sees a constant rate.
    sample_rate_hz : mapping of str to float
        Rate of each sensor [Hz].
    parameters : SelfCalibratingParameters
        The filter, and the prior.

    Raises
    ------
    ValueError
        If there are not two sensors, or the filter refuses belief or rates.

    References
    ----------
    Soderstrom, Errors-in-Variables Methods in System Identification (2018); Baranchik, Annals of Mathematical
    Statistics 41 (1970) 642-645 (positive-part shrinkage).
    """

    Parameters: ClassVar[type[Part]] = SelfCalibratingParameters
    needs_both = True
    caution = "what both sensors share, a gain or a delay, cannot be seen"
    start_leaves = (0.0045 * DEG, 0.0045 * DEG)

    def __init__(
        self,
        belief: Mapping[str, SensorBelief],
        sample_rate_hz: Mapping[str, float],
        parameters: SelfCalibratingParameters,
    ) -> None:
        super().__init__(belief, sample_rate_hz, parameters)
        ((self._name, given),) = parameters.filter.items()
        common = parameters.model_dump(include={"start", "rest_rate"})
        self._inner_parameters = _inner_class(self._name).Parameters(**{**common, **given, "gate": False})
        self._rates = dict(sample_rate_hz)
        self.frequency = FrequencyRows(belief, sample_rate_hz)
        self._belief = {name: LateBelief(**belief[name].model_dump() | {"lag": _LEAST_LAG}) for name in sample_rate_hz}
        self._inner = self._built(self._belief)
        self.rows = Rows((*_OWN, *self._inner.rows.once), self._inner.rows.per_sensor)
        self._noisy, self._clean = _roles(belief, list(sample_rate_hz))
        blind = belief[self.schedule.sensors[self._noisy]].sees_constant
        # Whose readings are divided, and by the gain or its inverse.
        self._scaled, self._power = (self._clean, -1.0) if blind else (self._noisy, 1.0)
        strides = self.schedule.strides
        self._stride = max(strides)
        slow_hz = self.schedule.sample_rate_hz / self._stride
        one, other = (belief[self.schedule.sensors[i]] for i in (self._noisy, self._clean))
        means = self._stride // strides[self._noisy], self._stride // strides[self._clean]
        priors, at_rest = (parameters.gain_std, parameters.delay_std), parameters.start == "rest"
        self._calibration = Calibration(one, other, slow_hz, means, *priors, at_rest=at_rest)
        self._known = Calibrated(1.0, 0.0, parameters.gain_std, parameters.delay_std)
        self._gain, self._lags = 1.0, np.full(2, _LEAST_LAG)
        self._second = np.full((2, round(slow_hz) * self._stride), math.nan)
        self._filled = 0
        # Of the last seconds the readings, and the state before them.
        self._past: deque[tuple[dict[str, Any], Held]] = deque(maxlen=_AGAIN)

    @property
    def model(self) -> FusionModel:
        """The augmented model of the filter inside, as it is now."""
        return self._inner.model

    @property
    def step_seconds(self) -> float:
        """About how long a step takes, compiled, on a core of 2020 [s]: that of the filter inside."""
        return self._inner.step_seconds + 2e-8

    def _advance(self, Z: FloatArray, out: FloatArray) -> None:  # type: ignore[override]
        n, at = Z.shape[1], 0
        while at < n:
            if self._filled == 0:
                self._past.append((self._state(), ()))
            part = slice(at, min(n, at + self._second.shape[1] - self._filled))
            length = part.stop - part.start
            self._second[:, self._filled : self._filled + length] = Z[:, part]
            self._filled, at = self._filled + length, part.stop
            self._estimate(Z[:, part], out[:, part])
            if self._filled == self._second.shape[1]:
                self._past[-1] = self._past[-1][0], self._held()
                self._learn()
                self._filled = 0

    def _estimate(self, Z: FloatArray, out: FloatArray) -> None:
        made = self._filtered(Z)
        out[:HEADER_ROWS], out[HEADER_ROWS + len(_OWN) :] = made[:HEADER_ROWS], made[HEADER_ROWS:]
        known = self._known
        own = (known.gain, known.gain_std, known.delay, known.delay_std)
        out[HEADER_ROWS : HEADER_ROWS + len(_OWN)] = np.array(own)[:, None]

    def _filtered(self, Z: FloatArray) -> FloatArray:
        """Return what the filter inside gives for readings, corrected by the gain."""
        corrected = Z.copy()
        corrected[self._scaled] /= self._gain**self._power
        corrected.flags.writeable = False
        made = np.full((HEADER_ROWS + len(self._inner.rows.names(self.schedule.sensors)), Z.shape[1]), np.nan)
        self._inner._advance(corrected, made)
        return made

    def _learn(self) -> None:
        """Take the second that is full, and what it says of gain and delay for the next one.

        What the slow states learned from the last seconds under another gain or delay they would keep for half a
        minute: after a change the filter goes through those seconds again.
        """
        self._known = self._calibration.add(*(self._second_of(i) for i in (self._noisy, self._clean)))
        gain, delay = self._known.applied()
        lags = np.full(2, _LEAST_LAG)
        lags[self._noisy if delay > 0.0 else self._clean] += abs(delay)
        change = float(np.max(np.abs(lags - self._lags)))
        least_gain = max(_GAIN_CHANGE, _NEWS * self._known.gain_std)
        least_lag = max(_LAG_CHANGE, _NEWS * self._known.delay_std)
        if abs(gain - self._gain) < least_gain and change < least_lag:
            return
        self._gain, self._lags = gain, lags
        belief = {
            name: self._belief[name].model_copy(update={"lag": float(lag)})
            for name, lag in zip(self.schedule.sensors, lags, strict=True)
        }
        past = list(self._past)
        self._inner = self._built(belief)
        for name, value in past[0][0].items():
            setattr(self._inner, name, value)
        self._past.clear()
        for _, held in past:
            self._past.append((self._state(), held))
            self._filtered(self._laid(held))

    def _held(self) -> Held:
        """Return the readings of the second, of each sensor those that are due: the rest is empty."""
        return tuple(z[::stride].copy() for z, stride in zip(self._second, self.schedule.strides, strict=True))

    def _laid(self, held: Held) -> FloatArray:
        """Return the second of which these readings were."""
        Z = np.full_like(self._second, math.nan)
        for z, readings, stride in zip(Z, held, self.schedule.strides, strict=True):
            z[::stride] = readings
        return Z

    def _state(self) -> dict[str, Any]:
        return {name: copy(getattr(self._inner, name)) for name in _INNER[self._name][1]}

    def _second_of(self, which: int) -> FloatArray:
        """Return the readings of a sensor in the second at the slow rate [rad/s], of a fast one the mean of those that
        are there, if they are half of them.
        """
        stride = self.schedule.strides[which]
        due = self._second[which, ::stride].reshape(-1, self._stride // stride)
        good = np.isfinite(due)
        n = good.sum(axis=1)
        total = np.where(good, due, 0.0).sum(axis=1)
        means: FloatArray = np.where(2 * n >= due.shape[1], total / np.maximum(n, 1), math.nan)
        return means

    def _built(self, belief: Mapping[str, SensorBelief]) -> ModelFilter:
        filter_class = _inner_class(self._name)
        inner: ModelFilter = filter_class(belief, self._rates, self._inner_parameters)
        return inner


def _inner_class(name: str) -> type[Any]:
    return resolve("filter", name, {key: place for key, (place, _) in _INNER.items()})


def _roles(belief: Mapping[str, SensorBelief], sensors: list[str]) -> tuple[int, int]:
    """Return the numbers of the noisy and of the clean sensor, by their noise referred to the rate from 1 to 30 Hz."""
    freq = np.geomspace(1.0, 30.0, 16)
    loud = []
    for name in sensors:
        one = belief[name]
        gain = np.maximum(np.abs(one.response(freq)), 1e-30) ** 2
        density = one.input_noise**2 + one.output_noise**2 / gain
        loud.append(float(np.mean(np.log(np.maximum(density, 1e-300)))))
    return int(np.argmax(loud)), int(np.argmin(loud))
