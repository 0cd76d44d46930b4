"""Table 2 of paper 3 as printed (Wang, Cui, Cao, Micromachines 2023, 14, 1712, doi 10.3390/mi14091712), for a place
beside our figures.
"""

from __future__ import annotations

ORIGINAL, PIPELINE = "original", "paper's pipeline"
# Q (its unit is not given), B [deg/h], N [deg/sqrt(h)], time [s]; the text has other figures for Q and B.
TABLE_2: dict[str, tuple[float | None, ...]] = {
    ORIGINAL: (6.1269e-4, 1.5323e-2, 7.8034e-4, None),
    # The paper's reference 22, an adaptive filter with random weighting; not its own equation (22).
    "AKF [22]": (None, 5.4223e-4, 1.2657e-4, 0.53),
    "OLMD-KPCA": (1.4421e-3, 2.1259e-3, 4.268e-5, 1.98),
    "CEEMDAN-LWT": (2.3125e-4, 5.6311e-4, 1.2956e-5, 3.28),
    PIPELINE: (1.0132e-4, 1.1504e-4, 7.2110e-6, 3.62),
}
