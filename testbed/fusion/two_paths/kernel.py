"""Compiled kernel of the filters of two paths: an integrated fast sensor, held by the inverse of a slow one."""

from __future__ import annotations

import numpy as np
from numba import njit

from testbed.fusion.kernels.covariance import RATE, STD

SLOW_INNOVATION = 2
# Entries of `memory`, what stays between blocks: whether either sensor has begun, its last reading, what the slow path
# has added to the fast one and the slope of that, the variance of the sum, time without the fast sensor [s], steps
# since the slow one, the step of the cycle; what an alternating rate at the start has put into the slow modes of the
# slow path, and what of it is in the sum [rad/s].
(
    FAST_STARTED,
    SLOW_STARTED,
    READING,
    HELD,
    ADDED,
    SLOPE,
    VARIANCE,
    BLIND,
    SLOW_WAIT,
    STEP,
    LEAN,
    LEANING,
) = range(12)
MEMORY_ENTRIES = 12
# Entries of `setting`: step [s]; crossover and slope gain of the settled loop [rad/s], [rad^2/s^2]; its proportional
# gain over the crossover [-]; density of the slow path's noise [rad^2/s]; variance of the slow path alone
# [rad^2/s^2]; w [rad/s] and power [rad^2/s^2] of the sine; steps until the slow sensor
# counts as missing; the rate of rest, NaN if the start is unknown [rad/s]; what is left after a step of what
# the slow path got wrong at its start [-]; drift of the fast path by itself [rad^2/s^3].
PERIOD, CROSSOVER, SLOPE_GAIN, GAIN, DENSITY, ALONE, TURN, POWER, PATIENCE, REST, UPRIGHT, DRIFT = range(12)


@njit(cache=True, error_model="numpy")
def departure(setting, blind):  # type: ignore[no-untyped-def]  # pragma: no cover
    """Return the mean square [rad^2/s^2] by which the sine has left its value after `blind` seconds."""
    quiet = blind * setting[TURN]
    return 2.0 * setting[POWER] * (1.0 - np.exp(-0.5 * quiet * quiet))


@njit(cache=True, error_model="numpy")
def output(x, C, D, u):  # type: ignore[no-untyped-def]  # pragma: no cover
    """Return C x + D u."""
    total = D * u
    for i in range(x.size):
        total += C[i] * x[i]
    return total


@njit(cache=True, error_model="numpy")
def advance(x, moved, Phi, Gamma, ramp, before, step):  # type: ignore[no-untyped-def]  # pragma: no cover
    """Set x = Phi x + Gamma u + ramp (u+ - u), u the input before and `step` its increment."""
    for i in range(x.size):
        moved[i] = Gamma[i] * before + ramp[i] * step
        for j in range(x.size):
            moved[i] += Phi[i, j] * x[j]
    for i in range(x.size):
        x[i] = moved[i]


@njit(cache=True, error_model="numpy")
def two_paths(x_fast, x_slow, fast_path, slow_path, memory, settled, setting, fast, slow, out):  # type: ignore[no-untyped-def]  # noqa: PLR0912, PLR0915  # pragma: no cover
    """Run both paths and the loop between them over a block.

    A path is (Phi, Gamma, ramp, C, D, still), `still` its states in equilibrium with a unit input. `fast` has a reading
    at every step, `slow` where it is not NaN; infinite is a missing one. `settled` (n_step,) is the error variance of
    the cycle of slow readings.
    """
    Phi, Gamma, ramp, C, D, still = fast_path
    Phi_slow, Gamma_slow, _, C_slow, D_slow, still_slow = slow_path
    moved, moved_slow = np.empty(x_fast.size), np.empty(x_slow.size)
    T, crossover = setting[PERIOD], setting[CROSSOVER]
    final = setting[DENSITY] * crossover
    turn = np.tanh(crossover * T)
    for k in range(fast.size):
        out[SLOW_INNOVATION, k] = np.nan
        seen = np.isfinite(fast[k])
        if memory[FAST_STARTED] > 0.0:
            z = fast[k] if seen else memory[READING]
            advance(x_fast, moved, Phi, Gamma, ramp, memory[READING], z - memory[READING])
            memory[READING] = z
        elif seen:
            memory[FAST_STARTED], memory[READING] = 1.0, fast[k]
            for i in range(x_fast.size):
                x_fast[i] = still[i] * fast[k]
            if not np.isnan(setting[REST]):
                memory[ADDED] = setting[REST] - output(x_fast, C, D, fast[k])
        if memory[SLOW_STARTED] > 0.0:
            advance(x_slow, moved_slow, Phi_slow, Gamma_slow, Gamma_slow, memory[HELD], 0.0)
        memory[SLOW_WAIT] += 1.0
        if np.isfinite(slow[k]):
            if memory[SLOW_STARTED] == 0.0:
                for i in range(x_slow.size):
                    x_slow[i] = still_slow[i] * slow[k]
            memory[SLOW_STARTED], memory[HELD], memory[SLOW_WAIT] = 1.0, slow[k], 0.0
        alone = output(x_slow, C_slow, D_slow, memory[HELD])
        carried = output(x_fast, C, D, memory[READING])
        started = memory[FAST_STARTED] + memory[SLOW_STARTED] > 0.0
        if seen:
            memory[BLIND] = 0.0
        elif started:
            memory[BLIND] += T
            memory[VARIANCE] += departure(setting, memory[BLIND]) - departure(setting, memory[BLIND] - T)
        if memory[SLOW_STARTED] > 0.0 and memory[SLOW_WAIT] < setting[PATIENCE]:
            # The slow path alone is never worse than this, and w = p / N^2 follows w' = w_c^2 - w^2.
            w = min(memory[VARIANCE], setting[ALONE]) / setting[DENSITY]
            e = alone - carried - memory[ADDED]
            if np.isfinite(slow[k]):
                out[SLOW_INNOVATION, k] = e
            if seen:
                gain = max(w, setting[GAIN] * min(w, crossover))
                share = 1.0 - np.exp(-gain * T)
                memory[ADDED] += share * e + T * memory[SLOPE]
                memory[LEANING] += share * (memory[LEAN] - memory[LEANING])
                memory[SLOPE] += T * setting[SLOPE_GAIN] * e
                memory[VARIANCE] = setting[DENSITY] * crossover * (w + crossover * turn) / (crossover + w * turn)
            elif memory[FAST_STARTED] == 0.0 or memory[VARIANCE] >= setting[ALONE]:
                memory[ADDED] += e
                memory[LEANING], memory[VARIANCE] = memory[LEAN], setting[ALONE]
        else:
            memory[ADDED] += T * memory[SLOPE]
            if started:
                memory[VARIANCE] += setting[DRIFT] * T
        if memory[SLOW_STARTED] > 0.0:
            memory[LEAN] *= setting[UPRIGHT]
        step = int(memory[STEP])
        rate = carried + memory[ADDED]
        if not started:
            rate = 0.0 if np.isnan(setting[REST]) else setting[REST]
        out[RATE, k] = rate
        # Before the loop has settled its part is more, after a known rest less, but the fast path's stays.
        loop = max(settled[step] + memory[VARIANCE] - final, 0.1 * settled[step])
        out[STD, k] = np.sqrt(loop + memory[LEANING] * memory[LEANING])
        memory[STEP] = (step + 1) % settled.size
