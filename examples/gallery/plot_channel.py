r"""
How deep does the wall drag the fluid?
======================================

The velocity u of the mercury relative to the wall, whose own is v, from equation (2) of Su et al. 2024

.. math:: \partial_t u = \nu \, \partial_h^2 u - \frac{\sigma B^2}{\rho} u - \partial_t v ,
    \qquad u = 0 \text{ at the walls.}

At low frequencies the fluid turns with the wall and the sensor is blind.
At high ones only a Stokes layer of depth :math:`\sqrt{2 \nu / \omega}` follows, and the core stands still.
The flow is symmetric, so half of the height is drawn.
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
    half = slice(1, channel.nodes // 2 + 1)
    axes.semilogy(-stage.profile()[half], 1e3 * channel.heights[half], line, label=f"{frequency:g} Hz")
axes.set(xlabel="wall minus fluid, over the wall's largest rate [-]", ylabel="height above the wall [mm]")
axes.set_ylim(0.003, None)
axes.legend(title="wall turns at")
axes.grid(visible=True, alpha=0.4)
plt.show()
