"""What a verdict allows to put right by itself: sign, unit, gain, offset and rate of a sensor."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from testbed.fusion.analysis.finding import SAFE, Finding, Verdict

if TYPE_CHECKING:
    from collections.abc import Mapping

    from numpy.typing import ArrayLike, NDArray

    from testbed.signals import FloatArray


class Remedied(NamedTuple):
    """A record put right as far as it is safe.

    Parameters
    ----------
    readings : dict of str to ndarray, shape (n_sensor_samples,)
        Readings [rad/s], copies where they changed.
    time_ns : dict of str to ndarray of int64, shape (n_sensor_samples,)
        Their stamps [ns].
    verdict : Verdict
        With these findings marked `fixed`.
    """

    readings: dict[str, FloatArray]
    time_ns: dict[str, NDArray[np.int64]]
    verdict: Verdict


def remedied(readings: Mapping[str, ArrayLike], time_ns: Mapping[str, NDArray[np.int64]], verdict: Verdict) -> Remedied:
    r"""Return readings and stamps with the safe findings of a verdict put right.

    .. math:: z \leftarrow z / k, \quad t \leftarrow t_0 + (t - t_0 - \tau) / (1 + \epsilon)

    k the factor of a gain, unit or sign, :math:`\tau` the offset, :math:`\epsilon` the rate, :math:`t_0` the first
    stamp of all sensors.

    Parameters
    ----------
    readings : mapping of str to array_like, shape (n_sensor_samples,)
        Readings of each sensor [rad/s]; unchanged.
    time_ns : mapping of str to ndarray of int64, shape (n_sensor_samples,)
        Their stamps [ns]; unchanged.
    verdict : Verdict
        What was found in them.

    Returns
    -------
    Remedied
        Readings, stamps and the verdict with what was applied marked.
    """
    values = {name: np.asarray(one, float) for name, one in readings.items()}
    stamps = {name: np.asarray(one, np.int64) for name, one in time_ns.items()}
    first = min((int(one.min()) for one in stamps.values() if one.size), default=0)
    for name, value in list(values.items()):
        mine = [one for one in verdict.findings if one.sensor == name and not one.fixed]
        factors = [one.value for one in mine if one.kind in ("sign", "unit", "gain")]
        if factors:
            values[name] = value / float(np.prod(factors))
        offset, rate = (sum(one.value for one in mine if one.kind == kind) for kind in ("offset", "rate"))
        if offset or rate:
            stamps[name] = _retimed(stamps[name], first, offset, rate)
    return Remedied(values, stamps, Verdict(tuple(map(_marked, verdict.findings)), verdict.undecided))


def _retimed(stamps: NDArray[np.int64], first: int, offset: float, rate: float) -> NDArray[np.int64]:
    """Return first + (t - first - offset) / (1 + rate); the correction alone goes through floats, so that none of the
    nanoseconds of a long record is lost.
    """
    elapsed = stamps - first
    correction = (elapsed * rate + offset * 1e9) / (1.0 + rate)
    moved: NDArray[np.int64] = stamps - np.rint(correction).astype(np.int64)
    return moved


def _marked(finding: Finding) -> Finding:
    return replace(finding, fixed=True) if finding.kind in SAFE else finding
