"""The model-only compensator: trained on other thermal cycles, frozen, applied sample by sample.

The drift it subtracts follows from the thermometer alone. The rate never enters, so a true rate of any period passes
with gain one, and a residual can be no smaller than the gyro's own noise allows except by chance.
"""

from __future__ import annotations

from dataclasses import asdict, dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from testbed.compensation import FITS, training
from testbed.compensation.document import FORMAT, VERSION, ModelDocument, seal_of, sealed
from testbed.compensation.features import Features, Scaling
from testbed.compensation.lssvm import Lssvm
from testbed.compensation.polynomial import Polynomial
from testbed.compensation.record import checked
from testbed.errors import quoted
from testbed.parts import resolve

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from numpy.typing import NDArray

    from testbed.compensation.record import GyroRecord
    from testbed.signals import FloatArray

    Fit = Callable[[training.TrainingRows, int], tuple[Lssvm | Polynomial, float]]

_MACHINES: dict[str, type[Lssvm | Polynomial]] = {"lssvm": Lssvm, "polynomial": Polynomial}
# A drift beyond it is that of no gyro: 5.7 deg/s.
MOST_DRIFT = 0.1
# Kelvin between the first reading and the nearest start of a training cycle, within the widest dead band of an optical
# mount (12 K): 10 K cost at most a quarter more error over the first four hours, 20 K a half, 40 K the double
# (benchmarks/fog_audit.py).
START_MARGIN = 10.0
# What each method of `FITS` is: the kind of machine, and the features unless told otherwise.
METHODS: dict[str, tuple[str, Features]] = {
    "gradient": ("polynomial", Features()),
    "lssvm": ("lssvm", Features()),
    "polynomial": ("polynomial", Features(lags=())),
    "process": ("polynomial", Features(plays=(3.0, 10.0))),
}


@dataclass(frozen=True)
class CompensatedBlock:
    """What a compensator gives for a block of readings.

    Parameters
    ----------
    rate : ndarray, shape (n_time,)
        Reading minus drift [rad/s].
    drift : ndarray, shape (n_time,)
        What was subtracted [rad/s].
    extrapolated : ndarray of bool, shape (n_time,)
        Whether a temperature feature lies outside what training has seen, by more than 5 % of its span.
    """

    rate: FloatArray
    drift: FloatArray
    extrapolated: NDArray[np.bool_]


@dataclass(frozen=True)
class DriftModel:
    """A trained and frozen model of the temperature drift.

    Parameters
    ----------
    method : str
        One of `METHODS`.
    sample_rate_hz : float
        Rate of the training records [Hz].
    mean_rate : float
        Mean of the training rates [rad/s]: Earth rate and constant bias. For information; it is never subtracted.
    blocked_error : float
        Rms of the blocked cross-validation error of the row means, their noise included; for `gradient` and `process`
        of what is new in each row [rad/s].
    starts : tuple of float
        First temperature of each training cycle: every feature, and the gyro's own hysteresis, begins there [K].
    features : Features
        What is formed of the temperature.
    scaling : Scaling
        Standardisation by training statistics.
    machine : Lssvm or Polynomial
        From standardised features to drift [rad/s].
    """

    method: str
    sample_rate_hz: float
    mean_rate: float
    blocked_error: float
    starts: tuple[float, ...]
    features: Features
    scaling: Scaling
    machine: Lssvm | Polynomial

    def start(self, sample_rate_hz: float | None = None) -> CompensatorStage:
        """Return the compensator in time.

        Parameters
        ----------
        sample_rate_hz : float, optional
            Rate of the readings [Hz]; that of the training records if left out.
        """
        return CompensatorStage(self, self.sample_rate_hz if sample_rate_hz is None else sample_rate_hz)

    def apply(self, record: GyroRecord) -> CompensatedBlock:
        """Compensate a whole record, the same bits as in blocks.

        Parameters
        ----------
        record : GyroRecord
            Readings at any sample rate.
        """
        return self.start(record.sample_rate_hz).process(record.rate, record.temperature)

    def start_distance(self, record: GyroRecord) -> float:
        """Return how far a record's first temperature is from the nearest start of a training cycle [K].

        Parameters
        ----------
        record : GyroRecord
            To be compensated; over `START_MARGIN` its first hours are compensated worse.
        """
        return min(abs(float(record.temperature[0]) - start) for start in self.starts)

    def to_dict(self) -> dict[str, Any]:
        """Return the model as plain lists and numbers for JSON, which keeps every bit; with its own digest."""
        return sealed({"format": FORMAT, "version": VERSION, **_plain(asdict(self))})

    @classmethod
    def from_dict(cls, document: dict[str, Any]) -> DriftModel:
        """Return the model that `to_dict` wrote.

        Parameters
        ----------
        document : dict
            As read from JSON.

        Raises
        ------
        ValueError
            If it is no drift model of this version: every field that is missing, unknown, of another type or out of its
            range; or if its digest is another, so that it is not as it was written.
        """
        found = ModelDocument.model_validate(document)
        if seal_of(document) != found.sha256:
            msg = "drift model: sha256: expected the digest of the rest of the file, got another: it was changed since"
            raise ValueError(msg)
        features: dict[str, Any] = {
            key: tuple(item) if isinstance(item, list) else item for key, item in found.features.model_dump().items()
        }
        return cls(
            found.method,
            found.sample_rate_hz,
            found.mean_rate,
            found.blocked_error,
            tuple(found.starts),
            Features(**features),
            Scaling(**_arrays(found.scaling.model_dump())),
            _MACHINES[METHODS[found.method][0]](**_arrays(found.machine.model_dump())),
        )


