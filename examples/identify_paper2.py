"""Fit the four-state belief of an MHD ARS with a 3-1000 Hz band (belief `paper2`) to its closed form, and print it with its error.

Run: python examples/identify_paper2.py
"""

import numpy as np

from testbed.fusion.identify import fit_transfer
from testbed.reproduce.paper2 import mhd_response
from testbed.signals import transfer


def main() -> None:
    """Print coefficients and the largest relative error from 0.1 Hz to 1 kHz."""
    freq_hz = np.geomspace(0.1, 1000.0, 400)
    response = mhd_response(freq_hz)
    numerator, denominator = fit_transfer(freq_hz, response, 4, blind_to_constant=True)
    error = np.abs(transfer(list(numerator), list(denominator), freq_hz) / response - 1.0)
    print(f"numerator: {list(numerator)}")
    print(f"denominator: {list(denominator)}")
    print(f"largest error {100.0 * error.max():.3f} % at {freq_hz[error.argmax()]:.4g} Hz")


if __name__ == "__main__":
    main()
