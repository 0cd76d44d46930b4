"""Transfer functions fitted to frequency responses."""

from __future__ import annotations

import numpy as np
import pytest

from testbed.fusion.belief import load_belief
from testbed.fusion.identify import fit_transfer
from testbed.signals import transfer

FREQ_HZ = np.geomspace(0.1, 1000.0, 200)


@pytest.mark.oracle
@pytest.mark.parametrize(
    ("numerator", "poles_hz", "blind"),
    [
        ([1.0, 0.0], [2.5, 1350.0], True),  # the form of (39): a zero at rest, two real poles
        ([1.0, 0.6], [0.1, 4.5], False),
        ([300.0, 1.0, 0.0], [3.0, 40.0 + 30.0j, 40.0 - 30.0j], True),
        ([1.0, 2e3, 3e5, 0.0], [3.0, 16.0, 900.0 + 200.0j, 900.0 - 200.0j], True),
    ],
)
def test_a_rational_response_is_found_again(numerator: list[float], poles_hz: list[complex], blind: bool) -> None:
    a = np.poly(-2.0 * np.pi * np.array(poles_hz)).real
    wanted = transfer(numerator, list(a), FREQ_HZ)
    found = fit_transfer(FREQ_HZ, wanted, len(poles_hz), blind_to_constant=blind)
    # Coefficients over four decades of frequency leave some 1e-9; a neighbouring fit would be off by 1e-3.
    np.testing.assert_allclose(transfer(list(found[0]), list(found[1]), FREQ_HZ) / wanted, 1.0, rtol=0, atol=1e-6)
    np.testing.assert_allclose(np.sort_complex(np.roots(found[1])), np.sort_complex(np.roots(a)), rtol=1e-3)
    assert (found[0][-1] == 0.0) == blind


def test_the_shipped_belief_of_paper2_is_the_fit_to_its_sensor() -> None:
    from testbed.reproduce.paper2 import mhd_response

    believed = load_belief("paper2")["mhd_ars"]
    wanted = mhd_response(FREQ_HZ)
    error = np.abs(transfer(list(believed.numerator), list(believed.denominator), FREQ_HZ) / wanted - 1.0).max()
    print(f"belief paper2: largest error {100 * error:.3f} %")
    assert error < 0.0015
    again = fit_transfer(
        np.geomspace(0.1, 1000.0, 400), mhd_response(np.geomspace(0.1, 1000.0, 400)), 4, blind_to_constant=True
    )
    np.testing.assert_allclose(again[1], believed.denominator, rtol=1e-4)
