r"""
Can a filter tell the frequency of a motion from its readings?
==============================================================

N_k of paper 1 grows with amplitude as with frequency, so that a band of it means a band of frequency at one amplitude
only.
The share of the two sensors' increments does not: the indicated frequency over the true one, for three amplitudes.
"""

import matplotlib.pyplot as plt
import numpy as np

import testbed
from testbed.fusion.analysis.indicator import FrequencyIndicator
from testbed.fusion.belief import load_belief

RATES = {"mhd_ars": 20_000.0, "mems_gyro": 2_000.0}
FREQUENCIES = np.array([0.5, 1.0, 2.0, 4.0, 10.0, 25.0])
SENSORS = {"mhd_ars": testbed.load_preset("sx300"), "mems_gyro": testbed.load_preset("adis16505_filtered")}

time = np.arange(80_000) / RATES["mhd_ars"]
figure, axes = plt.subplots(layout="constrained", figsize=(7.0, 4.2))
axes.loglog(FREQUENCIES, FREQUENCIES, "k:", label="true")
for amplitude, marker in ((0.1, "o-"), (1.0, "s--"), (10.0, "^-.")):
    found = []
    for frequency in FREQUENCIES:
        rate = np.radians(amplitude) * np.sin(2.0 * np.pi * frequency * time)
        readings = {name: one.sample(rate, RATES["mhd_ars"], seed=1) for name, one in SENSORS.items()}
        shown = FrequencyIndicator(load_belief("identified"), RATES).process(readings).by_sensors
        found.append(np.median(shown[shown.size // 2 :]))
    axes.loglog(FREQUENCIES, found, marker, fillstyle="none", label=f"{amplitude:g} deg/s")
axes.set(xlabel="true frequency [Hz]", ylabel="indicated frequency [Hz]")
axes.legend()
axes.grid(visible=True, alpha=0.4)
plt.show()
