r"""Transitions over steps of any length: a table over the length, and straight lines between its nodes.

.. math:: F(\tau) \approx (1 - s) F(k h) + s F((k + 1) h), \quad Q(\tau) \approx (1 - s) Q(k h) + s Q((k + 1) h)

with h the regular step over `NODES`. What lies between two covariances is one too. F of a mode of rate r is off by at
most (r h)^2 / 8: 7.5e-5 for r at the Nyquist rate of the regular step, 3e-9 for a pole at a fiftieth of it. A step
within a hundredth of a node is taken for it, which is 8e-5 of a regular step at the most.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from testbed.fusion.kernels.covariance import NODES
from testbed.fusion.kernels.merging import LONGEST, place_steps
from testbed.signals import van_loan

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from testbed.signals import FloatArray

N_NODE = round(LONGEST * NODES) + 1


class Steps(NamedTuple):
    """How each step of a block is reached from the one before it.

    Parameters
    ----------
    node, whole : ndarray of int, shape (n_step,)
        The node of the table at or before its length, and how many whole regular steps come first.
    share : ndarray, shape (n_step,)
        How far it is from that node to the next one, 0 to 1 [-].
    """

    node: NDArray[np.int64]
    share: FloatArray
    whole: NDArray[np.int64]


EVEN = Steps(np.zeros(0, np.int64), np.zeros(0), np.zeros(0, np.int64))
"""Every step is a regular one."""


def steps_of(length: FloatArray) -> Steps:
    """Return how steps of these lengths are reached.

    Parameters
    ----------
    length : ndarray, shape (n_step,)
        In regular steps.
    """
    n = length.size
    steps = Steps(np.empty(n, np.int64), np.empty(n), np.empty(n, np.int64))
    place_steps(length, *steps)
    return steps


def even(*matrices: NDArray[Any]) -> tuple[np.ndarray, ...]:
    """Return regular steps as a kernel takes them beside its matrices: no steps, and tables without nodes.

    Parameters
    ----------
    *matrices : ndarray, of any shape
        Those that it has a table of: F, Q.
    """
    return (*EVEN, *(np.empty((0, *one.shape), one.dtype) for one in matrices))


def transition_nodes(A: FloatArray, Qc: FloatArray, step: float) -> tuple[FloatArray, FloatArray]:
    """Return F and Q at the nodes from 0 to LONGEST regular steps, each of shape (N_NODE, n_state, n_state).

    Parameters
    ----------
    A, Qc : ndarray, shape (n_state, n_state)
        Dynamics [1/s] and density of the white noise [rad^2/s^3].
    step : float
        The regular step [s].
    """
    first, noise = van_loan(A, Qc, step / NODES)
    F, Q = np.empty((N_NODE, *A.shape)), np.zeros((N_NODE, *A.shape))
    F[0] = np.eye(len(A))
    for k in range(1, N_NODE):
        F[k] = first @ F[k - 1]
        grown = first @ Q[k - 1] @ first.T + noise
        Q[k] = 0.5 * (grown + grown.T)
    # To the bit what a filter of regular steps has.
    F[NODES], Q[NODES] = van_loan(A, Qc, step)
    return F, Q
