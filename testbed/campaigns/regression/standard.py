"""The cases of the standard campaign and of its short form."""

from __future__ import annotations

import shlex
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

from pydantic import ValidationError

from testbed.campaigns.study import Study, Variation
from testbed.fusion import FILTERS
from testbed.parts import resolve
from testbed.scenario.edits import edited
from testbed.scenario.model import Scenario

if TYPE_CHECKING:
    from collections.abc import Iterable, Mapping, Sequence

AXES = ("signal", "begin", "fault", "calibration", "preset")
STANDARD, SHORT = "standard", "short"
_SEEDS = {STANDARD: 10, SHORT: 3}
_PAIR = "sx300, adis16505_filtered"


def _line(freq: str) -> list[dict[str, Any]]:
    return [{"sine": {"frequency": freq, "rate": "1 deg/s"}}]


def _jitter() -> list[dict[str, Any]]:
    lines = {"0.5 Hz": "1 deg/s", "33 Hz": "0.1 deg/s", "66 Hz": "0.05 deg/s", "133 Hz": "0.05 deg/s"}
    return [{"sine": {"frequency": freq, "rate": rate}} for freq, rate in lines.items()]


_MIXED: list[dict[str, Any]] = [
    {"sine": {"frequency": "0.5 Hz", "angle": "5.555 mrad"}},
    {"sine": {"frequency": "10 Hz", "angle": "50 urad"}},
]
_LINES = ("0.1 Hz", "0.5 Hz", "2 Hz", "4 Hz", "10 Hz", "25 Hz", "100 Hz", "500 Hz")
# A line of sight that the estimate holds, where the motion is one that shakes it; the beacon fades once.
_SIGHT = {
    "tracker": {"bandwidth": "10 Hz"},
    "mirror": {"bandwidth": "1 kHz", "latency": "500 us", "lead": True},
    "windows": ["100 ms"],
}
_FADED = {**_SIGHT, "tracker": {"bandwidth": "10 Hz", "fades": [{"at": "4 s", "length": "1 s"}]}}
_PLATFORM = {"spectrum": "olympus", "low": "1 Hz", "high": "150 Hz"}
_SIGNALS: dict[str, dict[str, Any]] = {
    **{freq: {"motion": _line(freq)} for freq in _LINES},
    # A period at the least.
    "0.1 Hz": {"motion": _line("0.1 Hz"), "duration": "15 s", "settle": "5 s"},
    "mixed": {"motion": _MIXED},
    "100 Hz": {"motion": _line("100 Hz"), "pointing": _SIGHT},
    "jitter": {"motion": _jitter(), "pointing": _SIGHT},
    "platform": {"motion": [{"platform_psd": _PLATFORM}], "pointing": _FADED},
    "chirp": {
        "motion": [{"chirp": {"start_frequency": "0.5 Hz", "stop_frequency": "25 Hz", "rate": "1 deg/s"}}],
    },
    "still": {"motion": [{"static": {}}]},
    "offset": {"motion": [{"constant": {"rate": "6 deg/s"}}, *_MIXED]},
}
_BEGINS: dict[str, dict[str, Any]] = {"rest": {}, "in motion": {"fusion_from": "1.5 s"}}
_FAULTS = ("lost", "stuck", "rail")
_CALIBRATION: dict[str, dict[str, Any]] = {
    "exact": {},
    "mhd_ars gain 0.5 %": {"sensors.mhd_ars.scale_factor_error": "0.5 %"},
    "mems_gyro gain 0.5 %": {"sensors.mems_gyro.scale_factor_error": "0.5 %"},
    "mhd_ars 0.5 ms late": {"sensors.mhd_ars.delay": "0.5 ms"},
}
_PRESETS: dict[str, tuple[dict[str, Any], dict[str, Any], dict[str, Any]]] = {
    _PAIR: ({"preset": "sx300"}, {"preset": "adis16505_filtered"}, {}),
    f"{_PAIR}, exact belief": ({"preset": "sx300"}, {"preset": "adis16505_filtered"}, {"belief": "exact"}),
    "sx300, adis16505": ({"preset": "sx300"}, {"preset": "adis16505"}, {}),
    "mhd03, crs03": ({"preset": "mhd03"}, {"preset": "crs03"}, {}),
    "sx300, mpu6050, exact belief": ({"preset": "sx300"}, {"preset": "mpu6050"}, {"belief": "exact"}),
}


@dataclass(frozen=True)
class Setting:
    """One case by the names of what it is made of; what is not named is the usual."""

    signal: str = "mixed"
    begin: str = "rest"
    fault: str = "none"
    calibration: str = "exact"
    preset: str = _PAIR

    @property
    def values(self) -> dict[str, str]:
        """The case by axis."""
        return {axis: getattr(self, axis) for axis in AXES}


