"""The metrics of a run, typed: what terminal, report, notebook and metrics.json share."""

from __future__ import annotations

import json
from collections.abc import Mapping
from typing import TYPE_CHECKING, Any, ClassVar

import numpy as np
from pydantic import AliasChoices, BaseModel, ConfigDict, Field, ValidationError

from testbed.errors import Problem, ScenarioError
from testbed.units import RateUnit

if TYPE_CHECKING:
    from collections.abc import Iterator
    from pathlib import Path

    from testbed.signals import FloatArray


class Entry(BaseModel, Mapping[str, Any]):
    """A part of the metrics, by attribute and by key.

    As a mapping it holds what metrics.json holds; a declared attribute that is not there is None or empty.
    """

    model_config = ConfigDict(extra="allow", frozen=True)

    def __getitem__(self, key: str) -> Any:
        if key not in self.model_fields_set:
            raise KeyError(key)
        return getattr(self, key)

    def __iter__(self) -> Iterator[str]:  # type: ignore[override] # pydantic's own yields pairs
        return (key for key in (*type(self).model_fields, *(self.model_extra or ())) if key in self.model_fields_set)

    def __len__(self) -> int:
        return len(self.model_fields_set)

    def __eq__(self, other: object) -> bool:
        return Mapping.__eq__(self, other)

    __hash__: ClassVar[None] = None  # type: ignore[assignment] # as of every mapping

    def to_dict(self) -> dict[str, Any]:
        """Return the plain mapping that metrics.json holds."""
        return self.model_dump(exclude_unset=True)


class LineMetrics(Entry):
    """What became of one commanded line [Hz]: gain [-] and phase [deg] of estimate over truth, each with half the width
    of its 95 % interval, and errors [deg/s].
    """

    frequency_hz: float
    gain: float | None = None
    gain_ci95: float | None = None
    phase_deg: float | None = None
    phase_ci95_deg: float | None = None
    error_deg_s: float | None = None
    optimum_deg_s: float | None = None


class ConsistencyMetrics(Entry):
    """How a filter's claims hold [-]: normalised error squared, per sensor (further keys) innovations and their
    whiteness, and the verdict.
    """

    nees: float | None = None
    verdict: str | None = None


class SourceMetrics(Entry):
    """Errors of one sensor or filter [deg/s]; None where undefined. `missing` counts lost readings, `belief` says where
    a filter's is from, `start` what it knew of its start, `gated` how many readings its front part struck out, by
    sensor, `caution` where it does not hold. Of a recording without reference `mean_deg_s` and `spread_deg_s` are what
    is read or estimated.
    """

    belief: str | None = None
    start: str | None = None
    gated: dict[str, int] | None = None
    caution: str | None = None
    rmse_deg_s: float | None = None
    rmse_aligned_deg_s: float | None = None
    peak_error_deg_s: float | None = None
    lines: list[LineMetrics] | None = None
    missing: int | None = None
    mean_std_deg_s: float | None = None
    inside_2_std: float | None = None
    mean_deg_s: float | None = None
    spread_deg_s: float | None = None
    floor_rmse_deg_s: float | None = None
    prior_floor_rmse_deg_s: float | None = None
    optimum_rmse_deg_s: float | None = None
    optimum_settled_deg_s: float | None = None
    consistency: ConsistencyMetrics | None = None

    def over(self, bound: float | None) -> float | None:
        """Return the RMSE over a bound [-], None where either is undefined or the bound is zero.

        Parameters
        ----------
        bound : float or None
            Such as `floor_rmse_deg_s` [deg/s].
        """
        return self.rmse_deg_s / bound if self.rmse_deg_s is not None and bound else None


class TurntableMetrics(Entry):
    """How the table was integrated [s], followed its command [deg/s], used its motor [N m] and swings [Hz]."""

    mode: str | None = None
    engine: str | None = None
    step_s: float | None = None
    step_error: float | None = None
    step_factor: float | None = None
    command_to_encoder_rms_deg_s: float | None = None
    command_to_encoder_lines: list[LineMetrics] = []
    command_to_inertial_rms_deg_s: float | None = None
    command_to_inertial_lines: list[LineMetrics] = []
    peak_torque_nm: float | None = None
    required_torque_nm: float | None = None
    torque_limit_nm: float | None = None
    torque_margin: float | None = None
    truth_noise_deg_s: float | None = None
    modes_hz: list[float] = []
    modes_damping: list[float] = []


