r"""
Which noise is which in an Allan deviation?
===========================================

Each term of IEEE Std 952 has its own slope: white noise (angle random walk N) falls as :math:`\tau^{-1/2}`, 1/f noise
(bias instability B) is flat at 0.664 B, a random walk of the rate (K) rises as :math:`\tau^{1/2}`.
An hour of a simulated gyro, the deviation with its 95 % interval, and the fit that `testbed allan` makes.
"""

import matplotlib.pyplot as plt
import numpy as np

from testbed.allan.curve import allan_deviation
from testbed.allan.fit import fit_allan, term_variance
from testbed.sensors import load_preset

RATE = 100.0
TERMS = ("quantization", "angle_random_walk", "bias_instability", "rate_random_walk")

gyro = load_preset("adis16505").model_copy(update={"sample_rate": RATE, "corner": 40.0})
reading = gyro.sample(np.zeros(round(3600.0 * RATE)), RATE, seed=1)
curve = allan_deviation(reading, RATE)
fit = fit_allan(curve)
deg_h = np.degrees(3600.0)
figure, axes = plt.subplots(layout="constrained", figsize=(7.0, 4.6))
axes.fill_between(curve.tau, deg_h * curve.lower, deg_h * curve.upper, alpha=0.25, lw=0.0, label="95 % interval")
axes.loglog(curve.tau, deg_h * curve.deviation, "k", lw=1.2, label="one hour at rest")
lines = iter(("--", "-.", ":", (0, (1, 3)), (0, (5, 1, 1, 1))))
for term, square in zip(
    ("quantization", "angle_random_walk", "bias_instability", "rate_random_walk"), fit.squares, strict=False
):
    if getattr(fit, term).identified:
        deviation = np.sqrt(term_variance(curve, term, square))
        axes.loglog(curve.tau, deg_h * deviation, ls=next(lines), label=term.replace("_", " "))
low = deg_h * curve.deviation.min()
axes.set(xlabel="averaging time [s]", ylabel="Allan deviation [deg/h]", ylim=(0.3 * low, None))
axes.legend()
axes.grid(visible=True, alpha=0.4)
plt.show()
