"""Paper 3's Table 2 on the simulated fibre-optic gyro: by the paper's protocol and by an honest one, each audited.

Wang, Cui, Cao, Micromachines 2023, 14, 1712, doi 10.3390/mi14091712. The paper trains on the record that it corrects.
The honest protocol trains on other thermal cycles, freezes the model and corrects a cycle that it has not seen.
"""

from __future__ import annotations

import time
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Any, cast

import numpy as np

from testbed.compensation import paper3, rivals
from testbed.compensation.fading import choose_ratio, fading_memory
from testbed.compensation.features import Features
from testbed.compensation.model_only import train
from testbed.compensation.record import GyroRecord
from testbed.drift.leak import find_leaks
from testbed.drift.page import Audited, write_audit
from testbed.drift.quality import smoothed
from testbed.drift.records import ThermalRecord
from testbed.drift.summary import audit_summary
from testbed.drift.table_2 import ORIGINAL, PIPELINE
from testbed.models.temperature import TemperatureProfile
from testbed.models.turntable.earth import SPEED
from testbed.reproduce.paper3.decompositions import Decompositions
from testbed.reproduce.paper3.figures import Decomposed, write_figures_10_to_14
from testbed.reproduce.paper3.page import page
from testbed.reproduce.paper3.table import medians_csv, printed, seeds_csv, shown_rows
from testbed.runs.atomic import write_text
from testbed.sensors import load_preset
from testbed.sensors.stages import Surroundings

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator
    from pathlib import Path

    from testbed.compensation.model_only import DriftModel
    from testbed.sensors.fog import Fog
    from testbed.signals import FloatArray

    Compensate = Callable[[GyroRecord], FloatArray]

EARTH = SPEED * np.sin(np.pi / 4.0)  # rad/s, about the vertical at 45 degrees
_HOLD = {"hold": "2 h"}


def _ramp(to: str, rate: str = "0.1 K/min") -> dict[str, str]:
    return {"ramp": f"{to} degC", "rate": rate}


# Length [s] and steps: the programme of the paper; for training, the other way round, the paper's order at another
# pace, and both ways at two rates (scenarios/fog).
PROGRAMMES = {
    "paper": (85_200, [_HOLD, _ramp("60"), _ramp("-30")]),
    "down first": (91_200, [_HOLD, _ramp("-30"), _ramp("60")]),
    "two rates, up": (97_200, [_HOLD, _ramp("60", "0.15 K/min"), _ramp("-30"), _ramp("20", "0.15 K/min")]),
    "two rates, down": (97_200, [_HOLD, _ramp("-30", "0.15 K/min"), _ramp("60"), _ramp("20", "0.15 K/min")]),
    "up first": (75_800, [_HOLD, _ramp("60", "0.12 K/min"), {"hold": "1 h"}, _ramp("-30", "0.12 K/min")]),
}
# "Temperature" alone, as the paper has it, cannot describe a drift that depends on its slope: here it gets the slope
# too.
EQUATION_22 = "Kalman filter of equation (22)"
WITH_SLOPE = "the same with slope"
SLOPE = Features(degree=1, lags=())


@dataclass(frozen=True)
class DriftProtocol:
    """How much of the paper's protocol to run.

    Parameters
    ----------
    sample_rate_hz : float
        Of the readings [Hz]; 1 Hz is an assumption, the paper gives none.
    options : PaperOptions
        Of the paper's pipeline.
    """

    sample_rate_hz: float = 1.0
    options: paper3.PaperOptions = field(default_factory=paper3.PaperOptions)


@dataclass(frozen=True)
class Contender:
    """A row of the table.

    Parameters
    ----------
    name, trained_on : str
        What compensates, and what it has seen before.
    compensate : callable
        Takes a record, returns the compensated rate [rad/s].
    """

    name: str
    trained_on: str
    compensate: Compensate


def cycle(programme: str, seed: int, sample_rate_hz: float = 1.0, gyro: Fog | None = None) -> ThermalRecord:
    """Return a thermal cycle of a gyro on a base at rest.

    Parameters
    ----------
    programme : str
        One of `PROGRAMMES`.
    seed : int
        Of the noise.
    sample_rate_hz : float, optional
        Rate of the readings [Hz].
    gyro : Fog, optional
        The instrument; `fog_paper3` if not given.
    """
    duration, steps = PROGRAMMES[programme]
    profile = TemperatureProfile.model_validate({"start": "20 degC", "steps": steps}, context={"border": True})
    found = through(profile, round(duration * sample_rate_hz), seed, sample_rate_hz, gyro)
    return replace(found, name=f"{programme}, seed {seed}")


def through(
    profile: TemperatureProfile, n_time: int, seed: int, sample_rate_hz: float, gyro: Fog | None = None
) -> ThermalRecord:
    """Return what a gyro on a base at rest reads through a programme of temperatures.

    Parameters
    ----------
    profile : TemperatureProfile
        Around the gyro, which has rested in its start before.
    n_time : int
        Readings.
    seed : int
        Of the noise.
    sample_rate_hz : float
        Rate of the readings [Hz].
    gyro : Fog, optional
        As for `cycle`.
    """
    fog = (gyro or cast("Fog", load_preset("fog_paper3"))).model_copy(update={"sample_rate": sample_rate_hz})
    stage = fog.start(sample_rate_hz, seed, "fog")
    oven = Surroundings(temperature=profile.at(0, n_time, sample_rate_hz))
    rate = stage.process_in(np.full(n_time, EARTH), oven)
    return ThermalRecord(f"seed {seed}", GyroRecord(rate, stage.temperature, sample_rate_hz), stage.drift)


