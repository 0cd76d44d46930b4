"""What the pages take as given: files of the reader's own, names of the reader's own, and runs that are long."""

from __future__ import annotations

import re
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

import testbed
from tests.records import RATES, mixed, record

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping

ROOT = Path(__file__).parents[2]

# Commands that no test of pages types, and who types them; names and options of all are held by test_typed.py.
LONG = {
    "testbed regress --short": "half a minute: tests/regression plays it",
    "testbed regress --workers 2": "25 minutes: tests/campaigns/test_regression.py plays the short form",
    "testbed regress --plugin examples/own_filter.py --filter own_filter:Blend": "tests/campaigns/test_regression.py",
    "testbed reproduce paper1": "two minutes: tests/reproduce/paper1 plays it with few seeds",
    "testbed reproduce paper2": "two minutes: tests/reproduce/test_paper2.py plays it",
    "testbed run scenarios/paper2/following_5hz.yaml": "20 s, which compiling takes: tests/test_scenarios.py plays it",
    "testbed compensate audit paper3 unseen --out audit_paper": "tests/reproduce/test_paper3.py audits it",
    "testbed design examples/satellite_link_design.yaml --prove": "tests/design/test_design.py proves with two seeds",
}
# What needs a cluster is compiled only; test_blocks.py asks a scheduler of its own for the jobs where it can.
ON_A_CLUSTER = ("dask_jobqueue", "dask_kubernetes")

# What pages say of what their Python prints: the words that print it, and the sentence that then has to be there.
SAID: dict[str, dict[str, Callable[..., str]]] = {
    "data_sheet": {
        r"rms \[deg/s\] ([\d.]+)": lambda rms: f"The rms is {float(rms):.3f} deg/s",
        r"N \[deg/sqrt\(h\)\] \[\S+ +([\d.]+)": lambda N: f"The angle random walk is {float(N):.2f} deg/sqrt(h)",
    },
    "first_run": {
        r"^(\d\.\d+) (\d\.\d+)$": lambda one, other: (
            "The two numbers are the same" if abs(float(one) / float(other) - 1.0) < 1e-9 else f"{one} is not {other}"
        )
    },
    "link": {r"^0 \S+ (\w+)$": lambda part: f"Without latency the {part} dominates"},
}

_PAIR = {"mhd_ars": {"preset": "sx300"}, "mems_gyro": {"preset": "adis16505_filtered"}}


def whole(part: Mapping[str, Any]) -> dict[str, Any]:
    """Return a scenario around the part of one that a page shows."""
    if "floor" in part:
        part = {"turntable": part}
    elif "tracker" in part:
        part = {"pointing": part}
    scenario = {"name": "any", "duration": "12 s", "settle": "6 s", "sensors": _PAIR, "fusion": {"kalman": {}}}
    return {**scenario, "motion": [{"sine": {"frequency": "10 Hz", "rate": "1 deg/s"}}], **part}


def given(page: str, folder: Path) -> dict[str, Any]:
    """Lay out what a page takes as given, in its folder, and return the names that its Python takes as given."""
    for name in ("scenarios", "studies", "examples"):
        if page not in _SHORTER or name not in {path.split("/")[0] for path in _SHORTER[page]}:
            (folder / name).symlink_to(ROOT / name)
    for path, edits in _SHORTER.get(page, {}).items():
        (folder / path).parent.mkdir(parents=True, exist_ok=True)
        (folder / path).write_text(edited((ROOT / path).read_text("utf-8"), edits), encoding="utf-8")
    return _GIVEN.get(page, lambda _: {})(folder)


def edited(text: str, edits: Mapping[str, str]) -> str:
    """Return a file with other values of some of its keys, and without what it expects of the run that it was."""
    for key, value in edits.items():
        text, found = re.subn(rf"^( *){key}: .*$", rf"\g<1>{key}: {value}", text, flags=re.MULTILINE)
        assert found, key
    return re.sub(r"^expect:\n(?:  .*\n)*", "", text, flags=re.MULTILINE)


# Files of the repository that a page plays: shorter here, tests/test_scenarios.py plays each whole.
_SHORTER: dict[str, dict[str, dict[str, str]]] = {
    "first_run": {"scenarios/mixed_0p5hz_10hz.yaml": {"duration": "12 s"}},
    "commands": {"scenarios/mixed_0p5hz_10hz.yaml": {"duration": "0.4 s", "settle": "0.2 s"}},
    "identify": {"scenarios/identification.yaml": {"duration": "6 s", "settle": "1 s", "wideband": "{type: kalman}"}},
    "pointing": {"scenarios/pointing/satellite_link.yaml": {"duration": "2 s", "settle": "1 s"}},
    "paper1": {"scenarios/paper1/paper1_4hz.yaml": {"duration": "0.4 s", "settle": "0.2 s"}},
    "audit": {
        f"scenarios/fog/{name}.yaml": {"bandwidth": "0.01 Hz", "fog": "{preset: fog_paper3, sample_rate: 0.02 Hz}"}
        for name in ("two_rates_up_first", "two_rates_down_first", "thermal_cycle")
    },
    "campaigns": {
        "studies/error_vs_frequency.yaml": {
            "motion.0.sine.frequency": "{log: [5 Hz, 50 Hz], points: 2}",
            "seeds": "2",
        },
        "studies/error_vs_frequency_base.yaml": {"duration": "0.4 s", "settle": "0.2 s"},
    },
}


def _table(path: Path, columns: Mapping[str, Any]) -> None:
    np.savetxt(path, np.column_stack(list(columns.values())), "%.9g", ",", header=",".join(columns), comments="")


