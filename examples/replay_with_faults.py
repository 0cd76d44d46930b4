"""A recording with faults through the filters: a sign turned, a clock late; docs/replay.md has the words.

Run: python examples/replay_with_faults.py; a bench is simulated, spoilt, replayed as it is, and put right.
"""

from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np

import testbed

BENCH = {
    "name": "bench",
    "duration": "10 s",
    "settle": "2 s",
    "turntable": {"engine": "modal"},
    "motion": [
        {"sine": {"frequency": "0.2 Hz", "rate": "1 deg/s"}},
        {"platform_psd": {"spectrum": "olympus", "low": "1 Hz", "high": "150 Hz"}},
    ],
    "sensors": {"mhd_ars": {"preset": "sx300"}, "mems_gyro": {"preset": "adis16505_filtered"}},
}
LATE_NS = 20_000_000


def spoil(folder: Path) -> dict[str, object]:
    """Write the readings of a bench as a logger would that has one axis turned round; return the map of them."""
    run = testbed.run(BENCH)
    channels = {}
    for name, signals in {**run.sensors, "reference": run.truth}.items():
        gyro = name == "mems_gyro"
        stamps = np.rint(1e9 * signals.time).astype(np.int64) + (LATE_NS if gyro else 0)
        rate = -signals.rate if gyro else signals.rate
        rows = "".join(f"{t},{w!r}\n" for t, w in zip(stamps.tolist(), rate.tolist(), strict=True))
        (folder / f"{name}.csv").write_text(f"t [ns],w [rad/s]\n{rows}", encoding="utf-8")
        channels[name] = {"file": folder / f"{name}.csv", "column": "w"}
    return {"channels": channels}


def main() -> dict[str, float]:
    """Print what stands against the recording, and the error as it is and put right; return both [deg/s]."""
    found = {}
    with TemporaryDirectory() as folder:
        said = spoil(Path(folder))
        for fix in (False, True):
            run = testbed.replay([], ["kalman"], map=said, fix=fix, start="rest", settle=2.0)
            for one in run.metrics.findings:
                print(
                    f"{one.sensor}: {one.kind} {one.value:.6g} {'put right' if one.fixed else 'stands'}: {one.remedy}"
                )
            error = run.metrics.fusion["kalman"].rmse_deg_s
            found["put right" if fix else "as it is"] = error
            print(f"{'put right' if fix else 'as it is'}: {error:.4g} deg/s")
    return found


if __name__ == "__main__":
    main()
