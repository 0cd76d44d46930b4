"""A scenario: everything that one experiment needs, validated before anything runs."""

from __future__ import annotations

from copy import deepcopy
from dataclasses import dataclass, field, replace
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

from testbed.document import Document
from testbed.fusion import FILTERS
from testbed.fusion.belief import declared
from testbed.inputs.plain import plain_tree
from testbed.inputs.plugins import Plugins, load_plugins, running
from testbed.models.motion import MotionProfile, watched
from testbed.models.motions import MOTIONS
from testbed.scenario.edits import edited
from testbed.scenario.resolved import dump, resolved_expectations, resolved_fusion
from testbed.signals import BASE_RATE_HZ, random_stream
from testbed.units import rate_unit

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Mapping

    from testbed.fusion.belief import SensorBelief
    from testbed.inputs.plugins import Plugin
    from testbed.inputs.tree import Tree
    from testbed.models.motion import Motion
    from testbed.models.turntable.floor import FloorMotion
    from testbed.models.turntable.parameters import TurntableParameters
    from testbed.pointing.parameters import PointingParameters
    from testbed.scenario.frame import Frame
    from testbed.sensors.base import Sensor
    from testbed.units import RateUnit

# Base samples of the default detail, at the least.
_FEWEST_DETAIL = 1000

METRICS = (
    "rmse_deg_s",
    "rmse_aligned_deg_s",
    "peak_error_deg_s",
    "mean_std_deg_s",
    "inside_2_std",
    "floor_rmse_deg_s",
    "prior_floor_rmse_deg_s",
    "optimum_rmse_deg_s",
    "optimum_settled_deg_s",
    "missing",
)


@dataclass(frozen=True)
class Bound:
    """One expectation: `metric` of `subject` compared with `limit`."""

    subject: str
    metric: str
    relation: str
    limit: float

    def met(self, value: float | None) -> bool:
        """Return whether `value` is within the bound; an undefined value is not."""
        if value is None:
            return False
        return {"<": value < self.limit, "<=": value <= self.limit, ">": value > self.limit, ">=": value >= self.limit}[
            self.relation
        ]


@dataclass(frozen=True)
class FilterSpec:
    """One fusion filter of a scenario: its class, parameters, belief and the sensors that it reads."""

    type: str
    factory: Callable[..., Any]
    parameters: Any
    belief: Mapping[str, SensorBelief]

    def start(self, sample_rate_hz: Mapping[str, float]) -> Any:
        """Return the filter at its beginning.

        Parameters
        ----------
        sample_rate_hz : mapping of str to float
            Rate of each sensor [Hz].

        Raises
        ------
        ValueError
            If belief, rates and parameters do not fit together; PluginError for whatever a plug-in raises.
        """
        if self.type in FILTERS:
            return self.factory(self.belief, sample_rate_hz, self.parameters)
        # Copies: a plug-in may keep and change what it gets.
        with running(f"plug-in {self.type}"):
            return self.factory(dict(self.belief), dict(sample_rate_hz), deepcopy(self.parameters))

    def facts(self) -> dict[str, str | None]:
        """Return what is said of it beside its errors: whose belief it has, what it knows of its start, a caution."""
        return {
            "belief": declared(self.belief),
            "start": getattr(self.parameters, "start", None),
            "caution": getattr(self.factory, "caution", None) or None,
        }


