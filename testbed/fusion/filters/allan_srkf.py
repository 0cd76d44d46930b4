"""The square-root Kalman filter of paper 2, whose R is the recursive Allan variance of each sensor."""

from __future__ import annotations

from typing import TYPE_CHECKING, Annotated, ClassVar, Literal

from pydantic import Field

from testbed.fusion.filters.shakf import AdaptiveFilter
from testbed.fusion.model_filter import CovarianceParameters, Variance
from testbed.units import DEG, PositiveDuration

if TYPE_CHECKING:
    from collections.abc import Mapping

    from testbed.fusion.belief import SensorBelief
    from testbed.parts import Part


class AllanSrkfParameters(CovarianceParameters):
    """Parameters of `AllanSrkf`.

    Parameters
    ----------
    memory : float or None
        Time constant of the Allan variance [s]; None is the infinite memory of the recursion as printed.
    R_floor : float
        Lowest R without a clamp [rad^2/s^2]: readings that repeat themselves to the last bit have no Allan variance.
    clamp : float or None
        Keep R within this factor of the belief's; None is the recursion as printed, free above the floor.
    """

    default_q: ClassVar[dict[int, float]] = {1: 1e3 * DEG**2}

    form: Literal["joseph", "conventional", "square_root"] = "square_root"
    memory: PositiveDuration | None = None
    R_floor: Variance = 1e-8 * DEG**2
    clamp: Annotated[float, Field(ge=1.0, allow_inf_nan=False)] | None = 10.0


class AllanSrkf(AdaptiveFilter):
    r"""Square-root Kalman filter with R from the Allan variance at the shortest correlation time, one sample.

    .. math:: D^- = \mathrm{qr}[F D,\, Q^{1/2}],\; K = P^- H' (H P^- H' + R)^{-1},\;
              D = \mathrm{qr}[(I - K H) D^-,\, K R^{1/2}],\; R_k = (1 - g_k) R_{k-1} + g_k (z_k - z_{k-1})^2 / 2

    with P = D D' and g_k = 1/(k - 1), for all readings of an instant at once; the root of the Joseph form cannot become
    indefinite. The state is sent out before the covariance is updated: in hardware that saves the time of the
    covariance update, the estimate is the same. R is the belief's until a sensor has two readings. With two states of
    the gyro and four of the MHD ARS (belief `paper2`) there are seven.

    The increments hold the signal too: a sine of amplitude A and frequency f adds (2 pi f A T)^2 / 4 to R, at 50 Hz and
    50 deg/s some 1e5 times the noise of an MHD ARS. By default R is therefore kept within a factor of the belief's; as
    printed (`clamp` None) the scale factor depends on the amplitude unless q is far larger, such as 1e5 (deg/s)^2/s.

    Parameters
    ----------
    belief : mapping of str to SensorBelief
        Dynamics and noise of each sensor.
    sample_rate_hz : mapping of str to float
        Rate of each sensor [Hz].
    parameters : AllanSrkfParameters
        Signal model and Allan variance.

    References
    ----------
    Jiang, Li, Liu, Tuo, Chinese Journal of Sensors and Actuators 2022 no. 9; paper 1 (doi 10.1109/TIM.2024.3375962),
    equations (28)-(29).
    """

    Parameters: ClassVar[type[Part]] = AllanSrkfParameters
    start_leaves = (0.007 * DEG, 0.007 * DEG)
    dishonest = (
        "q is chosen so large, for paper 2's swings of 50 deg/s, that P claims twenty times the error of smaller ones"
    )

    def __init__(
        self, belief: Mapping[str, SensorBelief], sample_rate_hz: Mapping[str, float], parameters: AllanSrkfParameters
    ) -> None:
        super().__init__(belief, sample_rate_hz, parameters)
        R = self.measurement_noise("belief", {}, explicit=False)
        self._sensors["follow"] = True
        self._sensors["R"] = R
        self._sensors["lowest"] = parameters.R_floor
        if parameters.clamp is not None:
            self._sensors["lowest"] = R / parameters.clamp
            self._sensors["highest"] = R * parameters.clamp
        if parameters.memory is not None:
            rates = [sample_rate_hz[name] for name in self.model.sensors]
            self._sensors["least_weight"] = [min(1.0, 1.0 / (rate * parameters.memory)) for rate in rates]
