r"""
What happens when a sensor falls silent?
========================================

The MHD sensor is lost for a second while the table swings at 3 Hz; the gyro carries on.
The claim grows with the error in the gap, and both are back soon after it.
"""

import matplotlib.pyplot as plt
import numpy as np

import testbed

run = testbed.run(
    {
        "name": "lost",
        "duration": "8 s",
        "turntable": {"engine": "modal"},
        "motion": [{"sine": {"frequency": "3 Hz", "rate": "1 deg/s"}}],
        "sensors": {"mhd_ars": {"preset": "sx300"}, "mems_gyro": {"preset": "adis16505_filtered"}},
    }
)
readings = {name: one.rate.copy() for name, one in run.sensors.items()}
rates = {name: one.sample_rate_hz for name, one in run.sensors.items()}
time = run.truth.time
readings["mhd_ars"][(time >= 4.0) & (time < 5.0)] = np.nan
belief = {"mhd_ars": testbed.belief_of("sx300"), "mems_gyro": testbed.belief_of("adis16505_filtered")}
figure, axes = plt.subplots(layout="constrained", figsize=(7.0, 4.4))
axes.axvspan(4.0, 5.0, color="0.9", label="MHD lost")
for name, line in (("kalman", "-"), ("steady_state", "--"), ("complementary", ":")):
    # The verdict would name the gap that is planted here.
    found = testbed.estimate(name, readings, sample_rate_hz=rates, belief=belief, start="rest", verdict=False)
    error = np.degrees(found.rate - run.truth.rate)
    rms = np.sqrt(np.mean(error.reshape(-1, 1000) ** 2, axis=1))
    axes.semilogy(time[::1000] + 0.025, rms, line, label=f"{name}, rms over 50 ms")
axes.set(xlabel="time [s]", ylabel="error [deg/s]", xlim=(3.0, 8.0), ylim=(5e-4, 3.0))
axes.legend(loc="upper right")
axes.grid(visible=True, alpha=0.4)
plt.show()
