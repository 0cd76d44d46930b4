r"""
Who makes the noise floor, and where do the sensors cross?
==========================================================

Input-referred noise of an MHD angular rate sensor and a gyro.
No filter of an unknown signal gets below

.. math:: \sigma^2 = 2 \int_0^W \frac{df}{1/S_1 + 1/S_2} ,

whose integrand is the lower edge of both curves: gyro below the crossover, MHD above it.
"""

import matplotlib.pyplot as plt
import numpy as np

from testbed.judging.budget import crossovers
from testbed.sensors import load_preset

frequency = np.geomspace(1e-3, 1000.0, 500)
mhd, gyro = load_preset("sx300"), load_preset("adis16505")
densities = {"sx300": mhd.input_noise_psd(frequency), "adis16505": gyro.input_noise_psd(frequency)}
both = 1.0 / sum(1.0 / density for density in densities.values())
figure, axes = plt.subplots(layout="constrained", figsize=(7.0, 4.4))
for (name, density), line in zip(densities.items(), ("-", "--"), strict=True):
    axes.loglog(frequency, 3600.0 * np.degrees(np.sqrt(density)) / 60.0, line, label=name)
axes.loglog(frequency, 3600.0 * np.degrees(np.sqrt(both)) / 60.0, "k:", lw=2.5, label="best combination")
for at in crossovers(mhd.input_noise_psd, gyro.input_noise_psd):
    axes.axvline(at, color="grey", lw=0.8)
    axes.annotate(f" {at:.2g} Hz", (at, 0.97), xycoords=("data", "axes fraction"), va="top")
axes.set(xlabel="frequency [Hz]", ylabel="root density, two-sided [deg/$\\sqrt{\\mathrm{h}}$]", ylim=(1e-4, 30.0))
axes.legend()
axes.grid(visible=True, alpha=0.4)
plt.show()
