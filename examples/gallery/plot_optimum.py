r"""
How good can any filter be at one frequency?
============================================

The error of the best causal linear filter of a sine of known size, noise and lag together, once it has settled, against
the frequency of the sine.
Three amplitudes: where a signal is small against the noise a filter can smooth it, where it is large it has to follow.
"""

import matplotlib.pyplot as plt
import numpy as np

import testbed
from testbed.fusion.analysis.bounds import settled_bounds

BELIEF = {
    "mhd_ars": testbed.belief_of("sx300", exact=True),
    "mems_gyro": testbed.belief_of("adis16505_filtered", exact=True),
}
RATES = {"mhd_ars": 20_000.0, "mems_gyro": 2_000.0}

frequency = np.geomspace(0.1, 300.0, 25)
figure, axes = plt.subplots(layout="constrained", figsize=(7.0, 4.4))
for amplitude, line in ((0.1, "-"), (1.0, "--"), (10.0, "-.")):
    signals = [[(one, np.radians(amplitude))] for one in frequency]
    found = settled_bounds(BELIEF, RATES, signals)
    axes.loglog(frequency, [np.degrees(one.rmse) for one in found], line, label=f"{amplitude:g} deg/s")
axes.set(xlabel="frequency of the sine [Hz]", ylabel="least rms error [deg/s]")
axes.legend(title="amplitude")
axes.grid(visible=True, alpha=0.4)
plt.show()
