r"""What a fixed filter leaves once settled, and the best of them for a given signal: closed forms, no simulation.

The readings of several rates repeat in a pattern of S steps, so the covariance settles into a cycle of S matrices: the
periodic Riccati solution. With its gains the filter is linear and periodic; noise and each commanded line pass it
independently.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from testbed.fusion.model import FusionModel, build_model

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from testbed.fusion.belief import SensorBelief
    from testbed.signals import ComplexArray, FloatArray

# Decades of q [rad^2/s^(2m+1)] that are searched, per order m: from a filter slower than the crossover of the sensors
# to one beyond 1 kHz.
DECADES = {1: (-10, 4), 2: (-8, 12), 3: (-6, 17)}
# 2^40 periods are past any time constant.
_DOUBLINGS = 40


@dataclass(frozen=True)
class FixedGains:
    """What settled filters of one model do to a signal: their cycle of gains.

    Parameters
    ----------
    model : FusionModel
        F, H, R, and Q without signal noise.
    K : ndarray, shape (n_step, n_q, n_state, n_sensor)
        Gains [-], zero for a sensor that is not due.
    """

    model: FusionModel
    K: FloatArray

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


@dataclass(frozen=True)
class FixedFilters(FixedGains):
    """Settled filters of one model that differ in q: their gains, and the covariance that they claim.

    Parameters
    ----------
    model : FusionModel
        As for `FixedGains`.
    K : ndarray, shape (n_step, n_q, n_state, n_sensor)
        As for `FixedGains`.
    q : ndarray, shape (n_q,)
        Signal noise of each filter [rad^2/s^(2m+1)].
    prior : ndarray, shape (n_step, n_q, n_state, n_state)
        Covariance before the readings of each step of the cycle [rad^2/s^2]; all sensors are due at step 0.
    """

    q: FloatArray
    prior: FloatArray

    @property
    def std(self) -> FloatArray:
        """What each filter claims: the mean over the cycle of its settled standard deviation [rad/s], shape (n_q,)."""
        std: FloatArray = np.sqrt(self.posterior()[:, :, 0, 0].mean(axis=0))
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
            Q = np.where(np.outer(model.owners == i, model.owners == i), model.Q, 0.0)
            column = self.K[..., i]
            W = keep @ Q @ _t(keep) + model.R[i] * column[..., :, None] * column[..., None, :]
            M = keep @ model.F
            total, power = W[0], M[0]
            for p in range(1, steps):
                total, power = W[p] + M[p] @ total @ _t(M[p]), M[p] @ power
            # The error of a filter that does not settle overflows.
            with np.errstate(over="ignore", invalid="ignore"):
                for _ in range(_DOUBLINGS):
                    total, power = total + power @ total @ _t(power), power @ power
            variance = np.zeros(self.q.size)
            for p in range(steps):
                total = W[p] + M[p] @ total @ _t(M[p])
                variance += total[:, 0, 0]
            parts.append(variance / steps)
        return np.array(parts)


def settled_filters(
    belief: Mapping[str, SensorBelief], sample_rate_hz: Mapping[str, float], *, order: int, q: FloatArray
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
    model = build_model(belief, sample_rate_hz, order=order, q=0.0)
    unit = build_model(belief, sample_rate_hz, order=order, q=1.0).Q - model.Q
    if np.any(model.R <= 0.0):
        msg = f"belief: expected an output_noise above 0 for each of {list(model.sensors)}"
        raise ValueError(msg)
    Q = model.Q + np.asarray(q)[:, None, None] * unit
    period = period_map(model, Q)
    for _ in range(_DOUBLINGS):
        period = period.then(period)
    return filters_from(model, np.asarray(q, float), Q, period.Q)


@dataclass(frozen=True)
class CycleMap:
    """The map P -> Q + A P (I + G P)^-1 A' that takes a prior covariance over steps with their readings.

    Parameters
    ----------
    A, G, Q : ndarray, shape (n_q, n_state, n_state)
        One map for each of several filters.
    """

    A: FloatArray
    G: FloatArray
    Q: FloatArray

    def then(self, other: CycleMap) -> CycleMap:
        """Return the map of these steps and, after them, those of another."""
        inverse = np.linalg.inv(np.eye(self.A.shape[-1]) + self.Q @ other.G)
        A = other.A @ inverse @ self.A
        G = self.G + _t(self.A) @ other.G @ inverse @ self.A
        Q = other.Q + other.A @ inverse @ self.Q @ _t(other.A)
        return CycleMap(A, 0.5 * (G + _t(G)), 0.5 * (Q + _t(Q)))

    def applied(self, P: FloatArray) -> FloatArray:
        """Return the covariance behind the steps from that before them, shape (n_q, n_state, n_state)."""
        eye = np.eye(self.A.shape[-1])
        after: FloatArray = self.Q + self.A @ P @ np.linalg.solve(eye + self.G @ P, _t(self.A))
        return 0.5 * (after + _t(after))


def period_map(model: FusionModel, Q: FloatArray) -> CycleMap:
    """Return the map of one period of the readings, which all sensors begin together.

    Parameters
    ----------
    model : FusionModel
        F, H, R.
    Q : ndarray, shape (n_q, n_state, n_state)
        Covariance of a step of each filter [rad^2/s^2].

    Raises
    ------
    ValueError
        If the period is too long.
    """
    model.check_cycle()
    whole = None
    for used in model.due:
        h = model.H[used]
        G = np.broadcast_to(h.T @ (h / model.R[used, None]), Q.shape)
        step = CycleMap(np.broadcast_to(model.F, Q.shape), G, Q)
        whole = step if whole is None else whole.then(step)
    assert whole is not None
    return whole


def filters_from(model: FusionModel, q: FloatArray, Q: FloatArray, prior: FloatArray) -> FixedFilters:
    """Return the filters whose gains are those of a period that begins with a covariance.

    Parameters
    ----------
    model : FusionModel
        F, H, R.
    q : ndarray, shape (n_q,)
        Signal noise of each filter [rad^2/s^(2m+1)].
    Q, prior : ndarray, shape (n_q, n_state, n_state)
        Covariance of a step, and before the first readings of the period [rad^2/s^2].
    """
    P, priors, gains = prior, [], []
    for used in model.due:
        K = np.zeros((len(P), len(model.F), used.size))
        h = model.H[used]
        K[:, :, used] = np.swapaxes(np.linalg.solve(h @ P @ h.T + np.diag(model.R[used]), h @ P), 1, 2)
        priors.append(P)
        gains.append(K)
        keep = np.eye(len(model.F)) - K @ model.H
        P = model.F @ (keep @ P @ _t(keep) + (K * model.R) @ _t(K)) @ model.F.T + Q
    return FixedFilters(model, np.array(gains), q, np.array(priors))


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
    """

    rmse: float
    noise: float
    lag: float
    order: int
    q: float
    shares: dict[str, float]