class FloorDensity(Entry):
    """Two-sided root density of the noise floor [deg/s/sqrt(Hz)] against frequency [Hz]."""

    frequency_hz: list[float]
    density: list[float]


class Band(Entry):
    """What each sensor, and all together, leave in the best combination between two frequencies [deg/s]."""

    low_hz: float
    high_hz: float
    floor_deg_s: float
    sensors_deg_s: dict[str, float]


class Budget(Entry):
    """Crossovers [Hz], bands, and root densities of the sensors' noise [deg/s/sqrt(Hz)] against frequency [Hz]."""

    crossovers_hz: list[float]
    bands: list[Band]
    frequency_hz: list[float]
    densities: dict[str, list[float | None]]

    def combined(self) -> FloatArray:
        """Return the root density of the best combination [deg/s/sqrt(Hz)], shape (n_freq,)."""
        information = np.zeros(len(self.frequency_hz))
        for density in self.densities.values():
            information += [0.0 if one is None else one**-2 for one in density]
        with np.errstate(divide="ignore"):
            return np.asarray(information**-0.5)


class Response(Entry):
    """Gain [-] and phase [deg] at the first of the frequencies that stand beside it: up to half its sample rate."""

    gain: list[float]
    phase_deg: list[float]


class BelievedResponses(Entry):
    """What some filters were told of the sensors, where that is not what they are."""

    filters: list[str]
    sensors: dict[str, Response]


class Responses(Entry):
    """Responses of the sensors as they are built against frequency [Hz], and as filters believe them to be."""

    frequency_hz: list[float]
    sensors: dict[str, Response]
    beliefs: list[BelievedResponses] = []


class PointingBudget(Entry):
    """Who makes the residual: shares of its variance [-], which add up to 1; inside the knowledge by sensor and term.
    Rms of each part, of all, and of all with one of them halved [urad]; `quadrature_urad` is what it is not.
    """

    shares: dict[str, float]
    knowledge: dict[str, float | dict[str, float]]
    rms_urad: dict[str, float]
    knowledge_rms_urad: dict[str, float]
    total_urad: float
    quadrature_urad: float
    dominant: str
    halved_urad: dict[str, float]


class PointingMetrics(Entry):
    """What is left of the line of sight behind one filter [urad]; errors over windows by the window's length [s]."""

    residual_rms_urad: float | None = None
    knowledge_rms_urad: float | None = None
    tracker_only_rms_urad: float | None = None
    ape_urad: float | None = None
    peak_urad: float | None = None
    rpe_urad: dict[str, float | None] = {}
    mpe_urad: dict[str, float | None] = {}
    pde_urad: dict[str, float | None] = {}
    pre_urad: dict[str, float | None] = {}
    delay_us: float | None = None
    levels: list[dict[str, float | None]] = []
    bands: list[dict[str, float | None]] = []
    curves: dict[str, list[float | None]] = {}
    budget: PointingBudget | None = None
    saturated: dict[str, float] = {}
    gains: dict[str, float] = {}
    margins: dict[str, float | None] = {}
    link: dict[str, float | None] | None = None


class ProfileMetrics(Entry):
    """The fluid of a channel at some instants [s]: rate of the wall, and of the fluid relative to it at every height
    [m], per radius [deg/s].
    """

    height_m: list[float]
    time_s: list[float]
    wall_deg_s: list[float]
    slip_deg_s: list[list[float]]


class Expectation(Entry):
    """A bound of the scenario on a sensor or filter, the value that was reached and whether it was met."""

    subject: str = Field(validation_alias=AliasChoices("subject", "filter"))
    metric: str
    bound: str | float
    value: int | float | None = None
    met: bool


class PartSetup(Entry):
    """A part of the scenario: the preset that it takes, and each `key` that is written beside it with its value `here`
    and in the `preset`.
    """

    part: str
    preset: str | None = None
    differs: list[dict[str, str | None]] = []


class ChannelMetrics(Entry):
    """A channel of a replayed recording: where it stands, how it was read, its clock [Hz, s], how many of its samples
    were lost, and how many were `dropped` since the filters had no use for them.
    """

    column: str
    file: str
    unit: str | None = None
    rate_hz: float
    start_s: float
    n_time: int
    missing: int = 0
    dropped: int = 0
    notes: list[str] = []


