"""MuJoCo in time: inputs held over each base step in, sensor rows at its instants out, failures named."""

from __future__ import annotations

import contextlib
from typing import TYPE_CHECKING, Any

import mujoco
import numpy as np
from mujoco.batch import Batch

from testbed.errors import RunError

if TYPE_CHECKING:
    from collections.abc import Iterator

    from testbed.signals import FloatArray

# No angle, position or rate of a table is anywhere near; MuJoCo itself complains only at 1e10.
_HUGE = 1e6


class Engine:
    """Steps a model and keeps its state between calls; any division into calls gives the same bits.

    Parameters
    ----------
    model : mujoco.MjModel
        Its step is that of the base clock divided by `substeps`.
    qpos, qvel : ndarray, shapes (nq,), (nv,)
        Initial state [rad, m; rad/s, m/s].
    substeps : int
        Steps of the model per step of the base clock.
    """

    def __init__(self, model: Any, qpos: FloatArray, qvel: FloatArray, substeps: int) -> None:
        self._batch = Batch(model, nsim=1, nthread=1)
        self._batch.bind("qpos")[0] = qpos
        self._batch.bind("qvel")[0] = qvel
        self._substeps = substeps
        self._dt = model.opt.timestep * substeps

    def advance(self, start: int, control: FloatArray) -> FloatArray:
        """Run over the next steps.

        Parameters
        ----------
        start : int
            Index k of the first step; for messages.
        control : ndarray, shape (n_time, nu)
            Inputs, each held over one step of the base clock.

        Returns
        -------
        ndarray, shape (n_time, nsensordata)
            Sensor rows at t_start ... t_(start + n_time - 1): MuJoCo's row belongs to the state before its step.

        Raises
        ------
        RunError
            If an input is not finite, or the plant diverges; with the time.
        """
        refuse_bad_control(control, start, self._dt)
        if not len(control):
            return np.empty((0, self._batch.model.nsensordata))
        held = np.repeat(control, self._substeps, axis=0)
        with quiet():
            record = self._batch.rollout(len(held), held[None], record=("sensordata",))
        rows: FloatArray = record["sensordata"][0, :: self._substeps]
        refuse_bad_rows(rows, start, self._batch.warning[0, :, 1], round(self._batch.time[0] / self._dt), self._dt)
        return rows


def refuse_bad_control(control: FloatArray, start: int, dt: float) -> None:
    """Raise RunError with the time if an input is not finite: MuJoCo would zero all of them and go on.

    Parameters
    ----------
    control : ndarray, shape (n_time, nu)
        Inputs of the steps from `start` on.
    start : int
        Index of the first step.
    dt : float
        Step of the base clock [s].
    """
    bad = ~np.isfinite(control).all(axis=1)
    if bad.any():
        _fail("a control that is not finite", start + int(np.argmax(bad)), dt)


def refuse_bad_rows(rows: FloatArray, start: int, warnings: Any, reached: int, dt: float) -> None:
    """Raise RunError with the time if the plant diverged or MuJoCo complained.

    Parameters
    ----------
    rows : ndarray, shape (n_time, nsensordata)
        Sensor rows from `start` on.
    start : int
        Index of the first row.
    warnings : sequence of int
        MuJoCo's counters of its warnings.
    reached : int
        Index of the step that MuJoCo got to.
    dt : float
        Step of the base clock [s].
    """
    wild = ~(np.abs(rows).max(axis=1) < _HUGE)
    if wild.any():
        _fail("the plant diverged", start + int(np.argmax(wild)), dt)
    if np.any(warnings):
        kind = mujoco.mjtWarning(int(np.argmax(warnings))).name.removeprefix("mjWARN_")
        _fail(f"MuJoCo stopped ({kind})", reached, dt)


def _fail(what: str, k: int, dt: float) -> None:
    msg = f"turntable: {what} at t = {k * dt:.6g} s; the run got this far"
    raise RunError(msg)


@contextlib.contextmanager
def quiet() -> Iterator[None]:
    """Keep MuJoCo's warnings off the terminal and out of a MUJOCO_LOG.TXT; they are read from the counters instead."""
    # The handler must not raise: an exception that passes through MuJoCo aborts the process.
    previous = mujoco.get_mju_user_warning()
    mujoco.set_mju_user_warning(lambda _message: None)
    try:
        yield
    finally:
        mujoco.set_mju_user_warning(previous)
