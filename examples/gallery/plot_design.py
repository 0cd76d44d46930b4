r"""
How deep should a channel be, and how strong its field?
=======================================================

Lower corner and Hartmann number of a mercury channel over its height, for three fields.
The corner falls with the square of the height until the field brakes the fluid itself.
"""

import matplotlib.pyplot as plt
import numpy as np

from testbed.models.mhd_channel.channel import MhdChannel

heights = np.geomspace(1e-3, 20e-3, 30)
figure, (corner, hartmann) = plt.subplots(1, 2, layout="constrained", figsize=(8.0, 3.8))
for field, line in ((0.1, "-"), (0.3, "--"), (0.6, "-.")):
    channels = [MhdChannel(fluid="mercury", height=height, field=field) for height in heights]
    corner.loglog(1e3 * heights, [one.corner_freq_hz for one in channels], line, label=f"{field:g} T")
    hartmann.loglog(1e3 * heights, [one.hartmann_number for one in channels], line)
corner.set(xlabel="height [mm]", ylabel="lower corner, -3 dB [Hz]")
hartmann.set(xlabel="height [mm]", ylabel="Hartmann number [-]")
corner.yaxis.set_major_formatter("{x:g}")
corner.yaxis.set_minor_formatter("")
corner.set_yticks([0.1, 0.2, 0.5, 1.0, 2.0, 5.0])
corner.legend()
for axes in (corner, hartmann):
    axes.grid(visible=True, alpha=0.4)
plt.show()
