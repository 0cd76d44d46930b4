"""Modes through the leading kernel principal components of their joint values, and back."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from testbed.signals import FloatArray

# The kernel's matrix is of instants against instants: these many instants make it, all others are projected onto them.
_INSTANTS = 200
_CHUNK = 8192


def kernel_components(modes: FloatArray, *, share: float = 0.85, seed: int = 0) -> FloatArray:
    r"""Return modes as far as the leading kernel principal components have them.

    An instant is the vector of all modes there, each over its standard deviation. With the kernel
    :math:`\exp(-|x - y|^2 / 2 n)`, n the number of modes, those leading components are kept that hold a share of the
    sum of eigenvalues, and the way back is ridge regression from the components to the instants.

    Parameters
    ----------
    modes : ndarray, shape (n_mode, n_time)
        Any unit, none constant.
    share : float
        Of the eigenvalues to keep [-]; 85 % is usual.
    seed : int
        Of the choice of instants.

    Returns
    -------
    ndarray, shape (n_mode, n_time)
        Unit of `modes`.

    References
    ----------
    Schoelkopf, Smola, Mueller, Neural Comput. 10 (1998) 1299-1319; Bakir, Weston, Schoelkopf, NIPS 16 (2004), for the
    way back; both as in scikit-learn.
    """
    from sklearn.decomposition import KernelPCA

    scale = modes.std(axis=1, keepdims=True)
    instants = (modes / scale).T
    chosen = np.random.default_rng(seed).choice(len(instants), min(_INSTANTS, len(instants)), replace=False)
    known = instants[np.sort(chosen)]
    gamma = 0.5 / modes.shape[0]
    # All components first, to see how many hold the share.
    values = KernelPCA(kernel="rbf", gamma=gamma).fit(known).eigenvalues_
    n_kept = int(np.searchsorted(np.cumsum(values) / values.sum(), share)) + 1
    machine = KernelPCA(n_kept, kernel="rbf", gamma=gamma, alpha=1e-3, fit_inverse_transform=True).fit(known)
    back = [
        machine.inverse_transform(machine.transform(instants[i : i + _CHUNK])) for i in range(0, len(instants), _CHUNK)
    ]
    kept: FloatArray = np.concatenate(back).T * scale
    return kept
