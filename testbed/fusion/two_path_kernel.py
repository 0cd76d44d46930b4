"""Compiled kernel of the filters of two fixed paths: a fast sensor read at every step and a slow one that is held between its readings."""

from __future__ import annotations

import numpy as np
from numba import njit

from testbed.fusion.kernels import RATE, STD

SLOW_INNOVATION = 2
OUT_ROWS = 3
# Rows of `memory`, what stays between blocks.
STARTED, READING, HELD, ESTIMATE, BLIND_TIME, SLOW_WAIT, DRIFT_VARIANCE, STEP = range(8)
MEMORY_ROWS = 8
# Entries of `setting`: 1 to hold the innovation and 0 to hold the reading; step [s]; w [rad/s] and power [rad^2/s^2] of the sine; what one
# second without readings costs: of the fast sensor in relative rate [1/s], of the slow one in variance [rad^2/s^3]; decay per step of that.
INNOVATE, PERIOD, TURN, POWER, FORGOTTEN, DRIFT, DECAY, PATIENCE = range(8)


@njit(cache=True, error_model="numpy")
def two_paths(x, memory, Phi, Gamma, ramp, E, C, D, H, J, settled, setting, fast, slow, out):  # type: ignore[no-untyped-def]  # noqa: PLR0912  # pragma: no cover
    """Run x+ = Phi x + Gamma z + ramp (z+ - z) + E h, rate = C x + D z, predicted slow reading = H x + J z, over a block.

    `fast` has a reading at every step, `slow` where it is not NaN; infinite is a missing one. Without a fast reading the rate stays as it is,
    and z is the reading that this would have caused. `settled` (n_step,) is the error variance of the cycle of slow readings.
    """
    n = x.size
    moved = np.empty(n)
    for k in range(fast.size):
        seen = np.isfinite(fast[k])
        out[SLOW_INNOVATION, k] = np.nan
        if memory[STARTED] == 0.0 and seen:
            memory[STARTED], memory[READING], memory[ESTIMATE] = 1.0, fast[k], D * fast[k]
        elif memory[STARTED] > 0.0:
            before, held = memory[READING], memory[HELD]
            total, slope = 0.0, D
            for i in range(n):
                moved[i] = Gamma[i] * before + E[i] * held
                for j in range(n):
                    moved[i] += Phi[i, j] * x[j]
                total += C[i] * (moved[i] - ramp[i] * before)
                slope += C[i] * ramp[i]
            z = fast[k] if seen else (memory[ESTIMATE] - total) / slope
            for i in range(n):
                x[i] = moved[i] + ramp[i] * (z - before)
            memory[READING] = z
            if seen:
                memory[ESTIMATE] = total + slope * z
        if memory[STARTED] > 0.0 and seen:
            quiet = memory[BLIND_TIME] * setting[TURN]
            lost = min(0.5 * setting[FORGOTTEN] * memory[BLIND_TIME], 1.0)
            memory[DRIFT_VARIANCE] += lost * lost * 2.0 * setting[POWER] * (1.0 - np.exp(-0.5 * quiet * quiet))
            memory[BLIND_TIME] = 0.0
        else:
            memory[BLIND_TIME] += setting[PERIOD]
        memory[SLOW_WAIT] += 1.0
        if not np.isnan(slow[k]):
            predicted = J * memory[READING]
            for i in range(n):
                predicted += H[i] * x[i]
            # A loop around a rate that stands still would wind up.
            there = np.isfinite(slow[k]) and (seen or setting[INNOVATE] == 0.0)
            reading = slow[k] if there else predicted
            memory[HELD] = reading - setting[INNOVATE] * predicted
            if there:
                out[SLOW_INNOVATION, k] = reading - predicted
                memory[SLOW_WAIT] = 0.0
        if memory[SLOW_WAIT] >= setting[PATIENCE]:
            memory[DRIFT_VARIANCE] += setting[DRIFT] * setting[PERIOD]
        elif memory[BLIND_TIME] == 0.0:
            memory[DRIFT_VARIANCE] *= setting[DECAY]
        step = int(memory[STEP])
        quiet = memory[BLIND_TIME] * setting[TURN]
        hold = (
            2.0 * setting[POWER] * (1.0 - np.exp(-0.5 * quiet * quiet))
            if memory[STARTED] > 0.0
            else 2.0 * setting[POWER]
        )
        out[RATE, k] = memory[ESTIMATE]
        out[STD, k] = np.sqrt(settled[step] + memory[DRIFT_VARIANCE] + hold)
        memory[STEP] = (step + 1) % settled.size
