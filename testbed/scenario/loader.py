"""Reading a scenario file, part by part, so that every part's errors are found at once."""

from __future__ import annotations

import re
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

from testbed.document import Document, unknown_key
from testbed.errors import ScenarioError, UnknownNameError, quoted
from testbed.models.motions import MOTIONS
from testbed.models.turntable.turntable import TurntableParameters
from testbed.parts import merge, preset, resolve
from testbed.scenario.beliefs import preset_belief
from testbed.scenario.checks import cross_check
from testbed.scenario.entries import is_name, kind_of, mapping
from testbed.scenario.fusion import Fusion
from testbed.scenario.model import Bound, Frame, Scenario
from testbed.sensors import SENSORS, with_preset

if TYPE_CHECKING:
    from testbed.fusion.belief import SensorBelief
    from testbed.models.motion import Motion
    from testbed.sensors.base import Sensor

_BOUND = re.compile(r"\s*(<=|>=|<|>)\s*([-+0-9.eE]+)\s*")


def load_scenario(path: str | Path) -> Scenario:
    """Read and validate a scenario.

    Parameters
    ----------
    path : str or Path
        A YAML 1.2 file; every dimensional value is a string with its unit.

    Returns
    -------
    Scenario
        Validated, in SI.

    Raises
    ------
    ScenarioError
        With every finding at once: file, line, key and what was expected.
    """
    return read_document(Document(Path(path)), Path(path).resolve().parent)


def as_scenario(given: object) -> Scenario:
    """Return a scenario as it is, or read it from its file or from a mapping.

    Parameters
    ----------
    given : Scenario, str, Path or mapping
        Which; relative paths of a mapping begin in the working folder.

    Raises
    ------
    ScenarioError
        If it is no valid scenario.
    """
    if isinstance(given, Scenario):
        return given
    if isinstance(given, str | Path):
        return load_scenario(given)
    if isinstance(given, Mapping):
        return Scenario.from_dict(given)
    msg = f"expected a scenario, its file or a mapping of its keys, got {quoted(given)}"
    raise ScenarioError(msg)


def read_document(document: Document, folder: Path) -> Scenario:
    """Validate the content of a document as a scenario.

    Parameters
    ----------
    document : Document
        Of a file, or of a mapping built in Python.
    folder : Path
        Where relative paths in it begin.

    Raises
    ------
    ScenarioError
        With every finding at once.
    """
    scenario = _Reader(document, folder).scenario()
    document.refuse()
    assert scenario is not None
    cross_check(scenario, document)
    document.refuse()
    return scenario


