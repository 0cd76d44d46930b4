r"""What a fixed filter leaves once settled, and the best of them for a given signal: closed forms, no simulation.

The readings of several rates repeat in a pattern of S steps, so the covariance settles into a cycle of S matrices: the
periodic Riccati solution. With its gains the filter is linear and periodic; noise and each commanded line pass it
independently.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from testbed.fusion.model import FusionModel, build_model

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping, Sequence

    from numpy.typing import NDArray

    from testbed.fusion.belief import SensorBelief
    from testbed.fusion.start import StartKind
    from testbed.signals import ComplexArray, FloatArray

# Decades of q [rad^2/s^(2m+1)] that are searched, per order m: from a filter slower than the crossover of the sensors
# to one beyond 1 kHz.
DECADES = {1: (-10, 4), 2: (-8, 12), 3: (-6, 17)}
# Where noise beyond the model's is looked for: 1/f is above the white noise below some hertz only.
_COLOURED_HZ = np.logspace(-5.0, 2.0, 71)
# 2^40 periods are past any time constant.
_DOUBLINGS = 40


@dataclass(frozen=True)
class FixedFilters:
    """Settled filters of one model that differ in q: their cycle of gains.

    Parameters
    ----------
    model : FusionModel
        F, H, R, and Q without signal noise.
    q : ndarray, shape (n_q,)
        Signal noise of each filter [rad^2/s^(2m+1)].
    prior : ndarray, shape (n_step, n_q, n_state, n_state)
        Covariance before the readings of each step of the cycle [rad^2/s^2]; all sensors are due at step 0.
    K : ndarray, shape (n_step, n_q, n_state, n_sensor)
        Gains [-], zero for a sensor that is not due.
    """

    model: FusionModel
    q: FloatArray
    prior: FloatArray
    K: FloatArray

    @property
    def std(self) -> FloatArray:
        """What each filter claims: the mean over the cycle of its settled standard deviation [rad/s], shape (n_q,)."""
        std: FloatArray = np.sqrt(np.maximum(self.posterior()[:, :, 0, 0].mean(axis=0), 0.0))
        return std

    def posterior(self) -> FloatArray:
        """Return the covariance after the readings of each step [rad^2/s^2], shape (n_step, n_q, n_state, n_state)."""
        keep = np.eye(self.model.F.shape[0]) - self.K @ self.model.H
        post: FloatArray = keep @ self.prior @ _t(keep) + (self.K * self.model.R) @ _t(self.K)
        return post

    def noise_variance(self) -> FloatArray:
        r"""Return the error variance that each sensor's noise causes [rad^2/s^2], shape (n_sensor, n_q), mean over the
        cycle.

        .. math:: S^+ = (I - K H)(F S F' + Q_i)(I - K H)' + K R_i K'

        for the noise Q_i, R_i of one sensor at a time. Their sum is the error variance for a signal that the filter
        follows without lag.
        """
        model, steps = self.model, len(self.K)
        keep = np.eye(model.F.shape[0]) - self.K @ model.H
        parts = []
        for i in range(len(model.sensors)):
            mine = model.owners == i
            Q = np.where(np.outer(mine, mine), model.Q, 0.0)
            column = self.K[..., i]
            W = keep @ Q @ _t(keep) + model.R[i] * column[..., :, None] * column[..., None, :]
            M = keep @ model.F
            total, power = W[0], M[0]
            for p in range(1, steps):
                total, power = W[p] + M[p] @ total @ _t(M[p]), M[p] @ power
            for _ in range(_DOUBLINGS):
                total, power = total + power @ total @ _t(power), power @ power
            variance = np.zeros(self.q.size)
            for p in range(steps):
                total = W[p] + M[p] @ total @ _t(M[p])
                variance += total[:, 0, 0]
            parts.append(variance / steps)
        return np.array(parts)

    def line_error(self, freq_hz: FloatArray, responses: ComplexArray) -> FloatArray:
        """Return rms over the cycle of |estimate/truth - 1| for a settled sine [-], shape (n_q, n_freq).

        Parameters
        ----------
        freq_hz : ndarray, shape (n_freq,)
            Frequencies [Hz].
        responses : ndarray of complex, shape (n_sensor, n_freq)
            What the sensors truly do, G [-].
        """
        error: FloatArray = np.sqrt(np.mean(np.abs(self.gain(freq_hz, responses) - 1.0) ** 2, axis=0))
        return error

    def gain(self, freq_hz: FloatArray, responses: ComplexArray) -> ComplexArray:
        r"""Return estimate over truth for a settled sine at each step of the cycle [-], shape (n_step, n_q, n_freq).

        .. math:: X_p = e^{-j w T} (I - K_p H) F X_{p-1} + K_p G(j w)

        Parameters
        ----------
        freq_hz : ndarray, shape (n_freq,)
            Frequencies [Hz].
        responses : ndarray of complex, shape (n_sensor, n_freq)
            Readings over truth, G [-].
        """
        model, steps, n = self.model, len(self.K), self.model.F.shape[0]
        turn = np.exp(-2j * np.pi * np.asarray(freq_hz) / model.sample_rate_hz)
        M = (np.eye(n) - self.K @ model.H) @ model.F
        driven = np.swapaxes(self.K @ responses, 2, 3)  # (n_step, n_q, n_freq, n_state)
        around = np.broadcast_to(np.eye(n), M[0].shape)
        X = np.zeros(driven[0].shape, complex)
        for p in range(steps):
            around = M[p] @ around
            X = turn[:, None] * (X @ _t(M[p])) + driven[p]
        system = np.eye(n) - (turn**steps)[None, :, None, None] * around[:, None]
        X = np.linalg.solve(system, X[..., None])[..., 0]
        gains = []
        for p in range(steps):
            X = turn[:, None] * (X @ _t(M[p])) + driven[p]
            gains.append(X[..., 0])
        return np.array(gains)

    def coloured_variance(self, excess: Sequence[Callable[[FloatArray], FloatArray] | None]) -> FloatArray:
        r"""Return the error variance from noise on the readings that the model does not have [rad^2/s^2], shape
        (n_sensor, n_q).

        .. math:: 2 \int |T_i(f)|^2 S_i(f) df

        with T_i from the reading of sensor i to the estimate; trapezoid in ln f, 1e-5 to 100 Hz, taken as constant
        below.

        Parameters
        ----------
        excess : sequence of callable or None
            Two-sided density S of each sensor's reading beyond the model's white noise, Hz -> rad^2/s; None for none.
        """
        variance = np.zeros((len(excess), self.q.size))
        for i, psd in enumerate(excess):
            if psd is not None:
                only = np.zeros((len(excess), _COLOURED_HZ.size), complex)
                only[i] = 1.0
                passed = np.mean(np.abs(self.gain(_COLOURED_HZ, only)) ** 2, axis=0) * psd(_COLOURED_HZ)
                tail = passed[:, 0] * _COLOURED_HZ[0]
                variance[i] = 2.0 * (np.trapezoid(passed * _COLOURED_HZ, np.log(_COLOURED_HZ), axis=1) + tail)
        return variance


def settled_filters(
    belief: Mapping[str, SensorBelief],
    sample_rate_hz: Mapping[str, float],
    *,
    order: int,
    q: FloatArray,
    coloured: bool = False,
) -> FixedFilters:
    """Solve the periodic Riccati equation for every q.

    Parameters
    ----------
    belief : mapping of str to SensorBelief
        Dynamics and noise of each sensor.
    sample_rate_hz : mapping of str to float
        Rate of each sensor [Hz].
    order : int
        Order m of the signal model.
    q : ndarray, shape (n_q,)
        Signal noise [rad^2/s^(2m+1)].
    coloured : bool, optional
        The filters know of the slow noise, too; a constant such as the turn-on bias they take as known.

    Returns
    -------
    FixedFilters
        Covariances and gains of the cycle.

    Raises
    ------
    ValueError
        If a sensor has no output noise, or as for `build_model`.

    References
    ----------
    Chu, Fan, Lin, Wang, Int. J. Control 77 (2004) 767-788 (doubling of the periodic discrete-time Riccati equation).
    """
    model = build_model(belief, sample_rate_hz, order=order, q=0.0, coloured=coloured)
    unit = (
        build_model(belief, sample_rate_hz, order=order, q=1.0).Q
        - build_model(belief, sample_rate_hz, order=order, q=0.0).Q
    )
    if coloured:
        unit = np.pad(unit, (0, model.n_slow))
    if np.any(model.R <= 0.0):
        msg = f"belief: expected an output_noise above 0 for each of {list(model.sensors)}"
        raise ValueError(msg)
    Q = model.Q + np.asarray(q)[:, None, None] * unit
    due = _due(model)
    P = _cycle_start(model, Q, due)
    prior, gains = [], []
    for used in due:
        K = np.zeros((len(P), len(model.F), used.size))
        h = model.H[used]
        K[:, :, used] = np.swapaxes(np.linalg.solve(h @ P @ h.T + np.diag(model.R[used]), h @ P), 1, 2)
        prior.append(P)
        gains.append(K)
        keep = np.eye(len(model.F)) - K @ model.H
        P = model.F @ (keep @ P @ _t(keep) + (K * model.R) @ _t(K)) @ model.F.T + Q
    return FixedFilters(model, np.asarray(q, float), np.array(prior), np.array(gains))


def _due(model: FusionModel) -> NDArray[np.bool_]:
    """Return which sensors have a reading at each step of the cycle, shape (n_step, n_sensor)."""
    return np.array([[p % stride == 0 for stride in model.strides] for p in range(math.lcm(*model.strides))])


Map = tuple["FloatArray", "FloatArray", "FloatArray"]


def _cycle(model: FusionModel, Q: FloatArray, due: NDArray[np.bool_]) -> Map:
    """Return (A, G, Q) of the map P -> Q + A P (I + G P)^-1 A' of a whole cycle, readings and steps."""
    eye = np.eye(len(model.F))
    cycle = None
    for used in due:
        h = model.H[used]
        G = np.broadcast_to(h.T @ (h / model.R[used, None]), Q.shape)
        step = (np.broadcast_to(model.F, Q.shape), G, Q)
        cycle = step if cycle is None else _after(cycle, step, eye)
    assert cycle is not None
    return cycle


def _cycle_start(model: FusionModel, Q: FloatArray, due: NDArray[np.bool_]) -> FloatArray:
    """Return the settled prior covariance at step 0 by doubling the map of a cycle."""
    cycle = _cycle(model, Q, due)
    for _ in range(_DOUBLINGS):
        cycle = _after(cycle, cycle, np.eye(len(model.F)))
    return cycle[2]


def variance_from_start(
    belief: Mapping[str, SensorBelief],
    sample_rate_hz: Mapping[str, float],
    *,
    order: int,
    q: float,
    start: StartKind,
    times: Sequence[float],
) -> FloatArray:
    """Return the variance of the rate that the Kalman filter has at some times after its start [rad^2/s^2], readings of
    that instant used, shape (n_time,).

    By doubling the map of a cycle, so that an hour costs no more than a second.

    Parameters
    ----------
    belief, sample_rate_hz : mapping, mapping
        As for `settled_filters`; the filter knows of the slow noise.
    order, q : int, float
        Signal model; q [rad^2/s^(2m+1)].
    start : {"unknown", "rest"}
        What is known before the first reading.
    times : sequence of float
        [s], rising.
    """
    model = build_model(belief, sample_rate_hz, order=order, q=q, coloured=True, start=start)
    due, eye = _due(model), np.eye(len(model.F))
    maps = [_cycle(model, model.Q, due)]
    cycles = [round(t * model.sample_rate_hz / len(due)) for t in times]
    P, at, found = model.P0, 0, []
    for wanted in cycles:
        for k in range((wanted - at).bit_length()):
            if len(maps) == k:
                maps.append(_after(maps[-1], maps[-1], eye))
            if (wanted - at) >> k & 1:
                A, G, Q = maps[k]
                P = Q + A @ P @ np.linalg.solve(eye + G @ P, A.T)
        at = wanted
        g = model.H @ P
        left = P[0, 0] - g[:, 0] @ np.linalg.solve(g @ model.H.T + np.diag(model.R), g[:, 0])
        found.append(left)
    return np.array(found)


def _after(
    first: tuple[FloatArray, FloatArray, FloatArray], then: tuple[FloatArray, FloatArray, FloatArray], eye: FloatArray
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return (A, G, Q) of two such maps, one after the other."""
    (A1, G1, Q1), (A2, G2, Q2) = first, then
    inverse = np.linalg.inv(eye + Q1 @ G2)
    A = A2 @ inverse @ A1
    G = G1 + _t(A1) @ G2 @ inverse @ A1
    Q = Q2 + A2 @ inverse @ Q1 @ _t(A2)
    return A, 0.5 * (G + _t(G)), 0.5 * (Q + _t(Q))


def _t(matrix: FloatArray) -> FloatArray:
    return np.swapaxes(matrix, -1, -2)


@dataclass(frozen=True)
class Optimum:
    """The best settled filter for a signal.

    Parameters
    ----------
    rmse, noise, lag : float
        Its error and the two parts, rmse^2 = noise^2 + lag^2 [rad/s].
    order : int
        Order m of its signal model.
    q : float
        Its signal noise [rad^2/s^(2m+1)].
    shares : dict of str to float
        Standard deviation that each sensor's noise causes [rad/s].
    claimed : float
        Standard deviation that the filter claims [rad/s].
    """

    rmse: float
    noise: float
    lag: float
    order: int
    q: float
    shares: dict[str, float]
    claimed: float


def optimum(
    belief: Mapping[str, SensorBelief],
    sample_rate_hz: Mapping[str, float],
    lines: Sequence[tuple[float, float]],
    *,
    excess: Mapping[str, Callable[[FloatArray], FloatArray]] | None = None,
    orders: Sequence[int] = (1, 2, 3),
) -> Optimum:
    r"""Return the fixed filter with the smallest error for a signal made of lines, sensor models exact, after all time
    constants.

    .. math:: \mathrm{rmse}^2 = \sigma^2 + \sum_i A_i^2 |E(f_i)|^2 / 2

    over the orders and q on a decade grid; sigma^2 is the variance that the sensors' noise leaves, E the filter's
    complex error at a line.

    Parameters
    ----------
    belief : mapping of str to SensorBelief
        What the sensors are.
    sample_rate_hz : mapping of str to float
        Rate of each sensor [Hz].
    lines : sequence of (float, float)
        Frequency [Hz] and amplitude [rad/s] of each line.
    excess : mapping of str to callable, optional
        Density of a sensor's reading beyond the belief's white noise (1/f), Hz -> rad^2/s; the filters do not know of
        it.
    orders : sequence of int, optional
        Orders of the signal model.

    Returns
    -------
    Optimum
        The best filter and its error.
    """
    return optima(belief, sample_rate_hz, [lines], excess=excess, orders=orders)[0]


def optima(
    belief: Mapping[str, SensorBelief],
    sample_rate_hz: Mapping[str, float],
    signals: Sequence[Sequence[tuple[float, float]]],
    *,
    excess: Mapping[str, Callable[[FloatArray], FloatArray]] | None = None,
    orders: Sequence[int] = (1, 2, 3),
    coloured: bool = False,
) -> list[Optimum]:
    """Return the `optimum` of each signal; the Riccati equations are solved once for all.

    Parameters
    ----------
    belief, sample_rate_hz, excess, orders : mapping, mapping, mapping, sequence
        As for `optimum`.
    signals : sequence of sequence of (float, float)
        Lines of each signal: frequency [Hz] and amplitude [rad/s].
    coloured : bool, optional
        The filters know of the slow noise that the belief names; q is then refined to a quarter of a decade.
    """
    freq = np.array([line for lines in signals for line, _ in lines])
    power = np.array([0.5 * amplitude**2 for lines in signals for _, amplitude in lines])
    of_signal = np.repeat(np.eye(len(signals)), [len(lines) for lines in signals], axis=0)
    truth = np.array([belief[name].realisation().response(freq) for name in sample_rate_hz])
    best: list[Optimum | None] = [None] * len(signals)

    def search(order: int, q: FloatArray) -> None:
        filters = settled_filters(belief, sample_rate_hz, order=order, q=q, coloured=coloured)
        shares = filters.noise_variance() + filters.coloured_variance(
            [(excess or {}).get(name) for name in sample_rate_hz]
        )
        lags = filters.line_error(freq, truth) ** 2 * power @ of_signal
        for k, lag in enumerate(lags.T):
            found = _least(filters, order, shares, lag)
            known = best[k]
            if known is None or found.rmse < known.rmse:
                best[k] = found

    for order in orders:
        low, high = DECADES[order]
        search(order, np.logspace(low, high, high - low + 1))
    if coloured:
        for order, decade in sorted({(one.order, round(math.log10(one.q))) for one in best if one is not None}):
            search(order, np.logspace(decade - 0.75, decade + 0.75, 7))
    return [one for one in best if one is not None]


def _least(filters: FixedFilters, order: int, shares: FloatArray, lag: FloatArray) -> Optimum:
    """Return the best of the filters, given the noise variance by sensor and the lag power of each [rad^2/s^2]."""
    noise = shares.sum(axis=0)
    i = int(np.argmin(noise + lag))
    return Optimum(
        rmse=float(np.sqrt(noise[i] + lag[i])),
        noise=float(np.sqrt(noise[i])),
        lag=float(np.sqrt(lag[i])),
        order=order,
        q=float(filters.q[i]),
        shares=dict(zip(filters.model.sensors, np.sqrt(shares[:, i]).tolist(), strict=True)),
        claimed=float(filters.std[i]),
    )
