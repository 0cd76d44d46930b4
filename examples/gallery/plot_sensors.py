r"""
Which sensor sees which frequency?
==================================

An MHD angular rate sensor is blind to a constant rate: the fluid follows the wall in the end.
A gyro sees constants and stops at its bandwidth.
The true response of the simulated instruments, computed from the channel's equation and from the data sheet.
"""

import matplotlib.pyplot as plt
import numpy as np

import testbed

frequency = np.geomspace(0.01, 2000.0, 600)
figure, (gain, phase) = plt.subplots(2, 1, sharex=True, layout="constrained", figsize=(7.0, 5.2))
for name, line in (("sx300", "-"), ("mhd03", "--"), ("adis16505", "-."), ("adis16505_filtered", ":")):
    response = testbed.load_preset(name).response(frequency)
    gain.semilogx(frequency, 20.0 * np.log10(np.abs(response)), line, label=name)
    phase.semilogx(frequency, np.degrees(np.unwrap(np.angle(response))), line)
gain.set(ylabel="gain [dB]", ylim=(-40.0, 5.0))
phase.set(xlabel="frequency [Hz]", ylabel="phase [deg]", ylim=(-200.0, 110.0))
gain.legend(loc="lower center", ncols=2)
for axes in (gain, phase):
    axes.grid(visible=True, alpha=0.4)
plt.show()