class _Reader:
    """Takes a document apart, part by part, so that every part's errors are found."""

    def __init__(self, document: Document, folder: Path) -> None:
        self._doc = document
        self._folder = folder
        self._presets: dict[str, Any] = {"sensors": {}}
        self._data_sheets: dict[str, SensorBelief | None] = {}

    def scenario(self) -> Scenario | None:
        data = dict(self._doc.data)
        parts = {key: data.pop(key, None) for key in ("turntable", "motion", "sensors", "fusion", "expect")}
        for key in [key for key in data if key not in Frame.model_fields]:
            self._doc.find((key,), unknown_key(str(key), [*Frame.model_fields, *parts]))
            del data[key]
        frame = self._doc.validate(Frame, data, (), self._folder)
        turntable = self._turntable(parts["turntable"])
        motion = self._motion(parts["motion"])
        sensors, types = self._sensors(parts["sensors"])
        if frame is not None and "temperature" in frame.model_fields_set:
            sensors = {name: at_temperature(sensor, frame.temperature.start) for name, sensor in sensors.items()}
        fusion = Fusion(self._doc, self._folder, sensors, types, self._data_sheets).read(parts["fusion"])
        expect = self._expect(parts["expect"])
        if frame is None or turntable is None or self._doc.problems:
            return None
        return Scenario(
            frame,
            turntable,
            motion,
            sensors,
            types,
            fusion,
            expect,
            self._doc.file,
            self._folder,
            self._doc.data,
            self._presets,
        )

    def _with_preset(
        self, data: dict[str, Any], package: str, key: tuple[str | int, ...], default: str | None = None
    ) -> dict[str, Any] | None:
        """Lay `data` over the preset that it names; None if there is no such preset."""
        name = data.get("preset", default)
        rest = {k: v for k, v in data.items() if k != "preset"}
        if name is None:
            return rest
        try:
            if package == "testbed.sensors":
                return with_preset(str(name), rest)
            return merge(preset(package, str(name)), rest)
        except UnknownNameError as error:
            self._doc.find((*key, "preset"), str(error))
            return None

    def _turntable(self, data: Any) -> TurntableParameters | None:
        key = ("turntable",)
        merged = self._with_preset(mapping(self._doc, data, key), "testbed.models", key, "air_bearing")
        self._presets["turntable"] = merged or {}
        return None if merged is None else self._doc.validate(TurntableParameters, merged, key, self._folder)

    def _motion(self, data: Any) -> tuple[tuple[str, Motion], ...]:
        if not isinstance(data, list) or not data:
            self._doc.find(
                ("motion",),
                "expected a list of motions, such as '- sine: {frequency: 10 Hz, rate: 1 deg/s}' or '- static: {}'",
            )
            return ()
        terms = [self._term(item, ("motion", i)) for i, item in enumerate(data)]
        return tuple(term for term in terms if term is not None)

    def _term(self, item: Any, key: tuple[str | int, ...]) -> tuple[str, Motion] | None:
        if not isinstance(item, dict) or len(item) != 1:
            self._doc.find(key, f"expected one motion with its parameters, such as 'sine: {{...}}', got {quoted(item)}")
            return None
        kind, parameters = next(iter(item.items()))
        try:
            model = resolve("motion", str(kind), MOTIONS)
        except UnknownNameError as error:
            self._doc.find((*key, kind), str(error))
            return None
        motion = self._doc.validate(model, mapping(self._doc, parameters, (*key, kind)), (*key, kind), self._folder)
        return None if motion is None else (str(kind), motion)

    def _sensors(self, data: Any) -> tuple[dict[str, Sensor], dict[str, str]]:
        sensors: dict[str, Sensor] = {}
        types: dict[str, str] = {}
        for name, entry in mapping(self._doc, data, ("sensors",)).items():
            key = ("sensors", name)
            given = mapping(self._doc, entry, key) if is_name(self._doc, name, key) else None
            merged = None if given is None else self._with_preset(given, "testbed.sensors", key)
            if given is None or merged is None:
                continue
            if "belief" in merged and "belief" not in given:
                # What the preset's data sheet supports; it is no parameter of the sensor.
                del merged["belief"]
                self._data_sheets[name] = preset_belief(str(given["preset"]))
            self._presets["sensors"][name] = dict(merged)
            kind = kind_of(self._doc, merged.pop("type", name), key)
            if kind is None:
                continue
            types[name] = kind
            try:
                model = resolve("sensor", kind, SENSORS)
            except UnknownNameError as error:
                self._doc.find((*key, "type"), f"{error}; say which with 'type:'")
                continue
            sensor = self._doc.validate(model, merged, key, self._folder)
            if sensor is not None:
                sensors[name] = sensor
        return sensors, types

    def _expect(self, data: Any) -> tuple[Bound, ...]:
        bounds = []
        for subject, metrics in mapping(self._doc, data, ("expect",)).items():
            for metric, text in mapping(self._doc, metrics, ("expect", subject)).items():
                match = _BOUND.fullmatch(text) if isinstance(text, str) else None
                try:
                    bounds.append(Bound(str(subject), str(metric), *_relation(match)))
                except ValueError:
                    self._doc.find(
                        ("expect", subject, metric), f"expected a bound such as '< 0.0143', got {quoted(text)}"
                    )
        return tuple(bounds)


def at_temperature(sensor: Sensor, temperature: float) -> Sensor:
    """Return a sensor at the run's temperature [K], if it has a constant one and its entry names none."""
    if "temperature" not in type(sensor).model_fields or "temperature" in sensor.model_fields_set:
        return sensor
    return sensor.model_copy(update={"temperature": temperature})


def _relation(match: re.Match[str] | None) -> tuple[str, float]:
    if match is None:
        raise ValueError
    return match[1], float(match[2])
