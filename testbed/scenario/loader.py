"""Reading a scenario file, part by part, so that every part's errors are found at once."""

from __future__ import annotations

import re
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

from testbed.document import Document, unknown_key
from testbed.errors import ScenarioError, UnknownNameError, quoted
from testbed.inputs.plugins import Plugins, load_plugins
from testbed.models.motion import Motion
from testbed.models.motions import MOTIONS
from testbed.models.turntable.parameters import TurntableParameters
from testbed.parts import merge, preset
from testbed.pointing.parameters import PointingParameters, window_key
from testbed.scenario.beliefs import preset_belief
from testbed.scenario.checks import cross_check
from testbed.scenario.entries import is_name, kind_of, mapping
from testbed.scenario.frame import Frame
from testbed.scenario.fusion import Fusion
from testbed.scenario.intake import Intake, unresolved
from testbed.scenario.model import Bound, Scenario
from testbed.scenario.pointing import WINDOW_METRICS
from testbed.sensors import SENSORS, with_preset
from testbed.sensors.base import Sensor
from testbed.units import parse

if TYPE_CHECKING:
    from collections.abc import Iterable

    from testbed.document import Key
    from testbed.fusion.belief import SensorBelief

_BOUND = re.compile(r"\s*(<=|>=|<|>)\s*([-+0-9.eE]+)\s*")


def load_scenario(path: str | Path, *, plugins: Iterable[str] = (), allow_outside: bool = False) -> Scenario:
    """Read and validate a scenario.

    Parameters
    ----------
    path : str or Path
        A YAML 1.2 file; every dimensional value is a string with its unit.
    plugins : iterable of str, optional
        Modules, dotted or as paths of ``.py`` files, that are loaded first and whose classes the scenario may name as
        ``module:Class``; those of the environment variable ``TESTBED_PLUGINS`` besides.
    allow_outside : bool, optional
        Whether a recorded motion may lie outside the scenario's folder.

    Returns
    -------
    Scenario
        Validated, in SI.

    Raises
    ------
    ScenarioError
        With every finding at once: file, line, key and what was expected.

    Examples
    --------
    >>> load_scenario("no.yaml")
    Traceback (most recent call last):
    testbed.errors.ScenarioError: no.yaml: cannot be read: No such file or directory
    """
    loaded = load_plugins(plugins)
    return read_document(Intake(Document(Path(path)), Path(path).resolve().parent, loaded, allow_outside))


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


def read_document(intake: Intake) -> Scenario:
    """Validate the content of a document as a scenario.

    Parameters
    ----------
    intake : Intake
        The document, of a file or of a mapping built in Python, and the terms on which it is read.

    Raises
    ------
    ScenarioError
        With every finding at once.
    """
    scenario = _Reader(intake).scenario()
    intake.document.refuse()
    assert scenario is not None
    cross_check(scenario, intake.document)
    intake.document.refuse()
    return scenario


def load_instruments(path: str | Path) -> Scenario:
    """Read what a finished run's scenario says of frame, table and sensors; no plug-in is loaded.

    Parameters
    ----------
    path : str or Path
        ``scenario.yaml`` of a run folder.

    Returns
    -------
    Scenario
        Without motion, filters, expectations and the sensors of plug-ins.

    Raises
    ------
    ScenarioError
        As `load_scenario`.
    """
    document = Document(Path(path))
    scenario = _Reader(Intake(document, Path(path).resolve().parent, Plugins())).instruments()
    document.refuse()
    assert scenario is not None
    return scenario


