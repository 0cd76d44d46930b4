r"""
Error against frequency: which filter for which band?
=====================================================

A sine of 1 deg/s at nine frequencies, every filter with its defaults, beside the error of the best linear filter made
for each.
The bands are the least and the largest of three seeds: one seed would rank the filters by its luck.
"""

import matplotlib.pyplot as plt
import numpy as np

import testbed

FREQUENCIES = (0.5, 1.0, 2.0, 4.0, 10.0, 25.0, 60.0, 120.0, 250.0)
FILTERS = ("kalman", "wideband", "complementary")

base = testbed.Scenario.from_dict(
    {
        "name": "one_line",
        "duration": "3 s",
        "settle": "1.5 s",
        "turntable": {"engine": "modal"},
        "motion": [{"sine": {"frequency": "1 Hz", "rate": "1 deg/s"}}],
        "sensors": {"mhd_ars": {"preset": "sx300"}, "mems_gyro": {"preset": "adis16505_filtered"}},
        "fusion": {name: {} for name in FILTERS},
    }
)
rmse = {name: np.empty((len(FREQUENCIES), 3)) for name in FILTERS}
optimum = []
for i, frequency in enumerate(FREQUENCIES):
    for seed in range(3):
        metrics = testbed.run(base.with_(**{"motion.0.sine.frequency": f"{frequency} Hz", "seed": seed})).metrics
        for name in FILTERS:
            rmse[name][i, seed] = metrics.fusion[name].rmse_deg_s
    optimum.append(metrics.fusion["kalman"].optimum_rmse_deg_s)
figure, axes = plt.subplots(layout="constrained", figsize=(7.0, 4.6))
for (name, found), line in zip(rmse.items(), ("-", "--", "-."), strict=True):
    (drawn,) = axes.loglog(FREQUENCIES, np.median(found, axis=1), line, label=name)
    axes.fill_between(FREQUENCIES, found.min(axis=1), found.max(axis=1), color=drawn.get_color(), alpha=0.2, lw=0.0)
axes.loglog(FREQUENCIES, optimum, "k:", lw=2.0, label="best linear filter of that line")
axes.set(xlabel="frequency [Hz]", ylabel="rms error [deg/s]")
axes.legend()
axes.grid(visible=True, alpha=0.4)
plt.show()