class ReplayMetrics(Entry):
    """What was replayed: the recording, its channels, whether it has a reference and which, and how its clocks go
    together.
    """

    log: str
    format: str
    reference: bool
    clock: str
    channels: dict[str, ChannelMetrics]
    reference_channel: ChannelMetrics | None = None
    start_ns: int | None = None
    notes: list[str] = []


class CrossBandMetrics(Entry):
    """What two sensors share between two frequencies [Hz]: coherence [-], and the second over the first, over what is
    believed of that: gain [-] and phase [deg], None where they share too little.
    """

    low_hz: float
    high_hz: float
    coherence: float
    gain_over_belief: float | None = None
    phase_off_belief_deg: float | None = None


class CrossMetrics(Entry):
    """Two sensors of a recording against each other, by bands."""

    first: str
    second: str
    bands: list[CrossBandMetrics] = []


class FindingMetrics(Entry):
    """What the verdict found of a sensor: the value with its interval, what to do, and whether it was put right."""

    kind: str
    sensor: str
    value: float | None = None
    lower: float | None = None
    upper: float | None = None
    unit: str = ""
    remedy: str = ""
    fixed: bool = False


class RunMetrics(Entry):
    """The metrics of a run: of every sensor and filter by its name, of the turntable, and what was expected of them.

    Of a replayed recording `replay` says what it was, `findings` and `undecided` what the verdict says of it, `cross`
    what its sensors say of each other; `scenario` is its name, and there is no `seed`. `rate_unit` is that in which the
    rates are shown; here they are in deg/s.

    Examples
    --------
    >>> source = SourceMetrics(rmse_deg_s=0.01)
    >>> metrics = RunMetrics(scenario="a", seed=1, duration_s=2.0, settle_s=1.0, sensors={}, fusion={"kalman": source})
    >>> metrics.fusion["kalman"].rmse_deg_s == metrics["fusion"]["kalman"]["rmse_deg_s"] == 0.01
    True
    """

    scenario: str
    seed: int | None
    duration_s: float = Field(gt=0)
    settle_s: float = Field(ge=0)
    rate_unit: RateUnit = "deg/s"
    bandwidth_hz: float | None = None
    turntable: TurntableMetrics | None = None
    sensors: dict[str, SourceMetrics]
    fusion: dict[str, SourceMetrics]
    bounds_reason: str | None = None
    floor_density: FloorDensity | None = None
    budget: Budget | None = None
    responses: Responses | None = None
    pointing: dict[str, PointingMetrics] = {}
    profiles: dict[str, ProfileMetrics] = {}
    expectations: list[Expectation] = []
    replay: ReplayMetrics | None = None
    findings: list[FindingMetrics] = []
    undecided: list[str] = []
    cross: list[CrossMetrics] = []
    versions: dict[str, Any] = {}
    setup: list[PartSetup] = []
    plugins: list[dict[str, Any]] = []

    @property
    def sources(self) -> dict[str, SourceMetrics]:
        """Every sensor and filter by its name."""
        return {**self.sensors, **self.fusion}

    @property
    def line_freq_hz(self) -> list[float]:
        """Frequencies of the commanded lines [Hz], increasing."""
        sources = [*self.sensors.values(), *self.fusion.values()]
        return sorted({line.frequency_hz for source in sources for line in source.lines or []})


def read_metrics(path: Path) -> RunMetrics:
    """Return the checked content of ``metrics.json``.

    Raises
    ------
    ScenarioError
        If the file cannot be read, is no JSON, or lacks something; every finding with its key.
    """
    text = read_text(path, "the metrics of a run (JSON)")
    try:
        return RunMetrics.model_validate(json.loads(text))
    except json.JSONDecodeError as error:
        problem = Problem(f"expected JSON, got {error.msg}", file=str(path), line=error.lineno)
        raise ScenarioError([problem]) from error
    except ValidationError as error:
        problems = [
            Problem(f"{found['msg']}, got {found['input']!r:.80}", ".".join(map(str, found["loc"])), str(path))
            for found in error.errors()
        ]
        raise ScenarioError(problems) from error


def read_text(path: Path, content: str) -> str:
    """Return the text of `path`; `content` says in the error message what it should hold."""
    try:
        return path.read_text(encoding="utf-8")
    except (OSError, UnicodeDecodeError) as error:
        raise ScenarioError([Problem(f"expected {content}, got {error}", file=str(path))]) from error
