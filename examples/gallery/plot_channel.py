r"""
How deep does the wall drag the fluid?
======================================

The relative velocity over the height of a mercury channel, from the reduced viscous and Lorentz equation

.. math:: \partial_t u = \nu \, \partial_y^2 u - b \, (u - \bar u) , \qquad u = U \text{ at both walls.}

At low frequencies the fluid turns with the wall and the sensor is blind.
At high ones only a Stokes layer of depth :math:`\sqrt{2 \nu / \omega}` follows, and the core stands still.
"""

import matplotlib.pyplot as plt
import numpy as np

import testbed

FREQUENCIES = (0.1, 1.0, 10.0, 100.0)
RATE = 200_000.0

channel = testbed.load_preset("sx300").channel
figure, axes = plt.subplots(layout="constrained", figsize=(7.0, 4.4))
for frequency, line in zip(FREQUENCIES, ("-", "--", "-.", ":"), strict=True):
    stage = channel.start(RATE)
    periods = max(round(3.0 * frequency), 1)
    n_time = round((periods + 0.25) / frequency * RATE)
    for begin in range(0, n_time, 100_000):
        t = np.arange(begin, min(begin + 100_000, n_time)) / RATE
        stage.process(np.sin(2.0 * np.pi * frequency * t))
    height = 1e3 * np.linspace(0.0, channel.height, np.size(stage.profile()))
    axes.plot(-stage.profile(), height, line, label=f"{frequency:g} Hz")
axes.set(xlabel="wall minus fluid, over the wall's largest rate [-]", ylabel="height [mm]")
axes.legend(title="wall turns at")
axes.grid(visible=True, alpha=0.4)
plt.show()
