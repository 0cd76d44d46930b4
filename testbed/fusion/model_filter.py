"""Filters of the augmented model: the parameters of its signal, and what the recursion carries."""

from __future__ import annotations

from typing import TYPE_CHECKING, Annotated, Any, ClassVar, Literal, cast

import numpy as np
from pydantic import Field, SerializationInfo, ValidationInfo, field_serializer, field_validator

from testbed.errors import quoted
from testbed.fusion.base import BlockFilter, CommonParameters, Switch
from testbed.fusion.kernels.covariance import CONVENTIONAL, JOSEPH, SQUARE_ROOT
from testbed.fusion.model import FusionModel, build_model, covariance_root
from testbed.fusion.transitions import EVEN, Steps, even, transition_nodes
from testbed.units import DEG, Quantity

if TYPE_CHECKING:
    from collections.abc import Mapping

    from pydantic.config import JsonDict

    from testbed.fusion.belief import SensorBelief
    from testbed.signals import FloatArray

Variance = Annotated[float, Quantity("rad^2/s^2", "6.5e-7 (deg/s)^2", above=0.0)]

FORMS = {"conventional": CONVENTIONAL, "joseph": JOSEPH, "square_root": SQUARE_ROOT}

_Q_SCHEMA = cast(
    "JsonDict", {"type": "string", "description": "(deg/s)^2/s^(2 order - 1)", "examples": ["0.3 (deg/s)^2/s"]}
)


def signal_noise_unit(order: int) -> str:
    """Return the SI unit of q for a signal model of that order: (rad/s)^2/s for 1, and s^-2 more for each further
    order.
    """
    return f"rad^2/s^{2 * order + 1}"


class FilterParameters(CommonParameters):
    """Parameters of the signal model, common to the filters.

    Parameters
    ----------
    order : int
        Number m of integrators between the white noise and the rate, 1 to 3.
    q : float
        Its density [rad^2/s^(2m+1)], such as "0.3 (deg/s)^2/s" for order 1 or "1e6 (deg/s)^2/s^3" for order 2; None
        takes the filter's own.
    use_input_noise : bool
        Count the input noise of the belief as process noise.
    coloured : bool
        Give the belief's slow noise (1/f, turn-on bias, rate random walk) states of its own.
    """

    default_q: ClassVar[dict[int, float]] = {}

    order: Annotated[int, Field(ge=1, le=3)] = 1
    q: Annotated[float, Field(validate_default=True, json_schema_extra=_Q_SCHEMA)] = cast("float", None)
    use_input_noise: bool = True
    coloured: Switch = False

    def build(self, belief: Mapping[str, SensorBelief], sample_rate_hz: Mapping[str, float], q: float) -> FusionModel:
        """Return the model of signal and sensors, stamped on any clocks.

        Parameters
        ----------
        belief : mapping of str to SensorBelief
            What is believed about each sensor.
        sample_rate_hz : mapping of str to float
            Rate of each sensor [Hz].
        q : float
            Density of the signal's noise, such as the parameter of that name.

        Raises
        ------
        ValueError
            As for `build_model`.
        """
        return build_model(
            belief,
            sample_rate_hz,
            order=self.order,
            q=q,
            use_input_noise=self.use_input_noise,
            coloured=self.coloured,
            start=self.start,
            any_ratio=True,
        )

    @field_validator("q", mode="before")
    @classmethod
    def _read_q(cls, value: Any, info: ValidationInfo) -> float:
        order = info.data.get("order", 1)
        if value is None:
            if order not in cls.default_q:
                msg = f"expected a value in {signal_noise_unit(order)}: there is no default for order {order}"
                raise ValueError(msg)
            return cls.default_q[order]
        example = "0.3 (deg/s)^2/s" if order == 1 else f"1e6 (deg/s)^2/s^{2 * order - 1}"
        return Quantity(signal_noise_unit(order), example, at_least=0.0).validate(value, info)

    @field_serializer("q")
    def _write_q(self, value: float, info: SerializationInfo) -> str | float:
        return f"{value!r} {signal_noise_unit(self.order)}" if (info.context or {}).get("border") else value


class FormParameters(FilterParameters):
    """Parameters of a filter whose covariance recursion can be chosen.

    Parameters
    ----------
    form : {"joseph", "conventional", "square_root"}
        What the covariance recursion carries: P by the Joseph form; P by P - K H P, which rounding can make indefinite,
        to show it; or a root D of P = D D' by QR decompositions.
    """

    form: Literal["joseph", "conventional", "square_root"] = "joseph"


class CovarianceParameters(FormParameters):
    """Parameters of a filter whose covariance recursion and its arithmetic can be chosen.

    Parameters
    ----------
    precision : {"double", "single"}
        Arithmetic of the state and covariance recursion.
    """

    precision: Literal["double", "single"] = "double"


