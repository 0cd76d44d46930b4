"""Compiled kernel of the filters of two fixed paths: a fast sensor read at every step and a slow one that is held
between its readings.
"""

from __future__ import annotations

import numpy as np
from numba import njit

from testbed.fusion.kernels.covariance import RATE, STD

# Row of the output behind RATE and STD.
SLOW_INNOVATION = 2
# Rows of `memory`, what stays between blocks.
STARTED, READING, HELD, ESTIMATE, BLIND_TIME, SLOW_WAIT, DRIFT_VARIANCE, STEP, FAST_OUTSIDE, SLOW_OUTSIDE = range(10)
MEMORY_ROWS = 10
# Entries of `setting`: 1 to hold the innovation and 0 to hold the reading; step [s]; w [rad/s] and power [rad^2/s^2] of
# the sine; what one second without readings costs: of the fast sensor in relative rate [1/s], of the slow one in
# variance [rad^2/s^3]; decay per step of that; steps until the slow sensor counts as missing; square of the gate
# against spikes [-] and how many in a row it keeps out; variance of the noise of a reading, fast and slow [rad^2/s^2].
INNOVATE, PERIOD, TURN, POWER, FORGOTTEN, DRIFT, DECAY, PATIENCE, GATE_SQUARE, IN_A_ROW, FAST_NOISE, SLOW_NOISE = range(
    12
)


@njit(cache=True, error_model="numpy")
def admitted(memory, row, limit, error, variance, gate_square):  # type: ignore[no-untyped-def]  # pragma: no cover
    """Return whether a reading is taken: not missing and not one of the first `limit` in a row outside the gate,
    counted in `memory[row]`.
    """
    if not np.isfinite(error):
        return False
    memory[row] = memory[row] + 1.0 if error * error > gate_square * variance else 0.0
    return not 0.0 < memory[row] <= limit


@njit(cache=True, error_model="numpy")
def departure(setting, started, blind):  # type: ignore[no-untyped-def]  # pragma: no cover
    """Return the mean square [rad^2/s^2] by which the sine has left its value after `blind` seconds."""
    quiet = blind * setting[TURN]
    return 2.0 * setting[POWER] * (1.0 - np.exp(-0.5 * quiet * quiet) if started > 0.0 else 1.0)


@njit(cache=True, error_model="numpy")
def two_paths(x, memory, Phi, Gamma, ramp, E, C, D, H, J, settled, setting, fast, slow, out):  # type: ignore[no-untyped-def]  # noqa: PLR0912, PLR0915  # pragma: no cover
    """Run x+ = Phi x + Gamma z + ramp (z+ - z) + E h, rate = C x + D z, predicted slow reading = H x + J z, over a
    block.

    `fast` has a reading at every step, `slow` where it is not NaN; infinite is a missing one. Without a fast reading
    the rate stays as it is, and z is the reading that this would have caused. `settled` (n_step,) is the error variance
    of the cycle of slow readings.
    """
    n = x.size
    moved = np.empty(n)
    for k in range(fast.size):
        out[SLOW_INNOVATION, k] = np.nan
        step = int(memory[STEP])
        known = settled[step] + memory[DRIFT_VARIANCE]
        spread = known + departure(setting, memory[STARTED], memory[BLIND_TIME] + setting[PERIOD])
        seen = False
        if memory[STARTED] == 0.0:
            seen = admitted(
                memory, FAST_OUTSIDE, setting[IN_A_ROW], fast[k], spread + setting[FAST_NOISE], setting[GATE_SQUARE]
            )
            if seen:
                memory[STARTED], memory[READING], memory[ESTIMATE] = 1.0, fast[k], D * fast[k]
        else:
            before, held = memory[READING], memory[HELD]
            total, slope = 0.0, D
            for i in range(n):
                moved[i] = Gamma[i] * before + E[i] * held
                for j in range(n):
                    moved[i] += Phi[i, j] * x[j]
                total += C[i] * (moved[i] - ramp[i] * before)
                slope += C[i] * ramp[i]
            still = (memory[ESTIMATE] - total) / slope
            variance = spread + setting[FAST_NOISE]
            seen = admitted(memory, FAST_OUTSIDE, setting[IN_A_ROW], fast[k] - still, variance, setting[GATE_SQUARE])
            z = fast[k] if seen else still
            for i in range(n):
                x[i] = moved[i] + ramp[i] * (z - before)
            memory[READING] = z
            if seen:
                memory[ESTIMATE] = total + slope * z
        if memory[STARTED] > 0.0 and seen:
            lost = min(0.5 * setting[FORGOTTEN] * memory[BLIND_TIME], 1.0)
            memory[DRIFT_VARIANCE] += lost * lost * departure(setting, 1.0, memory[BLIND_TIME])
            memory[BLIND_TIME] = 0.0
        else:
            memory[BLIND_TIME] += setting[PERIOD]
        memory[SLOW_WAIT] += 1.0
        if not np.isnan(slow[k]):
            predicted = J * memory[READING]
            for i in range(n):
                predicted += H[i] * x[i]
            variance = spread + setting[SLOW_NOISE]
            there = admitted(
                memory, SLOW_OUTSIDE, setting[IN_A_ROW], slow[k] - predicted, variance, setting[GATE_SQUARE]
            )
            # A loop around a rate that stands still would wind up.
            there = there and (seen or setting[INNOVATE] == 0.0)
            reading = slow[k] if there else predicted
            memory[HELD] = reading - setting[INNOVATE] * predicted
            if there:
                out[SLOW_INNOVATION, k] = reading - predicted
                memory[SLOW_WAIT] = 0.0
        if memory[SLOW_WAIT] >= setting[PATIENCE]:
            memory[DRIFT_VARIANCE] += setting[DRIFT] * setting[PERIOD]
        elif memory[BLIND_TIME] == 0.0:
            memory[DRIFT_VARIANCE] *= setting[DECAY]
        hold = departure(setting, memory[STARTED], memory[BLIND_TIME])
        out[RATE, k] = memory[ESTIMATE]
        out[STD, k] = np.sqrt(settled[step] + memory[DRIFT_VARIANCE] + hold)
        memory[STEP] = (step + 1) % settled.size
