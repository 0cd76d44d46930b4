r"""
What if a sensor lies?
======================

The MHD sensor sticks at its last reading for a second.
The gate before every filter sees a reading that repeats more often than its noise allows and leaves it out; with
``gate: off`` the filter believes it.
"""

import matplotlib.pyplot as plt
import numpy as np

import testbed

run = testbed.run(
    {
        "name": "stuck",
        "duration": "6 s",
        "turntable": {"engine": "modal"},
        "motion": [{"sine": {"frequency": "3 Hz", "rate": "1 deg/s"}}],
        "sensors": {"mhd_ars": {"preset": "sx300"}, "mems_gyro": {"preset": "adis16505_filtered"}},
    }
)
readings = {name: one.rate.copy() for name, one in run.sensors.items()}
rates = {name: one.sample_rate_hz for name, one in run.sensors.items()}
time = run.truth.time
stuck = (time >= 3.0) & (time < 4.0)
readings["mhd_ars"][stuck] = readings["mhd_ars"][np.flatnonzero(stuck)[0]]
belief = {"mhd_ars": testbed.belief_of("sx300"), "mems_gyro": testbed.belief_of("adis16505_filtered")}
figure, axes = plt.subplots(layout="constrained", figsize=(7.0, 4.2))
axes.plot(time, np.degrees(run.truth.rate), color="0.6", lw=3.0, label="true rate")
for gate, line in (("on", "-"), ("off", "--")):
    # The verdict would name what is planted here.
    chosen = {"belief": belief, "start": "rest", "gate": gate, "verdict": False}
    found = testbed.estimate("kalman", readings, sample_rate_hz=rates, **chosen)
    axes.plot(time, np.degrees(found.rate), line, lw=1.2, label=f"kalman, gate: {gate}")
axes.axvspan(3.0, 4.0, color="0.93", zorder=0)
axes.set(xlabel="time [s]", ylabel="rate [deg/s]", xlim=(2.5, 5.5), ylim=(-2.5, 2.5))
axes.legend(loc="lower right")
plt.show()