def _noise(n_time: int, seed: int) -> Any:
    return 0.01 * np.random.default_rng(seed).standard_normal(n_time)


def _logs(folder: Path) -> dict[str, Any]:
    t = np.arange(4000) / 1000.0
    _table(folder / "bench.csv", {"t [s]": t, "gx [deg/s]": _noise(4000, 1), "gy [deg/s]": _noise(4000, 2)})
    return {}


def _noise_and_allan(folder: Path) -> dict[str, Any]:
    import asammdf

    t, rate = np.arange(20_000) / 100.0, _noise(20_000, 3)
    _table(folder / "log.csv", {"t [s]": t, "rate [deg/s]": rate})
    counts = np.rint(_noise(20_000, 4) * 100).astype(int), np.rint(_noise(20_000, 5) * 100).astype(int)
    _table(folder / "counts.csv", {"us": np.arange(20_000) * 10_000, "gx": counts[0], "gy": counts[1]})
    np.savetxt(folder / "fog.csv", _noise(20_000, 6), header="fog", comments="")
    file = asammdf.MDF(version="4.10")
    file.append([asammdf.Signal(rate, t, name="w", unit="deg/s")])
    file.save(folder / "bench.mf4")
    (folder / "log.yaml").write_text("file: bench.mf4\nchannels:\n  w: {column: w, unit: deg/s}\n", encoding="utf-8")
    still = {"duration": "2 s", "settle": "0.5 s", "motion": [{"static": {}}], "turntable": {"mode": "fixed"}}
    testbed.run(whole(still), out=folder / "runs" / "static_allan", outputs=["netcdf"])
    return {"rate": np.radians(rate)}


def _identify(folder: Path) -> dict[str, Any]:
    t = np.arange(40_000) / 1000.0
    rate = np.random.default_rng(7).standard_normal(40_000)
    _table(folder / "log.csv", {"t [s]": t, "laser [deg/s]": rate, "gyro [deg/s]": 0.9 * rate + _noise(40_000, 8)})
    (folder / "log.yaml").write_text(
        "file: log.csv\nchannels:\n  reference: {column: laser}\n  mhd_ars: {column: gyro}\n", encoding="utf-8"
    )
    return {}


def _filters(_folder: Path) -> dict[str, Any]:
    _, z = record(mixed, 0.5, 1)
    stamps = {
        name: 1000 + np.round(np.arange(one.size) / RATES[name] * 1e9).astype(np.int64) for name, one in z.items()
    }
    return {"w": z["mhd_ars"], "g": z["mems_gyro"], "t_w": stamps["mhd_ars"], "t_g": stamps["mems_gyro"]}


def _indicator(_folder: Path) -> dict[str, Any]:
    _, z = record(mixed, 1.0, 1)
    return {"mhd_rate": z["mhd_ars"], "gyro_rate": z["mems_gyro"]}


def _ceemdan(_folder: Path) -> dict[str, Any]:
    return {"rate": np.sin(np.arange(4000) / 700.0) + _noise(4000, 9)}


def _replay(folder: Path) -> dict[str, Any]:
    k = np.arange(200)
    _table(
        folder / "bench.csv",
        {"t_us": 500 * k, "utc": k, "w1 [deg/s]": _noise(200, 10), "w2 [deg/s]": k, "encoder [deg]": k},
    )
    return {}


def _pointing(folder: Path) -> dict[str, Any]:
    (folder / "slower.yaml").write_text("tracker: {bandwidth: 5 Hz}\nmirror: {bandwidth: 500 Hz}\n", encoding="utf-8")
    return {}


def _cycle(seed: int, sign: float = 1.0) -> tuple[Any, Any, Any]:
    """Return hours, a gyro's rate [deg/h] and its temperature [degC] over a cycle, ten seconds apart."""
    hours = np.arange(8000) / 360.0
    temperature = 20.0 + sign * 30.0 * np.sin(2.0 * np.pi * hours / 20.0)
    return hours, 10.0 + 0.02 * temperature + 0.1 * _noise(hours.size, seed), temperature


def _audit(folder: Path) -> dict[str, Any]:
    hours, rate, temperature = _cycle(12)
    _table(folder / "log.csv", {"hours": hours, "rate [deg/h]": rate, "temperature [degC]": temperature})
    return {}


def _compensation_models(_folder: Path) -> dict[str, Any]:
    (_, up, warm), (_, down, cold), (_, rate, temperature) = _cycle(13), _cycle(14, -1.0), _cycle(15)
    rates = {"up_rate": up, "down_rate": down, "rate": rate}
    warmth = {"up_temperature": warm, "down_temperature": cold, "temperature": temperature}
    return {name: np.radians(one) / 3600.0 for name, one in rates.items()} | {
        name: one + 273.15 for name, one in warmth.items()
    }


def _campaigns(folder: Path) -> dict[str, Any]:
    (folder / "error_vs_frequency_base.yaml").symlink_to(ROOT / "studies" / "error_vs_frequency_base.yaml")
    return {}


_GIVEN: dict[str, Callable[[Path], dict[str, Any]]] = {
    "campaigns": _campaigns,
    "logs": _logs,
    "noise_and_allan": _noise_and_allan,
    "identify": _identify,
    "filters": _filters,
    "frequency_indicator": _indicator,
    "ceemdan": _ceemdan,
    "replay": _replay,
    "pointing": _pointing,
    "audit": _audit,
    "compensation_models": _compensation_models,
}
