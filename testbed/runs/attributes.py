"""What run.nc says of each signal, after the CF conventions: unit, long name, standard name."""

from __future__ import annotations

from typing import TYPE_CHECKING

from testbed.fusion.base import diagnostic_unit
from testbed.runs.block import POINTING_SIGNALS

if TYPE_CHECKING:
    from collections.abc import Mapping

CONVENTIONS = "CF-1.12"
_UNITS = {"rate": "rad/s", "std": "rad/s", "angle": "rad", "time": "s", "temperature": "K"} | dict.fromkeys(
    POINTING_SIGNALS, "rad"
)
# By group and name; {} is the sensor or filter. Of all these only the time has a CF standard name.
_LONG_NAMES = {
    ("commanded", "rate"): "commanded rate of the table",
    ("truth", "rate"): "true inertial rate about the nominal axis",
    ("truth", "angle"): "true angle of the table about its axis",
    ("sensors", "rate"): "rate read by {}",
    ("sensors", "temperature"): "temperature read inside {}",
    ("fusion", "rate"): "rate estimated by {}",
    ("fusion", "std"): "standard deviation that {} claims for its rate",
    ("pointing", "residual"): "pointing error with {} fed forward",
    ("pointing", "knowledge"): "error of the angle that {} and the tracker know",
    ("pointing", "tracker_only"): "pointing error by the tracker alone",
    ("pointing", "mirror"): "deflection of the mirror with {} fed forward",
}


def attributes(group: str, name: str) -> dict[str, str]:
    """Return the attributes of a signal.

    Parameters
    ----------
    group, name : str
        Such as ``fusion/kalman`` and ``rate``.

    Examples
    --------
    >>> attributes("sensors/mems_gyro", "rate")["long_name"]
    'rate read by mems_gyro'
    >>> attributes("truth", "time")
    {'units': 's', 'long_name': 'time since the start of the run', 'standard_name': 'time', 'axis': 'T'}
    """
    if name == "time":
        # Without "since" in the unit it stays a number for every reader.
        return {
            "units": _UNITS["time"],
            "long_name": "time since the start of the run",
            "standard_name": "time",
            "axis": "T",
        }
    found = {"units": unit_of(group, name), "long_name": _long_name(group, name)}
    if group.startswith("sensors/"):
        found["comment"] = "NaN where the reading is lost"
    if group.startswith("fusion/") and name == "rate":
        found["ancillary_variables"] = "std"
    return found


def provenance(scenario: str, seed: int | None, versions: Mapping[str, str]) -> dict[str, str | int]:
    """Return the global attributes of a run.

    Parameters
    ----------
    scenario : str
        Its name.
    seed : int, optional
        Of its random streams; None of a recording, which has none.
    versions : mapping of str to str
        Of everything that the result depends on.
    """
    return {
        "Conventions": CONVENTIONS,
        "title": scenario,
        "source": f"testbed {versions['testbed']}, {'recording' if seed is None else 'simulation'}",
        "scenario": scenario,
        **({} if seed is None else {"seed": seed}),
        # A name of CF has no hyphen.
        **{f"{name.replace('-', '_')}_version": version for name, version in versions.items()},
    }


def unit_of(group: str, name: str) -> str:
    """Return the SI unit of a signal by its group and name, as UDUNITS writes it."""
    if name in _UNITS:
        return _UNITS[name]
    return diagnostic_unit(name) if group.startswith("fusion/") else _UNITS["rate"]


def is_precise(name: str) -> bool:
    """Return whether a signal is kept in double precision: rates and angles, but no diagnostics of a filter."""
    return name in _UNITS or is_sensor_truth(name)


def is_sensor_truth(name: str) -> bool:
    """Return whether a signal is what a sensor's axis feels, named ``<sensor>_rate``, or its thermal bias,
    ``<sensor>_drift``.
    """
    return name.endswith(("_rate", "_drift")) and name != "Q_rate"


def _long_name(group: str, name: str) -> str:
    kind, _, part = group.partition("/")
    if (kind, name) in _LONG_NAMES:
        return _LONG_NAMES[kind, name].format(part)
    if kind == "truth":
        sensor, _, what = name.rpartition("_")
        return f"true inertial rate about the axis of {sensor}" if what == "rate" else f"true thermal bias of {sensor}"
    return f"{name.replace('_', ' ')} of {part}"
