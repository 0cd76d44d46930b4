r"""
How can a Kalman filter know 1/f noise?
=======================================

1/f noise has no finite state model.
A few first-order Markov processes, one a decade, fitted to the density by non-negative least squares, follow it within
tenths of a decibel where it matters: above the white noise.
"""

import matplotlib.pyplot as plt
import numpy as np

import testbed
from testbed.fusion.coloured import slow_noise

belief = testbed.belief_of("adis16505_filtered")
fit = slow_noise(belief).inner
frequency = np.geomspace(1e-5, 10.0, 500)
white = belief.input_noise**2 + belief.output_noise**2
figure, axes = plt.subplots(layout="constrained", figsize=(7.0, 4.4))
for rate, drive in zip(fit.rate, fit.drive, strict=True):
    axes.loglog(frequency, np.sqrt(drive / (rate**2 + (2.0 * np.pi * frequency) ** 2)), color="0.7", lw=0.9)
axes.loglog(frequency, np.sqrt(fit.density(frequency)), "tab:blue", lw=2.0, label=f"sum of {fit.rate.size} processes")
axes.loglog(frequency, np.sqrt(belief.inner_slow_density(frequency)), "k--", label="1/f noise of the belief")
axes.axhline(np.sqrt(white), color="tab:orange", ls="-.", label="white noise")
axes.set(xlabel="frequency [Hz]", ylabel="root density [rad/$\\sqrt{\\mathrm{s}}$]")
axes.set_ylim(0.03 * np.sqrt(white), None)
axes.legend(title=f"misfit {fit.error_db:.2f} dB")
axes.grid(visible=True, alpha=0.4)
plt.show()
