r"""
What does a thermal cycle do to a fibre-optic gyro?
===================================================

A day at rest in a chamber: the drift follows the temperature's slope as much as the temperature, so that going up and
coming down differ.
A model in the temperature alone cannot follow that.
"""

from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np

import testbed

SCENARIOS = Path(testbed.__file__).parents[1] / "scenarios"

run = testbed.run(SCENARIOS / "fog/thermal_cycle.yaml")
fog = run.sensors["fog"]
BLOCK = 600


def means(values):
    """Return means over ten minutes."""
    values = np.asarray(values)[: values.size // BLOCK * BLOCK]
    return values.reshape(-1, BLOCK).mean(axis=1)


deg_h = np.degrees(3600.0)
drift = deg_h * means(fog.rate - fog.rate.mean())
temperature = means(fog.temperature) - 273.15
hours = BLOCK / 3600.0 * np.arange(drift.size)
figure, (over_time, over_temperature) = plt.subplots(1, 2, layout="constrained", figsize=(8.6, 3.9))
figure.get_layout_engine().set(wspace=0.1)
over_time.plot(hours, drift, lw=1.2)
over_time.set(xlabel="time [h]", ylabel="rate, means over 10 min [deg/h]")
twin = over_time.twinx()
twin.plot(hours, temperature, "k--", lw=1.0)
twin.set_ylabel("temperature [degC], dashed")
for begin, end, line, name in ((2.0, 8.6, "-", "up"), (8.7, 23.6, "--", "down")):
    part = (hours >= begin) & (hours <= end)
    over_temperature.plot(temperature[part], drift[part], line, label=name)
over_temperature.set(xlabel="temperature [degC]", ylabel="rate [deg/h]")
over_temperature.legend()
plt.show()
