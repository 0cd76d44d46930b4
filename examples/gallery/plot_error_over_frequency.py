r"""
Error against frequency: which filter for which band?
=====================================================

A sine of 1 deg/s at five frequencies, every filter with its defaults, beside the error of the best linear filter made
for each.
The bands are the least and the largest of three seeds: one seed would rank the filters by its luck.
"""

import matplotlib.pyplot as plt
import numpy as np

import testbed

FREQUENCIES = (0.5, 2.0, 10.0, 50.0, 250.0)
SEEDS = 3
FILTERS = ("kalman", "wideband", "complementary")

base = testbed.Scenario.from_dict(
    {
        "name": "one_line",
        "duration": "0.8 s",
        "settle": "0.4 s",
        "turntable": {"engine": "modal"},
        "motion": [{"sine": {"frequency": "1 Hz", "rate": "1 deg/s"}}],
        "sensors": {"mhd_ars": {"preset": "sx300"}, "mems_gyro": {"preset": "adis16505_filtered"}},
        "fusion": {name: {} for name in FILTERS},
    }
)
settings = [{"motion.0.sine.frequency": f"{frequency} Hz"} for frequency in FREQUENCIES]
table = testbed.evaluate(base, range(SEEDS), settings)  # one list per frequency, one entry per seed
rmse = {name: np.array([[one.fusion[name].rmse_deg_s for one in row] for row in table]) for name in FILTERS}
optimum = [row[0].fusion["kalman"].optimum_rmse_deg_s for row in table]
figure, axes = plt.subplots(layout="constrained", figsize=(7.0, 4.6))
for (name, found), line in zip(rmse.items(), ("-", "--", "-."), strict=True):
    (drawn,) = axes.loglog(FREQUENCIES, np.median(found, axis=1), line, label=name)
    axes.fill_between(FREQUENCIES, found.min(axis=1), found.max(axis=1), color=drawn.get_color(), alpha=0.2, lw=0.0)
axes.loglog(FREQUENCIES, optimum, "k:", lw=2.0, label="best linear filter of that line")
axes.set(xlabel="frequency [Hz]", ylabel="rms error [deg/s]")
axes.legend()
axes.grid(visible=True, alpha=0.4)
plt.show()