class _Reader:
    """Takes a document apart, part by part, so that every part's errors are found."""

    def __init__(self, intake: Intake) -> None:
        self._intake, self._doc = intake, intake.document
        self._presets: dict[str, Any] = {"sensors": {}}
        self._data_sheets: dict[str, SensorBelief | None] = {}

    def scenario(self) -> Scenario | None:
        """Return the whole scenario; None if something is wrong, which the document knows."""
        return self._joined(dict(self._doc.data))

    def instruments(self) -> Scenario | None:
        """Return the scenario without what reading its results does not need."""
        sensors = mapping(self._doc, self._doc.data.get("sensors"), ("sensors",))
        kept = {key: value for key, value in self._doc.data.items() if key not in {"fusion", "pointing", "expect"}}
        shipped = {
            name: entry
            for name, entry in sensors.items()
            if not isinstance(entry, dict) or str(entry.get("type", name)) in SENSORS
        }
        return self._joined({**kept, "sensors": shipped, "motion": [{"static": {}}]})

    def _joined(self, data: dict[str, Any]) -> Scenario | None:
        parts = {key: data.pop(key, None) for key in ("turntable", "motion", "sensors", "fusion", "pointing", "expect")}
        for key in [key for key in data if key not in Frame.model_fields]:
            self._doc.find((key,), unknown_key(str(key), [*Frame.model_fields, *parts]))
            del data[key]
        frame = self._intake.validate(Frame, data, ())
        turntable = self._turntable(parts["turntable"])
        motion = self._motion(parts["motion"])
        sensors, types = self._sensors(parts["sensors"])
        if frame is not None and "temperature" in frame.model_fields_set:
            sensors = {name: at_temperature(sensor, frame.temperature.start) for name, sensor in sensors.items()}
        at_rest = frame is None or not frame.fusion_from
        fusion = Fusion(self._intake, sensors, types, self._data_sheets, turntable, at_rest).read(parts["fusion"])
        pointing = self._pointing(parts["pointing"])
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
            self._intake.folder,
            self._doc.data,
            self._presets,
            self._intake.plugins.used,
            self._intake.allow_outside,
            pointing,
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
        return None if merged is None else self._intake.validate(TurntableParameters, merged, key)

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
            model = self._intake.resolve("motion", str(kind), MOTIONS, Motion)
        except UnknownNameError as error:
            self._doc.find((*key, kind), str(error))
            return None
        given = mapping(self._doc, parameters, (*key, kind))
        motion = self._intake.validate(model, given, (*key, kind), shipped=kind in MOTIONS)
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
                model = self._intake.resolve("sensor", kind, SENSORS, Sensor)
            except UnknownNameError as error:
                self._doc.find((*key, "type"), unresolved(error, kind))
                continue
            sensor = self._intake.validate(model, merged, key, shipped=kind in SENSORS)
            if sensor is not None:
                sensors[name] = sensor
        return sensors, types

    def _pointing(self, data: Any) -> PointingParameters | None:
        if data is None:
            return None
        return self._intake.validate(PointingParameters, mapping(self._doc, data, ("pointing",)), ("pointing",))

    def _expect(self, data: Any) -> tuple[Bound, ...]:
        bounds: list[Bound] = []
        for subject, metrics in mapping(self._doc, data, ("expect",)).items():
            for metric, text in mapping(self._doc, metrics, ("expect", subject)).items():
                key = ("expect", subject, metric)
                if isinstance(text, dict) and metric in WINDOW_METRICS:
                    self._window_bounds(bounds, str(subject), key, text)
                else:
                    self._bound(bounds, str(subject), str(metric), key, text)
        return tuple(bounds)

    def _window_bounds(self, bounds: list[Bound], subject: str, key: Key, entry: dict[Any, Any]) -> None:
        for length, text in entry.items():
            try:
                metric = f"{key[-1]}.{window_key(parse(str(length), 's', example='100 ms'))}"
            except ValueError as error:
                self._doc.find((*key, length), str(error))
                continue
            self._bound(bounds, subject, metric, (*key, length), text)

    def _bound(self, bounds: list[Bound], subject: str, metric: str, key: Key, text: Any) -> None:
        try:
            bounds.append(read_bound(subject, metric, text))
        except ValueError:
            self._doc.find(key, f"expected a bound such as '< 0.0143', got {quoted(text)}")


def at_temperature(sensor: Sensor, temperature: float) -> Sensor:
    """Return a sensor at the run's temperature [K], if it has a constant one and its entry names none."""
    if "temperature" not in type(sensor).model_fields or "temperature" in sensor.model_fields_set:
        return sensor
    return sensor.model_copy(update={"temperature": temperature})


def read_bound(subject: str, metric: str, text: Any) -> Bound:
    """Return the bound that a text such as ``< 0.5`` sets; ValueError if it is none.

    Parameters
    ----------
    subject, metric : str
        On what.
    text : Any
        As it stands in a file.
    """
    return Bound(subject, metric, *_relation(_BOUND.fullmatch(text) if isinstance(text, str) else None))


def _relation(match: re.Match[str] | None) -> tuple[str, float]:
    if match is None:
        raise ValueError
    return match[1], float(match[2])