def optimum(
    belief: Mapping[str, SensorBelief],
    sample_rate_hz: Mapping[str, float],
    lines: Sequence[tuple[float, float]],
    *,
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
    orders : sequence of int, optional
        Orders of the signal model.

    Returns
    -------
    Optimum
        The best filter and its error.
    """
    return optima(belief, sample_rate_hz, [lines], orders=orders)[0]


def optima(
    belief: Mapping[str, SensorBelief],
    sample_rate_hz: Mapping[str, float],
    signals: Sequence[Sequence[tuple[float, float]]],
    *,
    orders: Sequence[int] = (1, 2, 3),
) -> list[Optimum]:
    """Return the `optimum` of each signal; the Riccati equations are solved once for all.

    Parameters
    ----------
    belief, sample_rate_hz, orders : mapping, mapping, sequence
        As for `optimum`.
    signals : sequence of sequence of (float, float)
        Lines of each signal: frequency [Hz] and amplitude [rad/s].
    """
    freq = np.array([line for lines in signals for line, _ in lines])
    power = np.array([0.5 * amplitude**2 for lines in signals for _, amplitude in lines])
    of_signal = np.repeat(np.eye(len(signals)), [len(lines) for lines in signals], axis=0)
    truth = np.array([belief[name].realisation().response(freq) for name in sample_rate_hz])
    best: list[Optimum | None] = [None] * len(signals)
    for order in orders:
        low, high = DECADES[order]
        filters = settled_filters(belief, sample_rate_hz, order=order, q=np.logspace(low, high, high - low + 1))
        shares = filters.noise_variance()
        lags = filters.line_error(freq, truth) ** 2 * power @ of_signal
        for k, lag in enumerate(lags.T):
            found = _least(filters, order, shares, lag)
            known = best[k]
            if known is None or found.rmse < known.rmse:
                best[k] = found
    return [one for one in best if one is not None]


def _least(filters: FixedFilters, order: int, shares: FloatArray, lag: FloatArray) -> Optimum:
    """Return the best of the filters, given the noise variance by sensor and the lag power of each [rad^2/s^2]."""
    noise = shares.sum(axis=0)
    both = noise + lag
    i = int(np.argmin(np.where(np.isfinite(both), both, np.inf)))
    return Optimum(
        rmse=float(np.sqrt(noise[i] + lag[i])),
        noise=float(np.sqrt(noise[i])),
        lag=float(np.sqrt(lag[i])),
        order=order,
        q=float(filters.q[i]),
        shares=dict(zip(filters.model.sensors, np.sqrt(shares[:, i]).tolist(), strict=True)),
    )
