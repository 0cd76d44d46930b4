"""What every instrument has in common: its parameters, which can be started, its clock and its data sheet."""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Mapping
from typing import TYPE_CHECKING, Any, ClassVar, Self

import numpy as np
from pydantic import (
    GetJsonSchemaHandler,
    ModelWrapValidatorHandler,
    ValidationError,
    ValidationInfo,
    field_validator,
    model_validator,
)

from testbed.models.turntable.parameters import Mounting
from testbed.parts import Part
from testbed.sensors.clock import OwnClock, Ticks, TickSampler, ticks_of
from testbed.sensors.data_sheet import Sheet, Word
from testbed.sensors.decimation import Decimator, divides, rate_ratio
from testbed.sensors.faults import Fault, FaultStage, first_overlap
from testbed.sensors.losses import Losses, LossStage
from testbed.signals import BASE_RATE_HZ, random_stream
from testbed.units import SampleRate

if TYPE_CHECKING:
    from numpy.typing import ArrayLike
    from pydantic_core import core_schema

    from testbed.sensors.stages import SensorStage
    from testbed.signals import ComplexArray, FloatArray


class Sensor(Part):
    """Parameters of an instrument, which is what a scenario's `sensors` entry sets.

    Parameters
    ----------
    sample_rate : float
        Rate of the readings [Hz]; reading j is at t = j / sample_rate by its clock.
    clock : OwnClock, optional
        A clock of its own, such as ``{error: 20 ppm, walk: 1 us, offset: 1 ms}``; left out, the run's.
    noise : bool
        Off: nothing random and no rounding, so that a run can be exact; the dynamics, the constant errors and the
        range stay, and so does the clock.
    mounting : Mounting
        Where it sits on the table and how far its axis is off.
    faults : tuple of Fault
        Spans in which the readings are none, behind everything else, such as ``[{kind: stuck, at: 5 s, length: 1 s}]``.
    lost : Losses, optional
        Readings that do not arrive, such as ``{bursts: {every: 5 s, length: 20 ms}}``; none with `noise` off.

    Attributes
    ----------
    words : tuple of Word
        Keys of data sheets that it takes in place of parameters.
    """

    words: ClassVar[tuple[Word, ...]] = ()
    any_clock: ClassVar[bool] = False
    """It can read at any instants, not only at samples of the run."""

    sample_rate: SampleRate
    clock: OwnClock | None = None
    noise: bool = True
    mounting: Mounting = Mounting()
    faults: tuple[Fault, ...] = ()
    lost: Losses | None = None

    @model_validator(mode="after")
    def _ticks_in_order(self) -> Self:
        most = 0.1 / self.sample_rate**0.5
        if self.clock is not None and self.clock.walk > most:
            msg = f"clock.walk: expected at most {most:.3g} s at {self.sample_rate:g} Hz, got {self.clock.walk:g} s"
            raise ValueError(msg)
        return self

    @field_validator("faults")
    @classmethod
    def _one_at_a_time(cls, faults: tuple[Fault, ...]) -> tuple[Fault, ...]:
        if pair := first_overlap(faults):
            one, other = pair
            msg = f"expected one fault at a time, got {other.kind} at {other.at:g} s before the end of {one.kind} at "
            msg += f"{one.end:g} s"
            raise ValueError(msg)
        return faults

    @classmethod
    def sheet(cls, values: Mapping[str, Any], *, border: bool) -> Sheet:
        """Return the keys of a file with those of data sheets turned into parameters, and how that was done.

        Parameters
        ----------
        values : mapping
            The keys as they stand.
        border : bool
            Whether they are strings with units, as in a file.
        """
        sheet = Sheet(values, border=border)
        for word in cls.words:
            sheet.translate(word)
        return sheet

    @classmethod
    def known_keys(cls) -> list[str]:
        """Return every key that may stand in a file, those of data sheets included."""
        return [*cls.model_fields, *(word.key for word in cls.words)]

    @classmethod
    def ways(cls) -> tuple[tuple[tuple[str, ...], ...], ...]:
        """Return, for each quantity that can be said in several ways, the keys of each way."""
        return tuple(((word.key,), (word.field,)) for word in cls.words)

    @classmethod
    def __get_pydantic_json_schema__(
        cls, schema: core_schema.CoreSchema, handler: GetJsonSchemaHandler
    ) -> dict[str, Any]:
        described = handler(schema)
        inner = handler.resolve_ref_schema(described)
        # In the place of a parameter, so none of the two is required.
        inner["properties"] |= cls.sheet_schema()
        inner.pop("required", None)
        return described

    @classmethod
    def sheet_schema(cls) -> dict[str, Any]:
        """Return the JSON schema of the keys of data sheets, by name."""
        return {word.key: word.schema() for word in cls.words}

    @model_validator(mode="wrap")
    @classmethod
    def _read_sheet(cls, data: Any, handler: ModelWrapValidatorHandler[Self], info: ValidationInfo) -> Self:
        if not isinstance(data, Mapping):
            return handler(data)
        sheet = cls.sheet(data, border=bool((info.context or {}).get("border")))
        try:
            found = handler(sheet.values)
        except ValidationError as error:
            raise sheet.beside(error) from error
        if sheet.problems:
            raise sheet.refusal(cls.__name__)
        return found

    def sheet_belief(self) -> dict[str, Any]:
        """Return what its data sheet lets a filter believe: the fields of a belief, in SI.

        Raises
        ------
        ValueError
            If a data sheet of this kind of instrument says too little.
        """
        msg = f"{type(self).__name__}: a data sheet says too little of it; name a belief, or take 'belief: exact'"
        raise ValueError(msg)

    def doubts(self) -> list[str]:
        """Return what does not fit together although each value may be right, for people to read."""
        return []

    def beyond(self, rate: float, stroke: float) -> list[str]:
        """Return where a motion leaves what the model of the instrument holds for, for people to read.

        Parameters
        ----------
        rate, stroke : float
            Its largest rate [rad/s], and half of the angle between its extreme positions [rad].
        """
        return []

    @abstractmethod
    def response(self, freq_hz: ArrayLike) -> ComplexArray:
        """Return indicated over true rate, noise-free, in continuous time.

        Parameters
        ----------
        freq_hz : array_like, shape (n_freq,)
            Frequency [Hz].

        Returns
        -------
        ndarray of complex, shape (n_freq,)
            Response [-].
        """

    def clocked(self, input_rate_hz: float) -> bool:
        """Return whether its readings fall between the samples of a clock of `input_rate_hz` [Hz], or have stamps that
        are late.
        """
        return self.clock is not None or not divides(input_rate_hz, self.sample_rate)

    def ticks(self, seed: int, name: str) -> Ticks:
        """Return when it reads; arguments as `start`."""
        return ticks_of(self.clock, self.sample_rate, seed, name)

    def sampler(self, input_rate_hz: float, seed: int, name: str) -> Decimator | TickSampler:
        """Return what takes its readings from a signal of `input_rate_hz`; arguments as `start`.

        Raises
        ------
        ValueError
            If there are less samples than readings.
        """
        if self.clocked(input_rate_hz) and self.sample_rate <= input_rate_hz:
            return TickSampler(self.ticks(seed, name), input_rate_hz)
        return Decimator(rate_ratio(input_rate_hz, self.sample_rate))

    def start_losses(self, seed: int, name: str) -> LossStage:
        """Return what loses readings at random; arguments as `start`."""
        return LossStage(self.lost if self.noise else None, self.sample_rate, random_stream(seed, name, "lost"))

    def start_faults(self) -> FaultStage:
        """Return the stage behind that of `start`: what becomes of its readings."""
        return FaultStage(self.faults, self.sample_rate, self.full_scale())

    @property
    def exposed(self) -> bool:
        """Whether the readings depend on cross rates or accelerations, which the plant works out for those alone."""
        return False

    @property
    def truth_rate(self) -> float:
        """Rate of the truth that it needs on a base that is held [Hz], where nothing moves faster than the command."""
        return BASE_RATE_HZ

    def datasheet(self) -> list[tuple[str, str]]:
        """Return what the parameters mean in data-sheet units: rows of a quantity and its value."""
        return []

    @abstractmethod
    def full_scale(self) -> float:
        """Return the largest rate that it can read [rad/s]."""

    @abstractmethod
    def input_noise_psd(self, freq_hz: FloatArray) -> FloatArray:
        """Return the noise referred to the true rate, rounding included, noise folded in by the sampling not.

        Parameters
        ----------
        freq_hz : ndarray, shape (n_freq,)
            Frequency, above zero [Hz].

        Returns
        -------
        ndarray, shape (n_freq,)
            Two-sided density [rad^2/s].
        """

    @property
    def reading_std(self) -> float:
        """Standard deviation of the noise of a reading [rad/s], as if it were white with its density at a quarter of
        the sample rate; the same with `noise` off.
        """
        quarter = np.array([0.25 * self.sample_rate])
        with np.errstate(all="ignore"):
            density = self.input_noise_psd(quarter) * np.abs(self.response(quarter)) ** 2
            return float(np.sqrt(density[0] * self.sample_rate))

    @abstractmethod
    def start(self, input_rate_hz: float, seed: int, name: str) -> SensorStage:
        """Return the instrument as it has stood for long under the rate that is on at its first sample, its noise
        stationary; its faults are a stage of their own (`start_faults`).

        Parameters
        ----------
        input_rate_hz : float
            Sample rate of the true rate, a whole multiple of `sample_rate` [Hz].
        seed : int
            Seed of the run.
        name : str
            Name of the instance, the owner of its random streams.

        Returns
        -------
        SensorStage
            ``process(true_rate)`` gives the readings [rad/s].

        Raises
        ------
        ValueError
            If the sample rates are no whole multiples.
        """

    def sample(self, rate: FloatArray, input_rate_hz: float, seed: int = 0) -> FloatArray:
        """Return the readings over a whole record.

        Parameters
        ----------
        rate : array_like, shape (n_time,)
            True rate about the sensing axis [rad/s].
        input_rate_hz : float
            Its sample rate [Hz].
        seed : int, optional
            Seed of the noise.

        Returns
        -------
        ndarray, shape (ceil(n_time / ratio),)
            Readings [rad/s].

        Raises
        ------
        ValueError
            If `rate` is no vector or the sample rates are no whole multiples.
        """
        record = np.asarray(rate, dtype=np.float64)
        if record.ndim != 1:
            msg = f"rate: expected shape (n_time,), got {record.shape}"
            raise ValueError(msg)
        readings = self.start_faults().process(self.start(input_rate_hz, seed, "sensor").process(record))
        return self.start_losses(seed, "sensor").process(readings)
