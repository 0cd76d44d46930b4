"""The peaks of a commanded motion are worked out once for all scenarios that ask the same, and again for any other."""

import shutil
from pathlib import Path
from typing import Any

import pytest

from testbed import Scenario
from testbed.models.motions import MOTIONS
from testbed.parts import resolve
from testbed.scenario.peaks import command_peaks

SINE = {"sine": {"frequency": "4 Hz", "rate": "1 deg/s"}}
NOISE = {"random": {"psd": "1e-6 (deg/s)^2/Hz", "low": "1 Hz", "high": "10 Hz"}}


def scenario(*motion: dict[str, Any], folder: str | Path = ".") -> Scenario:
    return Scenario.from_dict({"name": "peaks", "duration": "2 s", "motion": list(motion)}, folder)


def test_the_same_motion_is_not_played_again() -> None:
    peaks = command_peaks(scenario(SINE))
    assert command_peaks(scenario(SINE)) is peaks
    assert command_peaks(scenario(SINE).with_(seed=7)) is peaks


@pytest.mark.parametrize(
    ("key", "value"),
    [
        ("duration", "1.9 s"),
        ("ramp_in", "1.5 s"),
        ("motion.0.sine.rate", "2 deg/s"),
        ("turntable.mode", "ideal"),
        ("truth_seed", 3),
    ],
)
def test_another_motion_is(key: str, value: object) -> None:
    base = scenario(NOISE) if key == "truth_seed" else scenario(SINE)
    peaks = command_peaks(base)
    assert command_peaks(base.with_(**{key: value})) is not peaks


def test_a_file_that_has_changed_is_read_again(tmp_path: Path) -> None:
    rows = [f"{k / 100:.2f},{k % 7}" for k in range(300)]
    path = tmp_path / "rate.csv"
    path.write_text("t,rate\n" + "\n".join(rows) + "\n")
    recorded = {
        "recorded": {
            "file": "rate.csv",
            "time": {"column": "t", "unit": "s"},
            "rate": {"column": "rate", "unit": "deg/s"},
        }
    }
    before = command_peaks(scenario(recorded, folder=tmp_path)).rate
    shutil.copy(path, tmp_path / "old.csv")
    path.write_text(path.read_text().replace(",6", ",12"))
    after = command_peaks(scenario(recorded, folder=tmp_path)).rate
    assert after > 1.5 * before


@pytest.mark.parametrize("name", MOTIONS)
def test_every_shipped_motion_can_be_kept(name: str) -> None:
    """What has no hash would end in a TypeError at check."""
    kind = resolve("motion", name, MOTIONS)
    assert kind.model_config.get("frozen")
    for field in kind.model_fields.values():
        assert not {"list", "dict", "ndarray"} & set(str(field.annotation).replace("[", " ").split())
