"""A run of known signals, cut into blocks of any size, and a small turntable to draw."""

from __future__ import annotations

from dataclasses import dataclass, field
from types import SimpleNamespace
from typing import TYPE_CHECKING, Any

import mujoco
import numpy as np
import pytest

from testbed.recording import RecordingWriter

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator
    from pathlib import Path

    from numpy.typing import NDArray

    FloatArray = NDArray[np.float64]

XML = """
<mujoco><worldbody>
  <body name="platform" pos="0 0 0.3">
    <freejoint/>
    <geom type="box" size="0.5 0.5 0.1" rgba="0.35 0.38 0.42 1" mass="400"/>
    <body name="rotor" pos="0 0 0.15">
      <joint name="spin" axis="0 0 1"/>
      <geom type="cylinder" size="0.2 0.05" rgba="0.72 0.75 0.78 1" mass="20"/>
      <site name="mhd_ars" pos="0.1 0 0.07"/>
      <site name="mems_gyro" pos="-0.1 0 0.07"/>
    </body>
  </body>
</worldbody></mujoco>
"""
RATE = 20_000.0
GYRO_STRIDE = 10
POSE_STRIDE = 400


@dataclass
class SyntheticRun:
    """Two sines on the table, two noisy sensors, two filters; `blocks` cuts it as a pipeline would."""

    n_time: int
    seed: int = 1
    filters: tuple[str, ...] = ("kalman", "arw_shakf")
    heights: FloatArray = field(default_factory=lambda: 7.5e-3 * (1 - np.cos(np.linspace(0, np.pi, 41))))

    def __post_init__(self) -> None:
        rng = np.random.default_rng(self.seed)
        t = np.arange(self.n_time + 1) / RATE
        self.commanded = 0.0175 * np.sin(np.pi * t) + 0.003 * np.sin(20 * np.pi * t)
        self.truth = self.commanded[:-1] * 1.001
        self.angle = 0.0175 / np.pi * (1 - np.cos(np.pi * t[:-1]))
        self.readings = {
            "mhd_ars": self.truth + 2e-4 * rng.standard_normal(self.n_time),
            "mems_gyro": self.truth[::GYRO_STRIDE] + 1e-3 * rng.standard_normal(-(-self.n_time // GYRO_STRIDE)),
        }
        self.estimates = {name: self.truth + 1e-4 * rng.standard_normal(self.n_time) for name in self.filters}
        innovation = np.full(self.n_time, np.nan)
        innovation[::GYRO_STRIDE] = rng.standard_normal(innovation[::GYRO_STRIDE].size)
        self.diagnostics = {
            "R_mhd_ars": 1e-8 * (1 + 0.5 * np.sin(t[:-1])),
            "innovation_mems_gyro": innovation,
            "band_mhd_ars": np.floor(t[:-1]) % 3,
        }
        self.index = np.arange(0, self.n_time, POSE_STRIDE)
        half = self.angle[self.index] / 2
        zero = np.zeros(half.size)
        self.poses = {
            "platform": (np.tile([0.0, 0.0, 0.3], (half.size, 1)), np.column_stack((1 + zero, zero, zero, zero))),
            "rotor": (
                np.tile([0.0, 0.0, 0.45], (half.size, 1)),
                np.column_stack((np.cos(half), zero, zero, np.sin(half))),
            ),
        }
        shape = np.sin(np.pi * self.heights / self.heights.max()) ** 0.5
        self.profiles = -self.truth[self.index, np.newaxis] * shape

    def blocks(self, size: int) -> Iterator[Any]:
        """Blocks of `size` base samples; the last one holds the rest."""
        for start in range(0, self.n_time, size):
            end = min(start + size, self.n_time)
            here = slice(start, end)
            gyro = slice(-(-start // GYRO_STRIDE), -(-end // GYRO_STRIDE))
            pose = slice(-(-start // POSE_STRIDE), -(-end // POSE_STRIDE))
            std = np.full(end - start, 1e-4)
            yield SimpleNamespace(
                start=start,
                command=SimpleNamespace(rate=self.commanded[start : end + 1]),
                truth=SimpleNamespace(
                    rate=self.truth[here],
                    angle=self.angle[here],
                    poses={body: (p[pose], q[pose]) for body, (p, q) in self.poses.items()},
                ),
                sensors={"mhd_ars": self.readings["mhd_ars"][here], "mems_gyro": self.readings["mems_gyro"][gyro]},
                fusion={
                    name: SimpleNamespace(
                        rate=rate[here], std=std, diagnostics={k: v[here] for k, v in self.diagnostics.items()}
                    )
                    for name, rate in self.estimates.items()
                },
                profiles={"mhd_ars": (self.heights, self.profiles[pose])},
                temperatures={},
                drifts={},
                pointing={},
            )

    def writer(self, path: Path, **changes: Any) -> RecordingWriter:
        """Return a writer for this run; `changes` replace its arguments."""
        arguments: dict[str, Any] = {
            "scenario_name": "synthetic",
            "sample_rate_hz": RATE,
            "n_time": self.n_time,
            "sensor_rates": {"mhd_ars": RATE, "mems_gyro": RATE / GYRO_STRIDE},
            "fusion_names": self.filters,
            "model": mujoco.MjModel.from_xml_string(XML),
            "unit": "deg/s",
            "settle": 1.0,
            "detail": (1.0, 1.25),
        }
        return RecordingWriter(path, **(arguments | changes))

    def record(self, path: Path, size: int = 20_000, **changes: Any) -> Path:
        """Write the whole run in blocks of `size` samples."""
        with self.writer(path, **changes) as writer:
            for block in self.blocks(size):
                writer.write(block)
        return path


@pytest.fixture(scope="session")
def synthetic_run() -> Callable[..., SyntheticRun]:
    return SyntheticRun
