"""Instruments: what each sensor would indicate, with its noise, its range and its word length."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, cast

from testbed.parts import lay_over, merge, preset, preset_names, resolve

if TYPE_CHECKING:
    from collections.abc import Mapping

    from testbed.sensors.base import Sensor

SENSORS = {
    "fog": "testbed.sensors.fog:Fog",
    "mems_gyro": "testbed.sensors.mems_gyro:MemsGyro",
    "mhd_ars": "testbed.sensors.mhd_ars:MhdArs",
}


def with_preset(name: str, entry: Mapping[str, Any]) -> dict[str, Any]:
    """Return the keys of a shipped instrument with those of its user laid over them.

    What the user says in other words, such as a `rate_noise_density` over an `angle_random_walk`, is said once.

    Parameters
    ----------
    name : str
        Of the preset.
    entry : mapping
        The user's keys.

    Raises
    ------
    UnknownNameError
        If there is no such preset.
    """
    base = preset(__name__, name)
    kind = entry.get("type", base["type"])
    # What else may stand there is found where the whole entry is read.
    if isinstance(kind, str) and kind in SENSORS:
        base = lay_over(base, entry, resolve("sensor", kind, SENSORS).ways())
    return merge(base, entry)


def load_preset(name: str) -> Sensor:
    """Return a shipped instrument by its name, such as ``sx300``.

    Parameters
    ----------
    name : str
        Name of a preset in ``testbed/sensors/presets``.

    Returns
    -------
    Sensor
        Of the type that the preset names.

    Raises
    ------
    UnknownNameError
        If there is no such preset; the message gives the nearest name and the known ones.

    Examples
    --------
    What an MHD sensor indicates of a true rate: little at 0.1 Hz, all of it at 100 Hz.

    >>> abs(load_preset("sx300").response([0.1, 100.0])).round(2)
    array([0.04, 1.01])
    """
    content = preset(__name__, name)
    values = {key: value for key, value in content.items() if key not in ("type", "belief")}
    model = resolve("sensor", content["type"], SENSORS)
    return cast("Sensor", model.model_validate(values, context={"border": True}))


def list_sensors() -> list[str]:
    """Return the types of sensor that a scenario may have.

    Examples
    --------
    >>> "mhd_ars" in list_sensors()
    True
    """
    return sorted(SENSORS)


def list_presets() -> list[str]:
    """Return the names of the shipped instruments, as `load_preset` takes them.

    Examples
    --------
    >>> "sx300" in list_presets()
    True
    """
    return preset_names(__name__)