@dataclass(frozen=True)
class Scenario:
    """A validated scenario in SI.

    `source` is the mapping as written, with the user's units, and `presets` holds the parts that presets filled in;
    `file` is where it stands, nothing if it was built in Python, and `folder` where relative paths begin, outside of
    which a recorded motion may lie only with `allow_outside`; `plugins` are those that were loaded for it.

    Examples
    --------
    >>> scenario = Scenario.from_dict({"name": "still", "duration": "2 s", "motion": [{"static": {}}]})
    >>> scenario.with_(duration="5 s", **{"motion.0": {"sine": {"frequency": "4 Hz", "rate": "1 deg/s"}}}).lines
    (4.0,)
    """

    frame: Frame
    turntable: TurntableParameters
    motion: tuple[tuple[str, Motion], ...]
    sensors: Mapping[str, Sensor]
    sensor_types: Mapping[str, str]
    fusion: Mapping[str, FilterSpec]
    expect: tuple[Bound, ...]
    file: str
    folder: Path
    source: Mapping[str, Any] = field(repr=False)
    presets: Mapping[str, Any] = field(repr=False)
    plugins: tuple[Plugin, ...] = ()
    allow_outside: bool = False
    pointing: PointingParameters | None = None

    @property
    def truth_seed(self) -> int:
        """Seed of the random streams of the truth."""
        return self.frame.seed if self.frame.truth_seed is None else self.frame.truth_seed

    @property
    def random_truth(self) -> bool:
        """Whether another `truth_seed` is another truth."""
        return bool(self.turntable.floor.bands) or any(motion.draws for _, motion in self.motion)

    def floor(self, duration: float | None = None) -> FloorMotion:
        """Return how the floor of the run moves.

        Parameters
        ----------
        duration : float, optional
            Length of the realisation instead of the run's [s].
        """
        stream = partial(random_stream, self.truth_seed, "turntable", "floor")
        return self.turntable.floor.start(self.frame.duration if duration is None else duration, stream)

    @property
    def name(self) -> str:
        """Name of the scenario."""
        return self.frame.name

    @property
    def base_rate_hz(self) -> float:
        """Rate of the base clock [Hz]: 20 kHz, or what the fastest sensor asks for where the base is held and nothing
        else moves.
        """
        if self.turntable.mode != "fixed":
            return BASE_RATE_HZ
        return max((sensor.truth_rate for sensor in self.sensors.values()), default=BASE_RATE_HZ)

    @property
    def n_time(self) -> int:
        """Number of samples of the base clock."""
        return round(self.frame.duration * self.base_rate_hz)

    @property
    def lines(self) -> tuple[float, ...]:
        """Commanded line frequencies [Hz], ascending."""
        return tuple(sorted({line for _, motion in self.motion for line in motion.lines()}))

    @property
    def rate_unit(self) -> RateUnit:
        """Unit in which every rate of its run is shown."""
        return rate_unit(sensor.reading_std for sensor in self.sensors.values())

    @property
    def detail(self) -> tuple[float, float]:
        """From when to when the recording holds every sample [s]."""
        length = max(2.0, _FEWEST_DETAIL / self.base_rate_hz)
        start, stop = self.frame.detail or (self.frame.settle, self.frame.settle + length)
        return start, min(stop, self.frame.duration)

    def profile(self, ramp_in: float | None = None) -> MotionProfile:
        """Return the commanded motion from its start; ScenarioError if a recorded one cannot be read.

        Parameters
        ----------
        ramp_in : float, optional
            Length of the ramp-in instead of the scenario's [s].
        """
        duration = self.frame.duration
        terms = []
        for i, (kind, motion) in enumerate(self.motion):
            stream = random_stream(self.truth_seed, "motion", str(i), kind)
            terms.append(motion.start(duration, stream) if kind in MOTIONS else watched(kind, motion, duration, stream))
        return MotionProfile(terms, self.frame.ramp_in if ramp_in is None else ramp_in, self.base_rate_hz)

    @classmethod
    def from_dict(
        cls,
        mapping: Mapping[str, Any],
        folder: str | Path = ".",
        *,
        plugins: Iterable[str] = (),
        allow_outside: bool = False,
    ) -> Scenario:
        """Return the scenario that a mapping describes, validated as a file is.

        Parameters
        ----------
        mapping : mapping
            The keys of a scenario file; every dimensional value is a string with its unit.
        folder : str or Path, optional
            Where relative paths in it begin.
        plugins, allow_outside : iterable of str, bool, optional
            As for `load_scenario`.

        Raises
        ------
        ScenarioError
            With every finding at once: key and what was expected.
        """
        return _built(plain_tree(mapping), Path(folder), "", load_plugins(plugins), allow_outside=allow_outside)

    def with_(self, **changes: Any) -> Scenario:
        """Return the scenario with other values, validated as a whole.

        Parameters
        ----------
        **changes : Any
            What shall stand at a key, in units as in a file: ``duration="5 s"``, and by dotted keys
            ``**{"sensors.mems_gyro.range": "300 deg/s", "motion.0.sine.frequency": "4 Hz"}``. None removes the key; a
            mapping or a list replaces what stood there.

        Raises
        ------
        ScenarioError
            With every finding at once: key and what was expected; also for a key or an index that is not there.
        """
        tree, loaded = plain_tree(edited(self.source, changes, self.file)), Plugins(self.plugins)
        return _built(tree, self.folder, self.file, loaded, allow_outside=self.allow_outside)

    def with_seed(self, seed: int) -> Scenario:
        """Return the same scenario under another seed; quick, since nothing else is validated again.

        Parameters
        ----------
        seed : int
            At least 0.

        Raises
        ------
        ScenarioError
            If it is no such number.
        """
        frame = self.frame.model_copy(update=plain_tree({"seed": seed}).data)
        return replace(self, frame=frame, source={**self.source, "seed": frame.seed})

    def kept_in(self, folder: Path) -> Scenario:
        """Return the same scenario with the files that its motion reads copied to `folder`: it needs no others."""
        kept = tuple((kind, motion.kept_in(folder, f"motion_{i}")) for i, (kind, motion) in enumerate(self.motion))
        return replace(self, motion=kept)

    def resolved(self, folder: Path | None = None) -> dict[str, Any]:
        """Return the whole scenario as a mapping with SI units, which loads to the same scenario again.

        Parameters
        ----------
        folder : Path, optional
            Where it will stand: paths into it are relative.
        """
        return {
            **dump(self.frame),
            "turntable": dump(self.turntable),
            "motion": [{kind: dump(motion, folder)} for kind, motion in self.motion],
            "sensors": {
                name: {"type": self.sensor_types[name], **dump(sensor)} for name, sensor in self.sensors.items()
            },
            "fusion": resolved_fusion(self.fusion),
            **({} if self.pointing is None else {"pointing": dump(self.pointing)}),
            "expect": resolved_expectations(self.expect),
        }


def _built(tree: Tree, folder: Path, file: str, plugins: Plugins, *, allow_outside: bool) -> Scenario:
    from testbed.scenario.intake import Intake
    from testbed.scenario.loader import read_document

    return read_document(Intake(Document(file, tree=tree), folder.resolve(), plugins, allow_outside))
