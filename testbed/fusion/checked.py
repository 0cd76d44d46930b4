"""A filter under watch: it gets read-only readings, and what it gives is checked before anybody sees it."""

from __future__ import annotations

import re
from dataclasses import replace
from typing import TYPE_CHECKING, Any, NoReturn

import numpy as np

from testbed.errors import RunError, quoted
from testbed.fusion.base import EstimateBlock
from testbed.inputs.plugins import PluginError, running

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from numpy.typing import ArrayLike

    from testbed.fusion.analysis.indicator import FrequencyRows
    from testbed.signals import FloatArray

_NAME = re.compile(r"[A-Za-z][A-Za-z0-9_]{0,63}")
# What stands beside the diagnostics of a filter in a run.
_TAKEN = {"rate", "std", "time"}


class CheckedFilter:
    """A filter whose blocks are checked: shape for all, and for a plug-in everything else that others rely on.

    Parameters
    ----------
    name : str
        Of the filter, for messages.
    inner : object
        With ``process(readings)``.
    sample_rate_hz : float
        Of the fastest sensor [Hz].
    shipped : bool
        Whether it is one of ours: those may show how they fail, by a NaN or a zero.
    """

    def __init__(self, name: str, inner: Any, sample_rate_hz: float, *, shipped: bool) -> None:
        self._name, self._inner, self._rate_hz, self._shipped = name, inner, sample_rate_hz, shipped
        self._block, self._sample = 0, 0
        self._diagnostics: tuple[str, ...] | None = None
        self._frequency: FrequencyRows | None = inner.frequency if shipped else None

    def process(
        self, readings: Mapping[str, ArrayLike], time_ns: Mapping[str, ArrayLike] | None = None
    ) -> EstimateBlock:
        """Return the estimate of the next block.

        Parameters
        ----------
        readings : mapping of str to array_like, shape (n_sensor_samples,)
            Readings that fall due [rad/s]; the filter gets views that it cannot change.
        time_ns : mapping of str to array_like of int, shape (n_sensor_samples,), optional
            Their stamps [ns] (`BlockFilter.process`).

        Raises
        ------
        RunError
            If it raises anything or gives what is no estimate: filter, block and fault.
        ValueError
            If there are stamps and it takes none.
        """
        self._block += 1
        views = [{name: _read_only(values) for name, values in readings.items()}]
        n_time = max(values.size for values in views[0].values())
        if time_ns is not None:
            self.check_clocks()
            views.append({name: _read_only(values) for name, values in time_ns.items()})
        estimate = self._inner.process(*views) if self._shipped else self._foreign(views)
        rows: dict[str, FloatArray] = {}
        if not (time_ns is None and self._even()):
            n_time = -1 if estimate.time_ns is None else estimate.time_ns.size
        elif self._frequency is not None:
            rows = self._frequency.process(views[0], n_time)
        self._check_shapes(estimate, n_time)
        checked = estimate if self._shipped else self._checked(estimate)
        self._sample += n_time
        return _beside(checked, rows)

    def check_clocks(self) -> None:
        """Raise ValueError if the filter takes no readings with stamps or of odd rates."""
        check = getattr(self._inner, "check_clocks", None)
        if check is None:
            msg = f"time_ns: filter {self._name} takes readings at regular steps only, no stamps"
            raise ValueError(msg)
        check()

    def tried(
        self, readings: Mapping[str, FloatArray], time_ns: Mapping[str, ArrayLike] | None = None
    ) -> EstimateBlock:
        """Return the estimate of the next block of a trial: of a shipped filter, whose kernels would take seconds to
        compile and whose faults show when it is built, only what it gives, undefined.

        Parameters
        ----------
        readings, time_ns : mapping of str to ndarray, shape (n_sensor_samples,)
            As for `process`, which a plug-in gets them by.
        """
        if not self._shipped:
            return self.process(readings, time_ns)
        timed = not (time_ns is None and self._even())
        n_time = max(values.size for values in readings.values())
        rows = {} if timed or self._frequency is None else self._frequency.blank(n_time)
        return _beside(self._inner.blank(n_time, timed=timed), rows)

    def _even(self) -> bool:
        """Return whether readings without stamps come at regular steps, one estimate for each of the fastest sensor."""
        schedule = getattr(self._inner, "schedule", None)
        return bool(getattr(schedule, "even", True))

    @property
    def untried_seconds(self) -> float:
        """About how long a step takes of which `tried` does nothing [s]."""
        return float(self._inner.step_seconds) if self._shipped else 0.0

    def _foreign(self, given: Sequence[Mapping[str, FloatArray]]) -> EstimateBlock:
        try:
            with running("raised"):
                estimate = self._inner.process(*given)
        except PluginError as error:
            self._refuse(str(error), error)
        if not isinstance(estimate, EstimateBlock):
            self._refuse(f"expected an EstimateBlock, got {quoted(estimate)}")
        self._check_names(estimate.diagnostics)
        return estimate

    def _check_names(self, diagnostics: Any) -> None:
        good = isinstance(diagnostics, dict) and all(
            isinstance(key, str) and _NAME.fullmatch(key) and key not in _TAKEN for key in diagnostics
        )
        if not good:
            self._refuse(
                "expected diagnostics by names of letters, digits and underscores other than rate, std and time, "
                f"got {quoted(diagnostics)}"
            )
        names = tuple(sorted(diagnostics))
        if self._diagnostics is not None and names != self._diagnostics:
            self._refuse(f"expected the diagnostics of the first block, {self._diagnostics}, got {quoted(names)}")
        self._diagnostics = names

    def _check_shapes(self, estimate: EstimateBlock, n_time: int) -> None:
        for signal, values in (("rate", estimate.rate), ("std", estimate.std), *estimate.diagnostics.items()):
            if np.shape(values) != (n_time,):
                self._refuse(f"expected {signal} of shape ({n_time},), got {np.shape(values)}")

    def _checked(self, estimate: EstimateBlock) -> EstimateBlock:
        rate, std = self._real("rate", estimate.rate), self._real("std", estimate.std)
        for signal, values, good, what in (
            ("rate", rate, np.isfinite(rate), "finite values"),
            ("std", std, (std > 0.0) & np.isfinite(std), "finite values above zero"),
        ):
            if not good.all():
                first = int(np.argmin(good))
                self._refuse(f"expected {what} of {signal}, got {values[first]!s} at sample {first} of the block")
        diagnostics = {name: self._real(name, values) for name, values in estimate.diagnostics.items()}
        return EstimateBlock(rate, std, diagnostics)

    def _real(self, signal: str, values: Any) -> FloatArray:
        """Return a copy, since a plug-in may go on changing what it gave."""
        kind = np.asarray(values).dtype
        if kind.kind != "f":
            self._refuse(f"expected {signal} of floating-point numbers, got {kind}")
        return np.array(values, dtype=np.float64)

    def _refuse(self, what: str, cause: Exception | None = None) -> NoReturn:
        at = self._sample / self._rate_hz
        msg = f"filter {self._name}, block {self._block} (from t = {at:g} s): {what}"
        raise RunError(msg) from cause


def _beside(estimate: EstimateBlock, rows: dict[str, FloatArray]) -> EstimateBlock:
    return replace(estimate, diagnostics=estimate.diagnostics | rows) if rows else estimate


def _read_only(values: ArrayLike) -> FloatArray:
    view: FloatArray = np.asarray(values).view()
    view.flags.writeable = False
    return view
