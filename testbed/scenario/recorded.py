"""A replayed recording read back as a scenario: frame, clocks, filters and beliefs, for what is done afterwards."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, cast

from testbed.document import Document
from testbed.inputs.plugins import load_plugins
from testbed.scenario.entries import mapping
from testbed.scenario.frame import Frame
from testbed.scenario.fusion import Fusion
from testbed.scenario.intake import Intake
from testbed.scenario.loader import load_scenario
from testbed.scenario.model import Scenario
from testbed.units import parse

if TYPE_CHECKING:
    from collections.abc import Iterable

REPLAY = "replay"
# No type of a simulated instrument.
_TYPE = "recorded"


@dataclass(frozen=True)
class RecordedSensor:
    """A sensor of a recording, of which the instrument is not known.

    Parameters
    ----------
    sample_rate : float
        Rate of its readings [Hz].
    noise : bool, optional
        Nothing is known of its noise beside what the filters believe.
    """

    sample_rate: float
    noise: bool = False


@dataclass(frozen=True)
class RecordedScenario(Scenario):
    """A recording that was replayed: frame and filters, no table and no motion, on the clock of the fastest sensor."""

    @property
    def base_rate_hz(self) -> float:
        """Rate of the base clock [Hz]."""
        return max(sensor.sample_rate for sensor in self.sensors.values())


def load_described(path: str | Path, *, plugins: Iterable[str] = ()) -> Scenario:
    """Read the ``scenario.yaml`` of a run folder, be it of a run or of a replay.

    Parameters
    ----------
    path : str or Path
        The file.
    plugins : iterable of str, optional
        As for `load_scenario`.

    Raises
    ------
    ScenarioError
        As `load_scenario`.
    """
    document = Document(Path(path))
    if REPLAY not in document.data:
        return load_scenario(path, plugins=plugins)
    intake = Intake(document, Path(path).resolve().parent, load_plugins(plugins))
    data = document.data
    frame = intake.validate(Frame, {key: data[key] for key in ("name", "duration", "settle") if key in data}, ())
    channels = mapping(document, mapping(document, data[REPLAY], (REPLAY,)).get("channels"), (REPLAY, "channels"))
    sensors = {name: RecordedSensor(parse(entry["rate"], "Hz", example="2 kHz")) for name, entry in channels.items()}
    types = dict.fromkeys(sensors, _TYPE)
    fusion = Fusion(intake, {}, types, {}, None, at_rest=False, simulated=False).read(data.get("fusion"))
    document.refuse()
    assert frame is not None
    nothing = cast("Any", None)
    found = cast("Any", sensors)
    return RecordedScenario(
        frame, nothing, (), found, types, fusion, (), str(path), intake.folder, data, {}, intake.plugins.used
    )
