"""Records to decompose, and the peer that decomposes them too."""

from __future__ import annotations

import warnings

import numpy as np


def noisy_tone(n_time, seed):
    rng = np.random.default_rng(seed)
    return (
        rng.standard_normal(n_time)
        + 2.0 * np.sin(np.arange(n_time) / 15.0)
        + 0.2 * np.cumsum(rng.standard_normal(n_time))
    )


def peer_modes(signal):
    """Return the modes of EMD-signal after ten sifts each, its absolute stops (for scaled signals) switched off."""
    from PyEMD import EMD

    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        return EMD(FIXE=10, range_thr=0.0, total_power_thr=0.0).emd(signal)
