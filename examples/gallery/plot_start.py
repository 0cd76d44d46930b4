r"""
What does a filter know before its first reading?
=================================================

A record that begins in mid-motion, cut out of a run.
Told that the table rests at the start (``rest``), the filter takes the motion for an error of its sensors and needs
minutes to forget; told nothing (``unknown``), it claims no more than it knows from the first reading on.
"""

import matplotlib.pyplot as plt
import numpy as np

import testbed

CUT = 5.5

run = testbed.run(
    {
        "name": "mid_motion",
        "duration": "14 s",
        "turntable": {"engine": "modal"},
        "motion": [
            {"sine": {"frequency": "0.5 Hz", "rate": "1 deg/s"}},
            {"sine": {"frequency": "10 Hz", "rate": "0.18 deg/s"}},
        ],
        "sensors": {"mhd_ars": {"preset": "sx300"}, "mems_gyro": {"preset": "adis16505_filtered"}},
    }
)
readings = {name: one.rate[round(CUT * one.sample_rate_hz) :] for name, one in run.sensors.items()}
rates = {name: one.sample_rate_hz for name, one in run.sensors.items()}
truth = run.truth.rate[-readings["mhd_ars"].size :]
belief = {"mhd_ars": testbed.belief_of("sx300"), "mems_gyro": testbed.belief_of("adis16505_filtered")}
time = np.arange(truth.size) / rates["mhd_ars"]
figure, panels = plt.subplots(2, 1, sharex=True, layout="constrained", figsize=(7.0, 5.2))
for axes, start in zip(panels, ("rest", "unknown"), strict=True):
    found = testbed.estimate("kalman", readings, sample_rate_hz=rates, belief=belief, start=start)
    axes.semilogy(time, np.degrees(np.abs(found.rate - truth)) + 1e-5, lw=0.4, color="tab:blue", label="error")
    axes.semilogy(time, np.degrees(2.0 * found.std), "k--", lw=1.5, label="twice its claim")
    axes.set(ylabel="deg/s", title=f"start: {start}", ylim=(1e-4, 50.0))
    axes.grid(visible=True, alpha=0.4)
panels[0].legend(loc="upper right")
panels[1].set(xlabel="time since the record began [s]")
plt.show()
