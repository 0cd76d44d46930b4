"""Fusion of rate sensors: estimators that see readings and their own belief, never the truth.

A filter is built from (belief, sample rates, parameters) and turns blocks of readings into blocks of estimates.
"""

from __future__ import annotations

import warnings
from contextlib import nullcontext
from dataclasses import replace
from typing import TYPE_CHECKING, Any

from testbed.errors import VerdictWarning

if TYPE_CHECKING:
    from collections.abc import Iterable, Mapping

    import numpy as np
    from numpy.typing import ArrayLike, NDArray

    from testbed.fusion.base import EstimateBlock
    from testbed.fusion.belief import SensorBelief

__all__ = ["FILTERS", "EstimateBlock", "estimate", "list_filters"]

FILTERS = {
    "kalman": "testbed.fusion.filters.kalman:Kalman",
    "shakf": "testbed.fusion.filters.shakf:Shakf",
    "arw_shakf": "testbed.fusion.filters.arw_shakf:ArwShakf",
    "arw_shakf_literal": "testbed.fusion.filters.arw_shakf:ArwShakfLiteral",
    "steady_state": "testbed.fusion.filters.steady_state:SteadyState",
    "complementary": "testbed.fusion.filters.complementary:Complementary",
    "blending": "testbed.fusion.filters.blending:Blending",
    "wideband": "testbed.fusion.filters.wideband:Wideband",
    "allan_srkf": "testbed.fusion.filters.allan_srkf:AllanSrkf",
    "self_calibrating": "testbed.fusion.filters.self_calibrating:SelfCalibrating",
    "vb_akf": "testbed.fusion.filters.vb_akf:VbAkf",
    "imm": "testbed.fusion.filters.imm:Imm",
}


def list_filters() -> list[str]:
    """Return the names of the filters, as `estimate` and a scenario take them.

    Examples
    --------
    >>> "kalman" in list_filters()
    True
    """
    return sorted(FILTERS)


