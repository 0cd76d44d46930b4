r"""
How late may the command of a mirror come?
==========================================

The jitter that a fast mirror leaves on a laser link when a fused rate feeds it forward, against the latency of its
computation: with the lead that adds rate times delay, and without.
A tracker of 10 Hz alone leaves the dotted line.
"""

import matplotlib.pyplot as plt

import testbed

LATENCIES_US = (0, 500, 1000)

base = testbed.Scenario.from_dict(
    {
        "name": "link",
        "duration": "3 s",
        "settle": "1 s",
        "turntable": {"engine": "modal"},
        "motion": [{"platform_psd": {"spectrum": "olympus", "low": "1 Hz", "high": "150 Hz"}}],
        "sensors": {"mhd_ars": {"preset": "sx300"}, "mems_gyro": {"preset": "adis16505_filtered"}},
        "fusion": {"kalman": {"belief": "identified"}},
        "pointing": {"tracker": {"bandwidth": "10 Hz"}, "mirror": {"bandwidth": "1 kHz"}},
    }
)
figure, axes = plt.subplots(layout="constrained", figsize=(7.0, 4.2))
for lead, line in (("off", "o--"), ("on", "s-")):
    found = [
        testbed.run(
            base.with_(**{"pointing.mirror.latency": f"{latency} us", "pointing.mirror.lead": lead})
        ).metrics.pointing["kalman"]
        for latency in LATENCIES_US
    ]
    axes.semilogy(LATENCIES_US, [one.residual_rms_urad for one in found], line, label=f"lead {lead}")
axes.axhline(found[0].tracker_only_rms_urad, color="k", ls=":", label="tracker alone")
axes.set(xlabel="latency of the computation [us]", ylabel="residual jitter [urad rms]")
axes.legend()
axes.grid(visible=True, alpha=0.4)
plt.show()