def cases(seed: int, protocol: DriftProtocol, decomposed: Decompositions) -> Iterator[Contender]:
    """Yield the rows of the table for one seed, each trained when it is its turn.

    Parameters
    ----------
    seed : int
        Of the noise; the training cycles have seeds of their own.
    protocol : DriftProtocol
        Its numbers.
    decomposed : Decompositions
        Modes by the protocol's options and this seed.
    """
    fs = protocol.sample_rate_hz
    one = [cycle("up first", 1000 + seed, fs).record]
    two = [*one, cycle("down first", 2000 + seed, fs).record]
    yield Contender(ORIGINAL, "-", lambda record: record.rate)
    yield Contender(EQUATION_22, "-", lambda record: fading_memory(record.rate, 0.583, choose_ratio(record.rate))[0])
    yield Contender("low-pass of 300 s", "-", lambda record: smoothed(record.rate, fs, 1.0 / 300.0))
    yield Contender("AKF [22]", "-", lambda record: rivals.akf22(record, seed=seed))
    yield Contender("OLMD-KPCA", "-", lambda record: rivals.olmd_kpca(record, seed=seed))
    yield Contender("CEEMDAN-LWT", "-", lambda record: rivals.ceemdan_lwt(record, modes=decomposed.of(record)))
    for name, options in (
        (PIPELINE, protocol.options),
        (WITH_SLOPE, replace(protocol.options, features=SLOPE)),
    ):
        yield Contender(name, "this record", _paper(options, seed, decomposed))
    for name, method, cycles in (
        ("polynomial", "polynomial", two),
        ("LSSVM", "lssvm", two),
        ("gradient", "gradient", one),
        ("gradient", "gradient", two),
    ):
        model = train(cycles, method=method)
        yield Contender(name, f"{len(cycles)} other cycle{'s' if len(cycles) > 1 else ''}", _applied(model))


def _paper(options: paper3.PaperOptions, seed: int, decomposed: Decompositions) -> Compensate:
    return lambda record: paper3.compensate(record, options, seed=seed, modes=decomposed.of(record)).rate


def _applied(model: DriftModel) -> Compensate:
    return lambda record: model.apply(record).rate


def report(seeds: int, out: Path, protocol: DriftProtocol | None = None) -> Iterator[str]:
    """Write table_2.csv, table_2_seeds.csv, paper3.html, figures 10 to 14 and the audits of the first seed, and yield
    the table line by line.

    Parameters
    ----------
    seeds : int
        Seeds 1 to this, of which each figure is the median [-].
    out : Path
        Folder to write to.
    protocol : DriftProtocol, optional
        The paper's record at 1 Hz, if not given.

    Yields
    ------
    str
        One line.
    """
    protocol = protocol or DriftProtocol()
    found: dict[tuple[str, str], list[dict[str, Any]]] = {}
    folders: dict[str, str] = {}
    first: dict[str, Audited] = {}
    for seed in range(1, seeds + 1):
        thermal = cycle("paper", seed, protocol.sample_rate_hz)
        decomposed = Decompositions(protocol.options, seed)
        for case in cases(seed, protocol, decomposed):
            audited, seconds = _audited(case, thermal, decomposed)
            found.setdefault((case.name, case.trained_on), []).append(
                {**audit_summary(audited.audit), "seconds": seconds}
            )
            yield (
                f"seed {seed}: {case.name}, trained on {case.trained_on}: "
                f"{'leak' if audited.audit.leaks else 'no leak found'}"
            )
            if seed == 1:
                folders[_title(case)] = f"audit_{case.name}_{case.trained_on}".translate(_PLAIN)
                first[_title(case)] = audited
                write_audit(audited, out / folders[_title(case)])
        if seed == 1:
            modes = Decomposed.of(decomposed.of(thermal.record), protocol.sample_rate_hz, protocol.options)
    write_text(out / "table_2.csv", medians_csv(found))
    write_text(out / "table_2_seeds.csv", seeds_csv(found))
    audits = {name: audited.audit for name, audited in first.items()}
    write_text(out / "paper3.html", page(shown_rows(found), audits, list(folders.values()), seeds))
    yield from printed(found, seeds)
    yield ""
    yield "figures of the first seed (SVG and PNG, the numbers in CSV)"
    yield from write_figures_10_to_14(modes, first, out)


def _title(case: Contender) -> str:
    return case.name if case.trained_on in ("-", "this record") else f"{case.name}, {case.trained_on}"


_PLAIN = str.maketrans({" ": "_", "'": None, "(": None, ")": None, ",": None, "-": None, "[": None, "]": None})


def _audited(case: Contender, thermal: ThermalRecord, decomposed: Decompositions) -> tuple[Audited, float]:
    """Return the audit, and how long the method took by itself [s]."""
    begin, before = time.perf_counter(), decomposed.saved
    plain = case.compensate(thermal.record)
    seconds = time.perf_counter() - begin + decomposed.saved - before
    found = find_leaks(case.compensate, thermal.record, plain, thermal.drift)
    return Audited(f"{case.name}, trained on {case.trained_on}", thermal, plain, found), seconds
