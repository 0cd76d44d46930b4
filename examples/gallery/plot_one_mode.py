r"""
How wrong is the paper's one mode?
==================================

Equations (4) to (6) of Su et al. 2024 keep one mode of the channel.
Its error against the whole equation, for the paper's two fields in a mercury channel of 10 mm.
"""

import matplotlib.pyplot as plt
import numpy as np

from testbed.models.mhd_channel.channel import MhdChannel, one_mode_response

frequency = np.geomspace(1e-3, 100.0, 400)
figure, axes = plt.subplots(layout="constrained", figsize=(7.0, 4.2))
for field, line in ((0.036, "-"), (0.1, "--")):
    channel = MhdChannel(fluid="mercury", height=10e-3, field=field)
    whole, one_mode = channel.response(frequency), one_mode_response(channel, frequency)
    axes.loglog(frequency, 100.0 * np.abs(one_mode - whole), line, label=f"{field:g} T")
axes.set(xlabel="frequency [Hz]", ylabel="error of one mode [% of the rate]")
axes.legend()
axes.grid(visible=True, alpha=0.4)
plt.show()