def initial_state(model: FusionModel, parameters: CommonParameters) -> FloatArray:
    """Return the state before the first reading, shape (n_state,): zero, or in equilibrium with a known rest.

    Parameters
    ----------
    model : FusionModel
        The augmented model.
    parameters : CommonParameters
        What is known.
    """
    return model.still * (parameters.rest_rate if parameters.start == "rest" else 0.0)


class ModelFilter(BlockFilter):
    """A filter that runs on the augmented model of `testbed.fusion.model`, in the form and precision of its parameters.

    Between stamps its transitions are those of `testbed.fusion.transitions`.

    Parameters
    ----------
    belief : mapping of str to SensorBelief
        What is believed about each sensor.
    sample_rate_hz : mapping of str to float
        Rate of each sensor [Hz].
    parameters : FilterParameters
        Signal model.

    Raises
    ------
    ValueError
        If a sensor has no belief, or a parameter names an unknown sensor.
    """

    any_clock = True
    start_leaves = (0.0045 * DEG, 0.0045 * DEG)

    def __init__(
        self, belief: Mapping[str, SensorBelief], sample_rate_hz: Mapping[str, float], parameters: FilterParameters
    ) -> None:
        super().__init__(belief, sample_rate_hz, parameters)
        form = parameters.form if isinstance(parameters, FormParameters) else "joseph"
        precision = parameters.precision if isinstance(parameters, CovarianceParameters) else "double"
        self.model: FusionModel = parameters.build(belief, sample_rate_hz, parameters.q)
        self._nodes: tuple[FloatArray, ...] | None = None
        self._form = FORMS[form]
        kind = np.float32 if precision == "single" else np.float64
        self._x = initial_state(self.model, parameters).astype(kind)
        self._F, self._H = self.model.F.astype(kind), self.model.H.astype(kind)
        self._P, self._Q = self.carried(self.model.P0), self.carried(self.model.Q)
        self._even = even(self._F, self._Q)

    def carried(self, covariance: FloatArray) -> FloatArray:
        """Return what the recursion carries for a covariance, in its precision: a copy, or its root."""
        value = covariance_root(covariance) if self._form == SQUARE_ROOT else covariance
        return value.astype(self._x.dtype)

    def _tables(self) -> tuple[FloatArray, ...]:
        """Return the tables that the kernel steps between stamps with: F and what it carries for Q, at each node."""
        model = self.model
        F, Q = transition_nodes(model.A, model.Qc, 1.0 / model.sample_rate_hz)
        return F.astype(self._F.dtype), np.array([self.carried(one) for one in Q])

    def _clocked(self, steps: Steps) -> tuple[Any, ...]:
        """Return `steps` and the tables as the kernel takes them."""
        if steps is EVEN:
            return self._even
        if self._nodes is None:
            self._nodes = self._tables()
        return (*steps, *self._nodes)

    @property
    def step_seconds(self) -> float:
        """About how long a step takes, compiled, on a core of 2020 [s]: a root takes its QR decompositions."""
        of_form = 3.0 if self._form == SQUARE_ROOT else 1.0
        return 1e-7 + of_form * 2e-9 * len(self._x) ** 2

    @property
    def covariance(self) -> FloatArray:
        """Covariance of the state after the last step, shape (n_state, n_state) [state^2]."""
        P = self._P.astype(float)
        return P @ P.T if self._form == SQUARE_ROOT else P

    def measurement_noise(self, key: str, chosen: Mapping[str, float], *, explicit: bool) -> FloatArray:
        """Return R [rad^2/s^2] per sensor: the chosen one, or else the belief's.

        Parameters
        ----------
        key : str
            Name of the parameter that `chosen` comes from, for the message.
        chosen : mapping of str to float
            R of some sensors [rad^2/s^2].
        explicit : bool
            The user named these sensors, so an unknown one is an error.

        Returns
        -------
        ndarray, shape (n_sensor,)
            R [rad^2/s^2].

        Raises
        ------
        ValueError
            If a chosen sensor is unknown or an R is not positive.
        """
        self.check_sensors(key, chosen, explicit=explicit)
        R = np.array([chosen.get(name, self.model.R[i]) for i, name in enumerate(self.model.sensors)])
        for name, value in zip(self.model.sensors, R, strict=True):
            if not value > 0.0:
                msg = (
                    f"{key}: expected more than 0 for {quoted(name)}, got {value}; "
                    "give it here or give the belief an output_noise"
                )
                raise ValueError(msg)
        return R

    def check_sensors(self, key: str, chosen: Mapping[str, Any], *, explicit: bool) -> None:
        """Raise ValueError if `chosen`, given by the user under `key`, names a sensor that the filter does not have."""
        unknown = [name for name in chosen if name not in self.model.sensors]
        if explicit and unknown:
            msg = f"{key}: expected sensors of {list(self.model.sensors)}, got {unknown}"
            raise ValueError(msg)
