"""From channels of a recording to what each output is: response, model, noise, belief."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from pydantic import ValidationError

from testbed.errors import Problem, ScenarioError, quoted
from testbed.identification.channels import of_one_clock, series_of
from testbed.identification.model import fit_model
from testbed.identification.noise import Heard, NoiseFit, fit_noise, three_floors
from testbed.identification.response import Measured, measure_response
from testbed.identification.words import refusal_of
from testbed.logs.inspection import word_of

if TYPE_CHECKING:
    from collections.abc import Sequence

    from testbed.fusion.belief import SensorBelief
    from testbed.identification.channels import Prepared
    from testbed.identification.noise import ThreeFloors
    from testbed.identification.response import NoiseFloor
    from testbed.identification.sensor_model import SensorModel
    from testbed.logs.channel import Log, LogChannel

# Digits of what a belief file holds: the noise of any record leaves fewer.
_DIGITS = 9
_TELLS = 3.0


@dataclass(frozen=True)
class Identification:
    """What a record says of one output.

    Parameters
    ----------
    name : str
        Of the output's channel.
    measured : Measured
        Response and noise.
    model : SensorModel
        What was fitted to the response.
    floor : NoiseFloor
        Noise of the reading [rad^2/s]: the output's own where there are two outputs, else with the reference's.
    noise : NoiseFit
        What was fitted to it.
    belief : SensorBelief
        What follows.
    notes : tuple of str
        What was taken for granted, left out or cannot be known.
    """

    name: str
    measured: Measured
    model: SensorModel
    floor: NoiseFloor
    noise: NoiseFit
    belief: SensorBelief
    notes: tuple[str, ...]


def identify_sensors(
    log: Log, input: str, output: str | Sequence[str], *, one_clock: bool = False
) -> list[Identification]:
    """Return what sensors are, from a record of them beside a reference.

    Parameters
    ----------
    log : Log
        The recording, from `testbed.read_log`.
    input : str
        Channel of the reference: a rate, an angle (such as an encoder's) or increments; its noise should be far below
        that of the outputs.
    output : str or sequence of str
        Channels of the sensors; with two or more the noise of each is its own, with one it is that of the reference as
        well.
    one_clock : bool, optional
        All were sampled by one clock; channels in the same rows of a file are anyway. Else the clock of each output is
        fitted.

    Returns
    -------
    list of Identification
        In the order of the outputs.

    Raises
    ------
    ScenarioError
        If a channel is not there or is no rotation, or nothing of an output follows the reference: with the reason.

    Examples
    --------
    A sensor that reads 0.9 of what a laser does, both in the rows of a file:

    >>> import pathlib, tempfile
    >>> import numpy as np
    >>> t = np.arange(4000) / 500.0
    >>> rate = sum(np.sin(2.0 * np.pi * f * t) for f in (3.0, 7.0, 19.0))
    >>> noise = 1e-3 * np.random.default_rng(1).standard_normal(t.size)
    >>> path = pathlib.Path(tempfile.mkdtemp()) / "log.csv"
    >>> np.savetxt(path, np.column_stack([t, rate, 0.9 * rate + noise]), header="t [s],laser [deg/s],gyro [deg/s]",
    ...            comments="", delimiter=",")
    >>> from testbed.logs import read_log
    >>> found = identify_sensors(read_log(path), "laser", "gyro")[0]
    >>> round(found.belief.numerator[0], 3), found.belief.denominator
    (0.9, (1.0,))
    """
    names = [output] if isinstance(output, str) else list(output)
    check_names(input, names)
    return identify_channels(log.channels[input], [log.channels[name] for name in names], one_clock=one_clock)


def check_names(input: str, outputs: Sequence[str]) -> None:
    """Raise ScenarioError if an output is the reference itself or is named twice.

    Parameters
    ----------
    input : str
        Channel of the reference.
    outputs : sequence of str
        Channels of the sensors.
    """
    names = [input, *outputs]
    problems = [
        Problem(f"expected each channel once, got {quoted(name)} {names.count(name)} times", "--output")
        for name in dict.fromkeys(outputs)
        if names.count(name) > 1
    ]
    if problems:
        raise ScenarioError(problems)


def identify_channels(
    reference: LogChannel, outputs: Sequence[LogChannel], *, one_clock: bool = False
) -> list[Identification]:
    """Return what sensors are, as `identify_sensors`, from the channels themselves.

    Parameters
    ----------
    reference : LogChannel
        Of the reference.
    outputs : sequence of LogChannel
        Of the sensors.
    one_clock : bool, optional
        As there.
    """
    inner = series_of(reference, reference)
    prepared = [series_of(one, reference) for one in outputs]
    measured = []
    for channel, one in zip(outputs, prepared, strict=True):
        shared = one_clock or of_one_clock(reference, channel)
        try:
            found = measure_response(inner.series, one.series, one_clock=shared)
        except ValueError as error:
            raise refusal_of(reference, channel, str(error)) from error
        if not found.response.freq_hz.size or not np.isfinite(found.response.clock.std):
            raise refusal_of(reference, channel, found)
        measured.append(found)
    floors = _floors(inner, prepared, measured)
    return [
        _identified(channel, one, found, floor, inner)
        for channel, one, found, floor in zip(outputs, prepared, measured, floors, strict=True)
    ]


class _Floor(NamedTuple):
    """Noise of an output, and what is to be said of it."""

    noise: NoiseFloor
    notes: tuple[str, ...] = ()


def _floors(inner: Prepared, prepared: Sequence[Prepared], measured: Sequence[Measured]) -> list[_Floor]:
    """Return the noise of each output, by itself where another one tells it from the reference's."""
    if len(prepared) == 1:
        return [_Floor(measured[0].noise)]
    heard = [Heard(one.series, found.response.clock, found.lag) for one, found in zip(prepared, measured, strict=True)]
    three = [three_floors(inner.series, heard[i], heard[i - 1]) for i in range(len(heard))]
    return [_told(one, found) for one, found in zip(three, measured, strict=True)]


def _told(three: ThreeFloors, found: Measured) -> _Floor:
    """Return the noise of the first output: its own alone where it follows a reference that shows noise, if it does."""
    reference, own, _ = three.evidence
    if reference <= _TELLS:
        # Taking off what is none would only add to the scatter.
        return _Floor(found.noise)
    if own > _TELLS:
        return _Floor(three.first.joined(found.quiet))
    said = "its own noise is too small beside that of the reference to be told where it follows"
    if not found.quiet.freq_hz.size:
        return _Floor(found.noise, (f"{said}: the belief has both",))
    return _Floor(found.quiet, (f"{said}: the belief has that of the other frequencies",))


def _identified(
    channel: LogChannel, prepared: Prepared, measured: Measured, floor: _Floor, inner: Prepared
) -> Identification:
    if measured.response.freq_hz.size < 2:
        raise refusal_of(
            channel, channel, f"expected a response at two frequencies or more, got {measured.response.freq_hz.size}"
        )
    try:
        model = fit_model(measured.response)
    except ValueError as error:  # of the search, where a response or its delay is no number that it can begin with
        words = f"no model can be fitted to its response ({error}); a reading may be damaged, or the record too short"
        raise refusal_of(channel, channel, words) from error
    sees_constant = bool(model.numerator[-1] != 0.0)
    noise = fit_noise(floor.noise, np.abs(model.response(floor.noise.freq_hz)), slow_before=sees_constant)
    try:
        belief = _belief(channel, model, noise, _bias(prepared, inner, model, measured))
    except ValidationError as error:
        found = error.errors()[0]
        key = ".".join(map(str, found["loc"])) or "response"
        words = f"its readings make no belief, {key}: {found['msg']}; a reading may be damaged"
        raise refusal_of(channel, channel, words) from error
    notes = (*inner.notes, *prepared.notes, *floor.notes, *_left_out(model, measured))
    name = channel.name.removeprefix("sensors/").removesuffix("/rate")  # of a run's file
    return Identification(name, measured, model, floor.noise, noise, belief, tuple(dict.fromkeys(notes)))


def _bias(prepared: Prepared, inner: Prepared, model: SensorModel, measured: Measured) -> float:
    r"""Return what the mean of the reading has beyond that of the rate [rad/s]; 0 unless it is three times what hides
    it: noise at the inverse of the record, and what is under way at its ends, :math:`G'(0) [\omega]_0^T / T`.
    """
    length, step = measured.response.length, 1e-3 / measured.response.length
    still, slow = model.response(np.array([0.0, step]))
    bias = prepared.mean - float(still.real) * inner.mean
    under_way = float(abs(slow - still)) / (2.0 * np.pi * step) * np.sqrt(2.0) * inner.rms / length
    hidden = float(np.hypot(np.sqrt(measured.noise.density[0] / length), under_way))
    return bias if abs(bias) > _TELLS * hidden else 0.0


def _belief(channel: LogChannel, model: SensorModel, noise: NoiseFit, bias: float) -> SensorBelief:
    """Return the belief, in the digits that a file has."""
    from testbed.fusion.belief import SensorBelief

    return SensorBelief(
        numerator=_rounded(model.numerator),
        denominator=_rounded(model.denominator),
        delay=_short(max(model.delay, 0.0)),
        bias=_short(bias),
        input_noise=_short(noise.inner),
        output_noise=_short(noise.outer),
        noise_knee=None if noise.knee is None else _short(noise.knee),
        bias_instability=_short(noise.instability),
        range=channel.largest,
        resolution=(_short(word_of(channel)) or None) if channel.kind == "rate" else None,
    )


def _left_out(model: SensorModel, measured: Measured) -> list[str]:
    """Return what the belief does not hold, for the reader."""
    said = []
    if model.delay < 0.0:
        said.append(
            f"the output is early by {-1e6 * model.delay:.4g} us: the clocks did not begin together, or the reference "
            "is late; the belief has no delay"
        )
    if model.delay_is_open:
        low, high = (1e6 * one for one in model.delay_span)
        said.append(
            f"dead times from {low:.4g} to {high:.4g} us are nearly as likely, each with other poles: this record does "
            "not decide; one with more frequencies, or higher ones, would"
        )
    if measured.mains:
        said.append(f"left out, since it may be hum in both: {', '.join(f'{freq:.5g} Hz' for freq in measured.mains)}")
    if measured.unfollowed:
        lines = ", ".join(f"{freq:.5g} Hz" for freq in measured.unfollowed)
        said.append(f"left out, since the output does not follow: {lines}")
    return said


def _rounded(values: Any) -> tuple[float, ...]:
    return tuple(_short(float(one)) for one in values)


def _short(value: float) -> float:
    return float(f"{value:.{_DIGITS}g}")
