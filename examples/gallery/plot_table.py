r"""
What shakes a table that stands still?
======================================

The inertial rate at the sensor on a floor that vibrates, table commanded to rest: on soft mounts, and on stiff ones.
What is commanded to be nothing is the floor of every measurement on that table; the true rate of a run has it, so no
filter is blamed for it.
"""

import matplotlib.pyplot as plt
import numpy as np
from scipy.signal import welch

import testbed

FLOOR = {
    "lines": [{"axis": "rz", "frequency": "29.5 Hz", "angular_acceleration": "1e-4 rad/s^2"}],
    "bands": [{"axis": "rz", "low": "2 Hz", "high": "200 Hz", "angular_acceleration_psd": "1e-10 (rad/s^2)^2/Hz"}],
}

base = testbed.Scenario.from_dict(
    {
        "name": "at_rest",
        "duration": "10 s",
        "turntable": {"engine": "modal", "floor": FLOOR},
        "motion": [{"static": {}}],
        "sensors": {"mhd_ars": {"preset": "sx300"}},
    }
)
cases = {
    "mounts of 1.5 to 2.5 Hz": base,
    "mounts of 10 Hz": base.with_(**{"turntable.isolation_frequency": ["10 Hz"] * 6}),
}
figure, axes = plt.subplots(layout="constrained", figsize=(7.0, 4.4))
for (name, scenario), line in zip(cases.items(), ("-", "--"), strict=True):
    truth = testbed.run(scenario).truth
    freq, power = welch(np.degrees(truth.rate), truth.sample_rate_hz, nperseg=40_000)
    axes.loglog(freq[1:], np.sqrt(power[1:]), line, lw=1.1, label=name)
sensor = testbed.load_preset("sx300")
frequency = np.geomspace(1.0, 300.0, 200)
noise = np.degrees(np.sqrt(2.0 * sensor.input_noise_psd(frequency)))
axes.loglog(frequency, noise, "k:", lw=2.0, label="noise of sx300")
axes.set(xlabel="frequency [Hz]", ylabel="root density, one-sided [deg/s/$\\sqrt{\\mathrm{Hz}}$]", xlim=(1.0, 190.0))
axes.set_ylim(1e-9, 1e-3)
axes.legend()
axes.grid(visible=True, alpha=0.4)
plt.show()