def _settings() -> list[Setting]:
    """Return the cases: one thing differs from the usual, or two where a start needs its signal."""
    signals = [Setting(signal) for signal in _SIGNALS if signal != "offset"]
    starts = [Setting(signal, "in motion") for signal in ("mixed", "10 Hz", "offset")]
    faults = [Setting(fault=f"{sensor} {kind}") for sensor in ("mhd_ars", "mems_gyro") for kind in _FAULTS]
    calibration = [Setting(calibration=one) for one in _CALIBRATION if one != "exact"]
    return [*signals, *starts, *faults, *calibration, *(Setting(preset=one) for one in _PRESETS if one != _PAIR)]


def _short_settings() -> list[Setting]:
    lines = [Setting(f"{freq} Hz") for freq in ("0.5", "2", "4", "10", "25", "100")]
    return [
        *lines,
        Setting(begin="in motion"),
        Setting(fault="mhd_ars stuck"),
        Setting(calibration="mhd_ars gain 0.5 %"),
    ]


@dataclass(frozen=True)
class Contenders:
    """Filters that are played, by name: their entries in a scenario, and the plug-ins that they come from."""

    fusion: Mapping[str, Mapping[str, Any]]
    plugins: Sequence[str] = field(default=())

    @property
    def words(self) -> list[str]:
        """What names them on the command line."""
        given = [one["type"] for one in self.fusion.values() if "type" in one]
        return [*(f"--plugin={one}" for one in self.plugins), *(f"--filter={one}" for one in given)]


def shipped() -> Contenders:
    """Return all filters of the house that need no word, each as it is without one."""
    return Contenders({name: {} for name in FILTERS if _speaks_for_itself(name)})


def _speaks_for_itself(name: str) -> bool:
    try:
        resolve("filter", name, FILTERS).Parameters()
    except ValidationError:
        return False
    return True


def published(filters: Iterable[str], plugins: Sequence[str]) -> Contenders:
    """Return filters of plug-ins.

    Parameters
    ----------
    filters : iterable of str
        As ``module:Class``, or the names of shipped ones.
    plugins : sequence of str
        Modules, dotted or as paths.
    """
    return Contenders({one.rsplit(":", maxsplit=1)[-1]: {"type": one} for one in filters}, plugins)


def case_count(*, short: bool = False) -> int:
    """Return how many cases the standard campaign has.

    Parameters
    ----------
    short : bool, optional
        Its short form.
    """
    return len(_settings_of(short=short))


def _settings_of(*, short: bool) -> list[Setting]:
    return _short_settings() if short else _settings()


def standard_study(entry: Contenders, *, short: bool = False, only: int | None = None) -> Study:
    """Return the standard campaign of some filters.

    Parameters
    ----------
    entry : Contenders
        Which.
    short : bool, optional
        Its short form.
    only : int, optional
        The one case that is wanted of it, by its number: building all takes seconds.

    Raises
    ------
    ScenarioError
        If a filter refuses a case.
    """
    name = SHORT if short else STANDARD
    cases = tuple(
        Variation(i, one.values, _scenario(one, entry, short=short))
        for i, one in enumerate(_settings_of(short=short))
        if only in (None, i)
    )
    text = "every filter on the same signals, starts, faults, calibration errors and instruments"
    words = ["testbed", "regress", *(["--short"] if short else []), *entry.words]
    seeds = tuple(range(1, _SEEDS[name] + 1))
    return Study(f"regress_{name}", text, "", AXES, cases, seeds, command=shlex.join(words))


def _scenario(setting: Setting, entry: Contenders, *, short: bool) -> Scenario:
    fast, slow, belief = _PRESETS[setting.preset]
    duration, settle = (2, 1) if short else (6, 3)
    mapping: dict[str, Any] = {
        "name": "standard",
        "seed": 1,
        "truth_seed": 1,
        "duration": f"{duration} s",
        "settle": f"{settle} s",
        "turntable": {"engine": "auto"},
        "sensors": {"mhd_ars": fast, "mems_gyro": slow},
        "fusion": {name: {**belief, **one} for name, one in entry.fusion.items()},
        **_SIGNALS[setting.signal],
    }
    changes = {**_BEGINS[setting.begin], **_CALIBRATION[setting.calibration]}
    if short and changes.get("fusion_from"):
        changes["fusion_from"] = "0.5 s"
    if setting.fault != "none":
        sensor, kind = setting.fault.split()
        at, length = 1.1 * settle, settle / 3
        changes[f"sensors.{sensor}.faults"] = [{"kind": kind, "at": f"{at:.3g} s", "length": f"{length:.3g} s"}]
    return Scenario.from_dict(edited(mapping, changes, ""), plugins=entry.plugins)