def estimate(
    name: str | type[Any],
    readings: Mapping[str, ArrayLike],
    *,
    sample_rate_hz: Mapping[str, float] | None = None,
    time_ns: Mapping[str, ArrayLike] | None = None,
    belief: Mapping[str, Any] | str | None = None,
    plugins: Iterable[str] = (),
    verdict: bool = True,
    **parameters: Any,
) -> EstimateBlock:
    """Run the filter `name` over whole records, such as from one's own logger.

    Parameters
    ----------
    name : str or type
        Registered filter, a class of one's own, or ``module:Class`` of a plug-in.
    readings : mapping of str to array_like, shape (n_sensor_samples,)
        Readings of each sensor [rad/s]. Not finite means no reading. Without stamps all start at t = 0, and a sensor at
        1/s of the fastest rate has ceil(n / s) readings for n of the fastest; nothing is trimmed.
    sample_rate_hz : mapping of str to float, optional
        Rate of each sensor [Hz], in any ratio; beside stamps only about how often it is read, by default as they say.
    time_ns : mapping of str to array_like of int, shape (n_sensor_samples,), optional
        Stamps of the readings of each sensor [ns], from any epoch that all share: any clocks, jitter, gaps. They are
        sorted first; what is regular is filtered as rates are. Rates or stamps have to be given, or both.
    belief : mapping or str, optional
        What the filter believes about each sensor, such as ``{"mhd_ars": testbed.belief_of("mhd03")}``, or the name of
        a shipped belief; default equation (39) with the presets' noise. "exact" is refused: arrays are no simulation.
    plugins : iterable of str, optional
        Modules that are loaded first, dotted or as paths of ``.py`` files, besides those of ``TESTBED_PLUGINS``.
    verdict : bool, optional
        Say first what stands against the readings: each finding is a `VerdictWarning`, and all are the `findings` of
        what is returned. False for readings that are wrong on purpose, or were judged before.
    **parameters : Any
        Fields of the filter's ``Parameters``, SI floats or strings with units; a class without them gets the mapping.

    Returns
    -------
    EstimateBlock
        Rate, standard deviation [rad/s] and diagnostics at the fastest rate, shape (n_time,); with stamps at those of
        the fastest sensor, in its `time_ns`.

    Raises
    ------
    UnknownNameError
        If no such filter or belief exists.
    ValueError
        If a parameter, a rate, a stamp or the length of a record is wrong, or a filter refuses stamps that are not
        regular, or rates in such a ratio; also if one that is not shipped raises anything when it is built.
    RunError
        If a filter that is not shipped raises anything later, or gives what is no estimate.

    Examples
    --------
    A second at rest, as two sensors without noise would read it, which the verdict would take for stuck: the estimate
    is zero, with the std that the belief in their noise leaves.

    >>> import numpy as np
    >>> readings = {"mhd_ars": np.zeros(20_000), "mems_gyro": np.zeros(2_000)}
    >>> found = estimate("kalman", readings, sample_rate_hz={"mhd_ars": 20e3, "mems_gyro": 2e3}, verdict=False)
    >>> found.rate.shape, bool(np.all(found.rate == 0.0)), bool(found.std[-1] < found.std[0])
    ((20000,), True, True)

    The same with stamps, the gyro's on a clock that is 0.2 % fast and half a millisecond late.

    >>> stamps = {"mhd_ars": np.arange(20_000) * 50_000, "mems_gyro": 500_000 + np.arange(2_000) * 499_000}
    >>> found = estimate("kalman", readings, time_ns=stamps, verdict=False)
    >>> found.rate.shape, found.time_ns[-1]
    ((20000,), np.int64(999950000))
    """
    from testbed.fusion.analysis.verdict import even_stamps
    from testbed.fusion.belief import default_belief, load_belief
    from testbed.fusion.checked import CheckedFilter
    from testbed.fusion.stamps import rates_of, regular, sorted_by_time
    from testbed.inputs.plugins import load_plugins, running
    from testbed.parts import resolve

    kind = "filter"
    cls = resolve(kind, name, FILTERS, load_plugins(plugins)) if isinstance(name, str) else name
    believed = default_belief() if belief is None else load_belief(belief)
    model = getattr(cls, "Parameters", dict)
    if time_ns is not None:
        readings, time_ns = sorted_by_time(readings, time_ns)
        sample_rate_hz = rates_of(time_ns) if sample_rate_hz is None else sample_rate_hz
    if sample_rate_hz is None:
        msg = "sample_rate_hz: expected the rate of each sensor, or time_ns, the stamps of its readings"
        raise ValueError(msg)
    label, shipped = (name, name in FILTERS) if isinstance(name, str) else (cls.__qualname__, False)
    given = model(**parameters)
    with nullcontext() if shipped else running(f"filter {label}"):
        inner = cls(believed, sample_rate_hz, given)
    stage = CheckedFilter(label, inner, max(sample_rate_hz.values(), default=1.0), shipped=shipped)
    if time_ns is not None and regular(time_ns, sample_rate_hz):
        shown = time_ns[max(sample_rate_hz, key=lambda sensor: sample_rate_hz[sensor])]
        block = replace(stage.process(readings), time_ns=shown)
    else:
        block = stage.process(readings, time_ns)
    stamps = even_stamps(readings, sample_rate_hz) if time_ns is None else time_ns
    return _told(block, readings, stamps, believed) if verdict else block


def _told(
    block: EstimateBlock,
    readings: Mapping[str, ArrayLike],
    time_ns: Mapping[str, NDArray[np.int64]],
    belief: Mapping[str, SensorBelief],
) -> EstimateBlock:
    """Return an estimate with what stands against its readings, and warn of each."""
    from testbed.fusion.analysis.verdict import verdict

    findings = verdict(readings, time_ns, belief).findings
    for one in findings:
        warnings.warn(str(one), VerdictWarning, stacklevel=3)
    return replace(block, findings=findings)


def __getattr__(name: str) -> Any:
    # Imported on demand, so that the registry can be read without numba.
    if name == "EstimateBlock":
        from testbed.fusion.base import EstimateBlock

        return EstimateBlock
    msg = f"module {__name__!r} has no attribute {name!r}"
    raise AttributeError(msg)
