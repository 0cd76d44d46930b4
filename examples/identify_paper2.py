"""Fit the four-state belief of the MHD ARS `mhd03` (belief `paper2`) to its closed form, and print it with its error.

Run: python examples/identify_paper2.py
"""

from __future__ import annotations

import numpy as np

from testbed.fusion.analysis.identify import Identified, identify
from testbed.sensors import load_preset


def fit() -> Identified:
    """Return the fit of two pairs of poles, which may be real, from 0.1 Hz to 1 kHz."""
    freq_hz = np.geomspace(0.1, 1000.0, 400)
    return identify(freq_hz, load_preset("mhd03").response(freq_hz), real_poles=0, pole_pairs=2, blind_at_dc=True)


def main() -> None:
    """Print coefficients and the largest relative error."""
    found = fit()
    print(f"numerator: {found.numerator.tolist()}")
    print(f"denominator: {found.denominator.tolist()}")
    print(f"largest error {100.0 * found.worst:.3f} %")


if __name__ == "__main__":
    main()