class CompensatorStage:
    """A drift model at work on a stream; it learns nothing, and any division into blocks gives the same bits.

    Parameters
    ----------
    model : DriftModel
        Frozen model.
    sample_rate_hz : float
        Rate of the readings [Hz].
    """

    def __init__(self, model: DriftModel, sample_rate_hz: float) -> None:
        self._model, self._features = model, model.features.start(sample_rate_hz)

    def process(self, rate: FloatArray, temperature: FloatArray) -> CompensatedBlock:
        """Compensate the next readings; each with readings up to its own, so without latency.

        Parameters
        ----------
        rate : ndarray, shape (n_time,)
            Gyro [rad/s].
        temperature : ndarray, shape (n_time,)
            Thermometer at the same instants [K].

        Raises
        ------
        ValueError
            If the lengths differ or a reading is not finite; the stage has then not moved. If the drift is none that
            a gyro has.
        """
        readings, kelvin = checked("rate", rate), checked("temperature", temperature)
        if readings.size != kelvin.size:
            msg = f"temperature: expected one reading per rate, got {kelvin.size} for {readings.size}"
            raise ValueError(msg)
        Z = self._model.scaling.apply(self._features.process(kelvin))
        drift = self._model.machine.predict(Z)
        if not np.all(np.abs(drift) <= MOST_DRIFT):
            msg = f"expected a drift of at most {MOST_DRIFT:g} rad/s, got more: the readings are far from trained ones"
            raise ValueError(msg)
        return CompensatedBlock(readings - drift, drift, self._model.scaling.extrapolated(Z))


def train(
    cycles: Sequence[GyroRecord],
    *,
    method: str = "gradient",
    features: Features | None = None,
    seed: int = 0,
    block: float = 7200.0,
) -> DriftModel:
    """Train a drift model on thermal cycles at constant true rate; one up-first and one down-first tell temperature
    from time.

    The mean over all cycles is taken off before and given back to nobody: the drift is zero on average over the
    training rows, so Earth rate and constant bias stay in the compensated rate. A rate that changes within a cycle is
    taken for drift; one that changes between cycles (bias at turn-on) is not by `gradient` and `process`, where each
    cycle has a constant of its own.

    Parameters
    ----------
    cycles : sequence of GyroRecord
        Training records at one sample rate.
    method : str
        `gradient` (least squares under 1/f noise in powers of T, slope and gradient features), `lssvm` (the paper's
        machine on the same features), `polynomial` (the baseline: ordinary least squares without gradients), or
        `process` (`gradient` with hysteresis, a Gaussian process with priors by likelihood).
    features : Features, optional
        Other features than the method's own.
    seed : int
        Of the search for the machine's parameters.
    block : float
        Length of the contiguous blocks of the cross-validation that chooses them [s].

    Returns
    -------
    DriftModel
        Frozen model.

    Raises
    ------
    ValueError
        If the method is unknown or the records are too few or too short.
    """
    if method not in METHODS:
        msg = f"method: expected one of {', '.join(METHODS)}, got {quoted(method)}"
        raise ValueError(msg)
    kind, own = METHODS[method]
    fit: Fit = resolve("method", method, FITS)
    chosen = own if features is None else features
    rows = training.gather(cycles, chosen, block=block, most=training.MOST_SUPPORT if kind == "lssvm" else None)
    fitted, error = fit(rows, seed)
    starts = tuple(float(cycle.temperature[0]) for cycle in cycles)
    return DriftModel(method, cycles[0].sample_rate_hz, rows.mean_rate, error, starts, chosen, rows.scaling, fitted)


def _plain(value: Any) -> Any:
    """Return `value` with arrays and tuples as lists."""
    if isinstance(value, dict):
        return {key: _plain(item) for key, item in value.items()}
    if isinstance(value, np.ndarray | tuple):
        return [_plain(item) for item in (value.tolist() if isinstance(value, np.ndarray) else value)]
    return value


def _arrays(document: dict[str, Any]) -> dict[str, Any]:
    """Return `document` with lists as arrays."""
    return {key: np.array(item, dtype=np.float64) if isinstance(item, list) else item for key, item in document.items()}
