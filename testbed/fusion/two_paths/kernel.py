"""Compiled kernel of the filters of two paths: an integrated fast sensor, held by the inverse of a slow one."""

from __future__ import annotations

import numpy as np
from numba import njit

from testbed.fusion.kernels.covariance import NODES, RATE, STD

SLOW_INNOVATION = 2
# Entries of `memory`, what stays between blocks: whether either sensor has begun, its last reading, what the slow path
# has added to the fast one and the slope of that, the variance of the sum, time without the fast sensor [s], steps
# since the slow one, the step of the cycle. Of the slow path's beginning: the mean of its readings since [rad/s] and
# their number, what is left in its slow modes of a unit that they got wrong and what of it is in the sum [-], and the
# variance of its fast modes [rad^2/s^2]. Of steps between stamps: nodes since the last one that had to do with the fast
# sensor, and whether the slow one was read since.
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
    MEAN,
    COUNT,
    LEFT,
    TAKEN,
    RISING,
    SINCE,
    FRESH,
) = range(17)
MEMORY_ENTRIES = 17
# Steps this close to a node are taken for it, in nodes: two of those that `testbed.fusion.kernels.merging` takes.
_NEAR = 0.02
# Entries of `setting`: step [s]; crossover of the settled loop [rad/s]; what its slope takes of an error over a step
# [rad/s]; its proportional gain over the crossover [-]; density of the slow path's noise [rad^2/s]; variance of the
# slow path alone [rad^2/s^2]; w [rad/s] and power [rad^2/s^2] of the sine; steps until the slow sensor counts as
# missing; the rate of rest, NaN if the start is unknown [rad/s]; what is left of the slow modes after a step [-].
PERIOD, CROSSOVER, SLOPE_GAIN, GAIN, DENSITY, ALONE, TURN, POWER, PATIENCE, REST, UPRIGHT = range(11)
# The fast path's drift by itself [rad^2/s^3], the fast reading at rest [rad/s], and the share of a change that the fast
# sensor forgets in a second [1/s]; variance that slow noise leaves behind the settled loop [rad^2/s^2]; the slow
# reading at rest [rad/s]; what an alternating rate leaves in the slow modes if they begin at its first value [rad/s];
# variance of the fast modes there [rad^2/s^2] and what is left of it after a step [-]; readings that the mean at the
# beginning is over [-], and how many make a radian of the alternating rate [-]. What is left of the slope after a step
# [-].
DRIFT, REST_READING, FORGOTTEN, SLOW, REST_SLOW, LEAN, ROUGH, CALM, MEAN_OVER, RADIAN, FADE = range(11, 22)


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
def advance(x, moved, Phi, Gamma, ramp, j, s, before, step):  # type: ignore[no-untyped-def]  # pragma: no cover
    """Set x = Phi x + Gamma u + ramp (u+ - u), u the input before and `step` its increment, by the matrices that lie
    the share s behind those of node j.
    """
    for i in range(x.size):
        total = Gamma[j, i] * before + ramp[j, i] * step
        for k in range(x.size):
            total += Phi[j, i, k] * x[k]
        if s != 0.0:
            other = Gamma[j + 1, i] * before + ramp[j + 1, i] * step
            for k in range(x.size):
                other += Phi[j + 1, i, k] * x[k]
            total += s * (other - total)
        moved[i] = total
    for i in range(x.size):
        x[i] = moved[i]


@njit(cache=True, error_model="numpy")
def placed(place):  # type: ignore[no-untyped-def]  # pragma: no cover
    """Return the node at or before a place in the tables, and how far it is from there to the next one."""
    j = int(place)
    s = place - j
    if s < _NEAR:
        return j, 0.0
    if s > 1.0 - _NEAR:
        return j + 1, 0.0
    return j, s


@njit(cache=True, error_model="numpy")
def lean_variance(memory, setting):  # type: ignore[no-untyped-def]  # pragma: no cover
    """Return what the slow modes have put into the sum [rad^2/s^2]: of a sine of any phase the mean over t is
    1 / (sqrt(2) pi f t).
    """
    lean = memory[TAKEN] * setting[LEAN] * min(1.0, setting[RADIAN] / max(memory[COUNT], 1.0))
    return lean * lean


@njit(cache=True, error_model="numpy")
def begin_slow(x, still, memory, setting, z, unknown):  # type: ignore[no-untyped-def]  # pragma: no cover
    """Put the slow path in equilibrium with a reading: that of a known rest, or one whose mean is not known yet."""
    for i in range(x.size):
        x[i] = still[i] * z
    if unknown:
        memory[VARIANCE] += lean_variance(memory, setting)
        memory[MEAN], memory[COUNT], memory[LEFT], memory[TAKEN] = z, 1.0, 1.0, 0.0
        memory[RISING] = setting[ROUGH]


