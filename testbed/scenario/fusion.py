"""Reading the filters of a scenario and what they believe of its sensors."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from testbed.errors import ScenarioError, UnknownNameError, quoted, shortened
from testbed.fusion import FILTERS
from testbed.fusion.belief import SensorBelief, load_belief
from testbed.fusion.belief_file import is_belief_file, read_belief
from testbed.inputs.files import beside_scenario
from testbed.scenario.beliefs import EXACT, exact_belief
from testbed.scenario.entries import is_name, kind_of, mapping
from testbed.scenario.intake import unresolved
from testbed.scenario.model import FilterSpec

if TYPE_CHECKING:
    from collections.abc import Mapping

    from testbed.document import Key
    from testbed.models.turntable.parameters import TurntableParameters
    from testbed.scenario.intake import Intake
    from testbed.sensors.base import Sensor

_REMEDY = "write 'belief: exact' for the simulator's own response and noise, or what is believed of it"
_OF_RECORDING = (
    "name the channels of the recording as the belief does, leave out those that are no sensors, or write what is "
    "believed of it"
)


@dataclass(frozen=True)
class Fusion:
    """The part `fusion` of a scenario, read beside its sensors.

    Parameters
    ----------
    intake : Intake
        Takes the findings, and knows what may be named.
    sensors, types : mapping of str to Sensor, of str to str
        The instruments that could be built, and the types of all.
    data_sheets : mapping of str to SensorBelief or None
        What the presets of the sensors say of them.
    turntable : TurntableParameters or None
        What carries them, which rests at t = 0.
    at_rest : bool
        Whether the filters see that: their first readings are those of t = 0.
    simulated : bool, optional
        Whether the sensors are instruments of the simulator, of which it knows what they exactly are.
    """

    intake: Intake
    sensors: Mapping[str, Sensor]
    types: Mapping[str, str]
    data_sheets: Mapping[str, SensorBelief | None]
    turntable: TurntableParameters | None
    at_rest: bool
    simulated: bool = True

    def read(self, data: Any) -> dict[str, FilterSpec]:
        """Return the filters by name; what is wrong with the others is noted."""
        specs = {}
        for name, entry in mapping(self.intake.document, data, ("fusion",)).items():
            key = ("fusion", name)
            if is_name(self.intake.document, name, key):
                spec = self._filter(name, dict(mapping(self.intake.document, entry, key)), key)
                if spec is not None:
                    specs[name] = spec
        return specs

    def _filter(self, name: str, entry: dict[str, Any], key: Key) -> FilterSpec | None:
        kind = kind_of(self.intake.document, entry.pop("type", name), key)
        written = entry.pop("belief", None)
        if kind is None:
            return None
        try:
            factory = self.intake.resolve("filter", kind, FILTERS, object)
        except UnknownNameError as error:
            self._find((*key, "type"), unresolved(error, kind))
            return None
        belief = self._belief(written, (*key, "belief"))
        model = getattr(factory, "Parameters", None)
        entry = {**self._at_rest(model, entry), **entry}
        parameters = entry if model is None else self.intake.validate(model, entry, key, shipped=kind in FILTERS)
        if parameters is None or belief is None:
            return None
        return FilterSpec(kind, factory, parameters, self._without_rounding(belief))

    def _without_rounding(self, belief: Mapping[str, SensorBelief]) -> dict[str, SensorBelief]:
        """Return the belief without a step of the readings for sensors without noise: they do not round, and rightly
        repeat themselves at rest.
        """
        silent = {name for name, sensor in self.sensors.items() if not sensor.noise}
        return {
            name: one.model_copy(update={"resolution": None}) if name in silent else one for name, one in belief.items()
        }

    def _at_rest(self, model: Any, entry: Mapping[str, Any]) -> dict[str, str]:
        """Return what a filter may know of a scenario's table, unless its entry says otherwise: it rests at t = 0, at
        the Earth's rate where that is on.
        """
        told = entry.get("start", "rest" if self.at_rest else "unknown")
        if "start" not in getattr(model, "model_fields", {}) or told != "rest":
            return {}
        earth = None if self.turntable is None else self.turntable.earth_rate
        return {"start": "rest"} | ({} if earth is None else {"rest_rate": f"{earth.vector[2]!r} rad/s"})

    def _find(self, key: Key, message: str) -> None:
        self.intake.document.find(key, message)

    def _belief(self, written: Any, key: Key) -> dict[str, SensorBelief] | None:
        """Return what a filter believes of each sensor; None, with the findings noted, if not of all."""
        if written is None:
            return self._of_presets(key)
        if written == EXACT and self.simulated:
            return self._exact(key)
        known = self._named(written, key)
        return None if known is None else self._of_types(known, key)

    def _of_presets(self, key: Key) -> dict[str, SensorBelief] | None:
        belief = {}
        for name in self.types:
            one = self.data_sheets.get(name)
            if one is None:
                self._find(key, f"nothing is known of sensor {quoted(name)}: no data sheet of a preset; {_REMEDY}")
            else:
                belief[name] = one
        return belief if len(belief) == len(self.types) else None

    def _exact(self, key: Key) -> dict[str, SensorBelief] | None:
        belief = {}
        for name, sensor in self.sensors.items():
            try:
                belief[name] = exact_belief(sensor)
            except ValueError as error:
                self._find(key, f"{name}: {error}")
        return belief if len(belief) == len(self.types) else None

    def _of_types(self, known: Mapping[str, SensorBelief], key: Key) -> dict[str, SensorBelief] | None:
        """Return what a belief that was asked for says of each sensor: by the sensor's name, or else by its type."""
        belief = {}
        for name, kind in self.types.items():
            one = known.get(name, known.get(kind))
            if one is None:
                words = f"says nothing of sensor {quoted(name)} (it knows {shortened(', '.join(sorted(known)))})"
                self._find(key, f"{words}; {_REMEDY if self.simulated else _OF_RECORDING}")
            else:
                belief[name] = one
        return belief if len(belief) == len(self.types) else None

    def _named(self, written: Any, key: Key) -> Mapping[str, SensorBelief] | None:
        """Return a belief by its name or as written out; None if it is neither, with what was wrong noted."""
        if isinstance(written, str) and is_belief_file(written):
            return self._of_file(written, key)
        if isinstance(written, str):
            try:
                return load_belief(written)
            except ValueError as error:
                self._find(key, str(error))
                return None
        if not isinstance(written, dict):
            wanted = "the name of a belief, a file of one, or a mapping of sensors"
            self._find(key, f"expected {wanted}, got {quoted(written)}")
            return None
        read = {str(name): self.intake.validate(SensorBelief, value, (*key, name)) for name, value in written.items()}
        known = {name: _labelled(one) for name, one in read.items() if one is not None}
        return known if len(known) == len(read) else None

    def _of_file(self, written: str, key: Key) -> Mapping[str, SensorBelief] | None:
        """Return a belief that stands in a file beside the scenario; None if it cannot be used, with the reason
        noted.
        """
        context = {"folder": self.intake.folder, "allow_outside": self.intake.allow_outside}
        try:
            return read_belief(beside_scenario(Path(written), context))
        except ScenarioError as error:
            self.intake.document.adopt(error)
        except ValueError as error:
            self._find(key, str(error))
        return None


def _labelled(one: SensorBelief) -> SensorBelief:
    """Return a belief as written out, which bears the name of a shipped one only if it is that.

    Where the noise of the sensor is off, the scenario itself has taken its resolution away. The name of a file is that
    of no shipped one, and what it held stands here.
    """
    if is_belief_file(one.source):
        return one
    try:
        known = load_belief(one.source).values()
    except ValueError:
        known = {}.values()
    shipped = any(one in (each, each.model_copy(update={"resolution": None})) for each in known)
    return one if shipped else one.model_copy(update={"source": "given"})
