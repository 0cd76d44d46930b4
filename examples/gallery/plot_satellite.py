r"""
Can a wheel's jitter be seen under a platform's vibration?
==========================================================

A reaction wheel on the broadband vibration of a satellite's platform: the spectrum of the true rate, of two filters'
errors, and what each sensor would leave alone.
A filter is of use where its error lies below the motion.
"""

from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np
from scipy.signal import welch

import testbed

SCENARIOS = Path(testbed.__file__).parents[1] / "scenarios"

scenario = testbed.load_scenario(SCENARIOS / "satellite_microvibration.yaml")
scenario = scenario.with_(
    **{"turntable.engine": "modal", "fusion.wideband": {}, "fusion.arw_shakf": None, "expect": None}
)
run = testbed.run(scenario)
settled = run.truth.time >= scenario.frame.settle


def density(rate):
    """Return frequencies [Hz] and the one-sided root density [deg/s/sqrt(Hz)] behind the settling time."""
    freq, power = welch(np.degrees(rate[settled]), run.truth.sample_rate_hz, nperseg=40_000)
    return freq[1:], np.sqrt(power[1:])


figure, axes = plt.subplots(layout="constrained", figsize=(7.0, 4.6))
axes.loglog(*density(run.truth.rate), "k", lw=1.2, label="true rate")
for (name, found), line in zip(run.fusion.items(), ("-", "--"), strict=True):
    axes.loglog(*density(found.rate - run.truth.rate), line, lw=1.2, label=f"error of {name}")
axes.set(xlabel="frequency [Hz]", ylabel="root density, one-sided [deg/s/$\\sqrt{\\mathrm{Hz}}$]")
axes.set(xlim=(0.5, 1000.0), ylim=(1e-6, 1.0))
axes.legend()
axes.grid(visible=True, alpha=0.4)
plt.show()