@njit(cache=True, error_model="numpy")
def follow_mean(x, C, slow_still, memory, setting, z):  # type: ignore[no-untyped-def]  # pragma: no cover
    """Move the slow modes to where they were if they had begun in equilibrium with the mean of the readings, and with
    them what they have put into the sum.
    """
    memory[COUNT] += 1.0
    change = (z - memory[MEAN]) / memory[COUNT]
    memory[MEAN] += change
    for i in range(x.size):
        x[i] += slow_still[i] * change * memory[LEFT]
        memory[ADDED] += C[i] * slow_still[i] * change * memory[TAKEN]


@njit(cache=True, error_model="numpy")
def two_paths(x_fast, x_slow, fast_path, slow_path, memory, settled, setting, fast, slow, steps, out):  # type: ignore[no-untyped-def]  # noqa: PLR0912, PLR0915  # pragma: no cover
    """Run both paths and the loop between them over a block.

    A path is (Phi, Gamma, ramp, C, D, still), the first three tables over the length of a step, `still` its states in
    equilibrium with a unit input; of the slow one its slow modes by themselves stand behind it. At regular steps `fast`
    has a reading at every one, `slow` where it is not NaN; infinite is a missing one. `settled` (n_step,) is the error
    variance of the cycle of slow readings.

    `steps` = (node, share, whole) says how steps of any length are reached, as in `testbed.fusion.kernels.covariance`;
    without any the tables have one node, the regular step. At a step with a slow reading alone the slow path moves to
    it and takes it; the fast path, whose reading is a straight line to its next, and the loop go on at that one, over
    the whole of the time since.
    """
    Phi, Gamma, ramp, C, D, still = fast_path
    Phi_slow, Gamma_slow, ramp_slow, C_slow, D_slow, still_slow, modes = slow_path
    moved, moved_slow = np.empty(x_fast.size), np.empty(x_slow.size)
    node, share_of, whole = steps
    timed = node.size > 0
    regular = NODES if timed else 0
    T, crossover = setting[PERIOD], setting[CROSSOVER]
    final = setting[DENSITY] * crossover
    for k in range(fast.size):
        out[SLOW_INNOVATION, k] = np.nan
        turns = whole[k] + 1 if timed else 1
        for turn in range(turns):
            last = turn == turns - 1
            z_fast, z_slow = (fast[k], slow[k]) if last else (np.inf, np.nan)
            seen = np.isfinite(z_fast)
            j, s = (node[k], share_of[k]) if timed and last else (regular, 0.0)
            place = memory[SINCE] + j + s if timed else 1.0 * NODES
            if abs(place - NODES) < _NEAR:
                place = 1.0 * NODES
            span, tau = (j + s) / NODES if timed else 1.0, T * (place / NODES)
            # Of the fast sensor none is due here, and none has been missing.
            waiting = timed and np.isnan(z_fast) and memory[FAST_STARTED] > 0.0 and memory[BLIND] == 0.0
            memory[SINCE] = place if waiting else 0.0
            if seen and memory[FAST_STARTED] == 0.0 and not np.isnan(setting[REST]):
                # What is known of a rest is not the first reading with its noise.
                memory[FAST_STARTED], memory[READING] = 1.0, setting[REST_READING]
                for i in range(x_fast.size):
                    x_fast[i] = still[i] * memory[READING]
                memory[ADDED] = setting[REST] - output(x_fast, C, D, memory[READING])
            if memory[FAST_STARTED] > 0.0 and not waiting:
                z = z_fast if seen else memory[READING]
                parts, j_fast, s_fast = 1, regular, 0.0
                if timed and place != NODES:
                    # No table is longer than one and a half steps.
                    parts = max(int(np.ceil(place / (1.5 * NODES))), 1)
                    j_fast, s_fast = placed(place / parts)
                before, step = memory[READING], (z - memory[READING]) / parts
                for part in range(parts):
                    advance(x_fast, moved, Phi, Gamma, ramp, j_fast, s_fast, before + part * step, step)
                memory[READING] = z
            elif seen:
                memory[FAST_STARTED], memory[READING] = 1.0, z_fast
                for i in range(x_fast.size):
                    x_fast[i] = still[i] * z_fast
            if memory[SLOW_STARTED] > 0.0:
                advance(x_slow, moved_slow, Phi_slow, Gamma_slow, ramp_slow, j, s, memory[HELD], 0.0)
                memory[LEFT] *= setting[UPRIGHT] if span == 1.0 else 1.0 - span * (1.0 - setting[UPRIGHT])
                memory[RISING] *= setting[CALM] if span == 1.0 else setting[CALM] ** span
            memory[SLOW_WAIT] += span
            if np.isfinite(z_slow):
                if memory[SLOW_STARTED] == 0.0 and not np.isnan(setting[REST]):
                    begin_slow(x_slow, still_slow, memory, setting, setting[REST_SLOW], False)
                    memory[HELD] = setting[REST_SLOW]
                elif memory[SLOW_STARTED] == 0.0 or memory[SLOW_WAIT] >= setting[PATIENCE]:
                    begin_slow(x_slow, still_slow, memory, setting, z_slow, True)
                elif 0.0 < memory[COUNT] < setting[MEAN_OVER]:
                    follow_mean(x_slow, C_slow, modes, memory, setting, z_slow)
                memory[SLOW_STARTED], memory[HELD], memory[SLOW_WAIT], memory[FRESH] = 1.0, z_slow, 0.0, 1.0
            if waiting:
                continue
            alone = output(x_slow, C_slow, D_slow, memory[HELD])
            carried = output(x_fast, C, D, memory[READING])
            started = memory[FAST_STARTED] + memory[SLOW_STARTED] > 0.0
            if seen:
                # What the fast sensor has forgotten of the change that it did not show.
                lost = min(0.5 * setting[FORGOTTEN] * memory[BLIND], 1.0)
                memory[VARIANCE] += lost * lost * departure(setting, memory[BLIND])
                memory[BLIND] = 0.0
            elif started:
                memory[BLIND] += tau
            gone = departure(setting, memory[BLIND])
            # Of the slope over this step: what is left, and what it takes of an error.
            fade, slope_gain = setting[FADE], setting[SLOPE_GAIN]
            if tau != T:
                fade = fade ** (tau / T)
                slope_gain *= (1.0 - fade) / (1.0 - setting[FADE]) if setting[FADE] < 1.0 else tau / T
            if memory[SLOW_STARTED] > 0.0 and memory[SLOW_WAIT] < setting[PATIENCE]:
                by_itself = setting[ALONE] + memory[RISING]
                e = alone - carried - memory[ADDED]
                if memory[FRESH] > 0.0:
                    out[SLOW_INNOVATION, k] = e
                # Beside a fast sensor only until the loop has settled.
                if memory[VARIANCE] + gone >= by_itself and (memory[VARIANCE] > final or not seen):
                    memory[ADDED] += e
                    memory[TAKEN], memory[VARIANCE] = memory[LEFT], by_itself
                    e, gone = 0.0, 0.0
                if seen:
                    # w = p / N^2 follows w' = w_c^2 - w^2. While its fast modes last, which err alike for so long, the
                    # slow path is the noisier one, and the crossover c lower.
                    density = setting[DENSITY] - 2.0 * T * memory[RISING] / np.log(setting[CALM])
                    c = crossover * np.sqrt(setting[DENSITY] / density)
                    w, turn_back = memory[VARIANCE] / density, np.tanh(c * tau)
                    # From w at first to the settled gain, whichever is the larger.
                    gain = max(w + min(setting[GAIN] - 1.0, 0.0) * crossover, setting[GAIN] * min(w, crossover))
                    share = 1.0 - np.exp(-gain * tau)
                    memory[ADDED] += share * e + tau * memory[SLOPE]
                    memory[TAKEN] += share * (memory[LEFT] - memory[TAKEN])
                    memory[SLOPE] = fade * memory[SLOPE] + slope_gain * e
                    memory[VARIANCE] = density * c * (w + c * turn_back) / (c + w * turn_back)
            else:
                memory[ADDED] += tau * memory[SLOPE]
                memory[SLOPE] *= fade
                if started:
                    memory[VARIANCE] += setting[DRIFT] * tau
            memory[FRESH] = 0.0
            step_of_cycle = int(memory[STEP])
            rate = carried + memory[ADDED]
            if not started:
                rate = 0.0 if np.isnan(setting[REST]) else setting[REST]
            out[RATE, k] = rate
            # Before the loop has settled its part is more, after a known rest less, but the fast path's stays.
            loop = max(settled[step_of_cycle] + memory[VARIANCE] - final, 0.1 * settled[step_of_cycle]) + gone
            loop += setting[SLOW] * min(memory[VARIANCE] / final, 1.0)
            out[STD, k] = np.sqrt(loop + lean_variance(memory, setting))
            memory[STEP] = (step_of_cycle + 1) % settled.size
