"""Kills, full disks and read-only folders, many times over; says what was not whole afterwards.

``python -m tests.crash.driver kill run=200,report=200 SEED FOLDER`` (or training, replayed, exported, identified,
swept), ``... disk 20 FOLDER``. Each action
runs in a fork of this process, which has the libraries loaded and no thread. Prints one JSON object: how many ended
how, and the faults; of kills by action.
"""

from __future__ import annotations

import collections
import json
import os
import random
import shutil
import signal
import subprocess
import sys
import time
import traceback
from contextlib import contextmanager
from pathlib import Path

import h5py
import numpy as np
from ruamel.yaml import YAML

import testbed
from testbed.campaigns.sweep import open_sweep, sweep
from testbed.chain import runner
from testbed.drift.records import Columns
from testbed.drift.session import read_model, train_model
from testbed.errors import RunError, ScenarioError
from testbed.fusion.belief_file import read_belief
from testbed.identification.belief_text import belief_text
from testbed.identification.session import identify_sensors
from testbed.logs import read_log
from testbed.playback.export import export
from testbed.playback.replay import replay
from testbed.report import write_report
from testbed.runs.atomic import write_bytes
from testbed.runs.folder import failing_as_run_error
from testbed.runs.manifest import read_manifest, strangers
from tests.scenes import short

PLENTY = 1 << 28
_FILLED_LATER = """
from testbed.cli import main
from testbed.chain import runner
runner.require_space = lambda *_: None
main()
"""


# A recording of a reference and of two sensors, and how long it is not judged.
SENSORS, SETTLES, FORMATS = ("mhd_ars", "mems_gyro"), (0.25, 0.5), ("csv", "hdf5")
RECORDED = {"channels": {n: {"column": n, "unit": "rad/s", "time": {"rate": "1 kHz"}} for n in (*SENSORS, "reference")}}
BASE = """\
name: base
duration: 0.1 s
turntable: {mode: ideal}
motion: [{sine: {frequency: 50 Hz, rate: 1 deg/s}}]
sensors: {mems_gyro: {preset: adis16505}}
fusion: {kalman: {}}
"""
STUDY = "{name: study, base: base.yaml, vary: {sensors.mems_gyro.noise: [on, off]}, seeds: 8}"


def _write_recording(path):
    rng = np.random.default_rng(5)
    rate = 0.02 * rng.standard_normal(8000)
    rows = rate[:, None] * np.array([1.0, 0.98, 1.02]) + 1e-4 * rng.standard_normal((rate.size, 3)) * [0.0, 1.0, 1.0]
    lines = [",".join(f"{one:.9f}" for one in row) for row in rows]
    path.write_text("\n".join([",".join(("reference", *SENSORS)), *lines]) + "\n")


class Scene:
    """A folder with what the actions work on, and what must hold in it after each."""

    def __init__(self, folder, make=True):
        self.folder, self.place, self.model = folder, folder / "run", folder / "model.json"
        if make:
            folder.mkdir(parents=True, exist_ok=True)
            short(folder)
            for name, sign in (("up", 1.0), ("down", -1.0)):
                heat = 300.0 + sign * 10.0 * np.sin(np.arange(3000) / 400.0)
                rate = 0.1 * (heat - 300.0) + np.random.default_rng(3).standard_normal(heat.size)
                rows = [f"{w:.6f},{k:.6f}" for w, k in zip(rate, heat, strict=True)]
                (folder / f"{name}.csv").write_text("\n".join(["rate,temperature", *rows]) + "\n")
            _write_recording(folder / "log.csv")
            (folder / "base.yaml").write_text(BASE)
            (folder / "study.yaml").write_text(STUDY)

    def run(self, number):
        runner.run(testbed.load_scenario(self.folder / "short.yaml"), out=self.place, seed=number)

    def report(self, _number):
        with failing_as_run_error("report"):
            write_report(self.place)

    def training(self, number):
        source = self.folder / ("up.csv" if number % 2 else "down.csv")
        columns = Columns(temperature_unit="K", sample_rate="0.1 Hz")
        train_model([source], columns, "gradient", self.model, lambda _: None)

    def replayed(self, number):
        """Send the recording through a filter; from when on it is judged tells one replay from another."""
        replay(
            self.folder / "log.csv", ["kalman"], map=RECORDED, settle=SETTLES[number % 2], out=self.folder / "replay"
        )

    def exported(self, number):
        """Write the run, which is made first, in one of two formats."""
        if not self.place.exists():
            self.run(0)
        export(self.place, FORMATS[number % 2], self.folder / "export")

    def identified(self, number):
        """Tell one of two sensors from the reference, and write what filters may believe of it."""
        name = SENSORS[number % 2]
        found = identify_sensors(read_log(self.folder / "log.csv", map=RECORDED), "reference", name, one_clock=True)
        with failing_as_run_error("belief"):
            write_bytes(self.folder / "belief.yaml", belief_text(found, "log.csv").encode())

    def swept(self, _number):
        """Go on with a sweep, or play it whole where it is done."""
        if (self.folder / "sweep" / "sweep.html").exists():
            shutil.rmtree(self.folder / "sweep")
        sweep(self.folder / "study.yaml", out=self.folder / "sweep")

    def faults(self):
        """Yield what is not whole, or is not what its name says."""
        if self.place.exists():
            yield from self._faults_of_run()
        yield from self._faults_of_outputs()
        if self.model.exists():
            read_model(self.model)
            known = list(json.loads(self.model.read_text())["trained_on"].values())
            if known not in (["up.csv"], ["down.csv"]):
                yield f"trained on {known}"
        left = [path.name for path in self.folder.iterdir() if path.name.endswith(".partial")]
        if len(left) > 1:
            yield f"leftovers that were not swept: {left}"

    def _faults_of_outputs(self):
        """Yield what a replay, an export, an identification or a sweep left that is not whole."""
        if (place := self.folder / "replay").exists():
            played = testbed.open_run(place)
            yield from strangers(place)
            if not (played.metrics["settle_s"] in SETTLES and np.isfinite(played.fusion["kalman"].rate[-1])):
                yield "the replay breaks off"
        if (place := self.folder / "export").exists():
            yield from (f"{name} is missing" for name in read_manifest(place)["files"] if not (place / name).is_file())
            sizes = {channel.rate().values.size for channel in read_log(place / "log.yaml").channels.values()}
            if sizes != {10_000, 1000}:
                yield f"the export has {sizes} samples"
        if (place := self.folder / "belief.yaml").exists() and list(read_belief(place)) not in [[n] for n in SENSORS]:
            yield "a belief of another sensor"
        if (place := self.folder / "sweep").exists() and (place / "cases.parquet").exists():
            rows = open_sweep(place).to_pylist()
            once = {(row["case"], row["seed"], row["source"]) for row in rows}
            if len(once) != len(rows) or any(row["status"] != "ok" for row in rows):
                yield "a case is there twice, or failed"
            if (place / "sweep.html").exists() and "</html>" not in (place / "sweep.html").read_text():
                yield "the page of the sweep breaks off"

    def _faults_of_run(self):
        run, manifest = testbed.open_run(self.place), read_manifest(self.place)
        yield from strangers(self.place)
        yield from (f"{name} is missing" for name in manifest["files"] if not (self.place / name).is_file())
        with h5py.File(self.place / "run.nc") as file:
            stored = int(np.ravel(file.attrs["seed"])[0])
        written = YAML(typ="safe", pure=True).load((self.place / "scenario.yaml").read_text())["seed"]
        if not run.metrics["seed"] == stored == written:
            yield f"seeds {run.metrics['seed']}, {stored}, {written}"
        if not np.isfinite(run.truth.rate).all():
            yield "a signal breaks off"
        if not (self.place / "report.html").read_text().rstrip().endswith("</html>"):
            yield "the report breaks off"


def begin(action, number, said):
    """Fork and do it there: exit status 0, 2, 3 of the contract, 4 with a traceback for anything else."""
    child = os.fork()
    if child:
        return child
    status = 4
    try:
        with said.open("a") as stream:
            os.dup2(stream.fileno(), 1)
            os.dup2(stream.fileno(), 2)
        action(number)
        status = 0
    except ScenarioError as error:
        print(error, flush=True)
        status = 2
    except RunError as error:
        print(error, flush=True)
        status = 3
    except BaseException:  # noqa: BLE001 - told by the status
        traceback.print_exc()
    finally:
        os._exit(status)


def end(child):
    _, status = os.waitpid(child, 0)
    return f"signal {os.WTERMSIG(status)}" if os.WIFSIGNALED(status) else f"status {os.WEXITSTATUS(status)}"


def alone(scene, said):
    """Run the scenario in a process of its own: the recording's library waits forever in a fork whose disk is full.

    The check beforehand sees the room that others take only later.
    """
    command = [sys.executable, "-c", _FILLED_LATER, "run", scene.folder / "short.yaml"]
    command += ["--out", scene.place, "--seed", "1"]
    with said.open("a") as stream:
        return f"status {subprocess.run(command, stdout=stream, stderr=stream, check=False, timeout=300).returncode}"


def checked(scene, what):
    """Return the faults of a scene, one line each."""
    try:
        return [f"{what}: {fault}" for fault in scene.faults()]
    except Exception as error:  # noqa: BLE001 - what cannot be read is a fault
        return [f"{what}: {type(error).__name__}: {error}"]


def kill(name, number, seed, folder):
    """Kill an action at random moments, every other one about the end of its time, where things are put in place."""
    scene, said, choice = Scene(folder), folder / "said.txt", random.Random(seed)
    first = [scene.run] if name == "report" else []
    for action in (*first, getattr(scene, name), getattr(scene, name)):
        begun = time.monotonic()
        assert end(begin(action, 0, said)) == "status 0", said.read_text()
        length = time.monotonic() - begun
    ends, faults = collections.Counter(), []
    for i in range(1, number + 1):
        child = begin(getattr(scene, name), i, said)
        moment = length * (choice.uniform(0.8, 1.2) if i % 2 else choice.uniform(0.0, 1.0))
        time.sleep(moment)
        os.kill(child, signal.SIGKILL)
        ended = end(child)
        ends[ended] += 1
        if ended == "status 0":
            # It took no longer than that: what was measured before may have been on a busier machine.
            length = min(length, moment)
        faults += checked(scene, f"{name} {i}, killed after {moment:.3f} s")
    if end(begin(getattr(scene, name), 0, said)) != "status 0":
        faults.append("the last one, undisturbed, failed")
    faults += [f"left: {path.name}" for path in folder.rglob("*.partial")]
    return {"ends": ends, "faults": faults, "length_s": length}


@contextmanager
def mounted(folder, size):
    """Mount a file system of `size` bytes there; only the super-user of a name space of its own may."""
    folder.mkdir(exist_ok=True)
    subprocess.run(["mount", "-t", "tmpfs", "-o", f"size={size}", "none", folder], check=True)
    try:
        yield
    finally:
        subprocess.run(["umount", folder], check=True)


def disk(number, folder):
    """Do everything on disks of `number` sizes, on which nothing, a part or all fits, and on one that is read-only."""
    said, ends, faults = folder / "said.txt", collections.Counter(), []
    with mounted(folder / "whole", PLENTY):
        scene = Scene(folder / "whole")
        assert end(begin(scene.run, 0, said)) == "status 0", said.read_text()
        assert end(begin(scene.training, 0, said)) == "status 0", said.read_text()
        needed = sum(path.stat().st_size for path in (folder / "whole").rglob("*") if path.is_file())
        shutil.copytree(folder / "whole", folder / "kept")
    for i in range(number):
        # The first sizes take the earlier run with little beside it, the last ones a second run too.
        size = int(needed * (1.02 + 1.2 * i / (number - 1)))
        with mounted(folder / "small", size):
            shutil.copytree(folder / "kept", folder / "small", dirs_exist_ok=True)
            scene = Scene(folder / "small", make=False)
            for name in ("training", "report", "run"):
                how = alone(scene, said) if name == "run" else end(begin(getattr(scene, name), i + 1, said))
                ends[f"{name} {how}"] += 1
                if how not in {"status 0", "status 2", "status 3"}:
                    faults.append(f"{name} on {size} bytes: {how}")
                faults += checked(scene, f"{name} on {size} bytes")
                faults += [f"left: {path.name}" for path in (folder / "small").rglob("*.partial")]
    with mounted(folder / "small", PLENTY):
        shutil.copytree(folder / "kept", folder / "small", dirs_exist_ok=True)
        subprocess.run(["mount", "-o", "remount,ro", folder / "small"], check=True)
        scene = Scene(folder / "small", make=False)
        for name, expected in (("training", "status 3"), ("report", "status 3"), ("run", "status 2")):
            how = end(begin(getattr(scene, name), 1, said))
            if how != expected:
                faults.append(f"{name} where nothing may be written: {how}, expected {expected}")
            faults += checked(scene, f"{name} where nothing may be written")
    return {"ends": ends, "faults": faults, "needed_bytes": needed}


def load(folder):
    """Run in memory what the forks run: they find libraries and kernels loaded, and no thread has begun by it."""
    folder.mkdir()
    testbed.run(short(folder))


if __name__ == "__main__":
    what, *given = sys.argv[1:]
    load(Path(given[-1]) / "loaded")
    if what == "kill":
        numbers = {name: int(number) for name, _, number in (one.partition("=") for one in given[0].split(","))}
        found = {name: kill(name, number, int(given[1]), Path(given[2]) / name) for name, number in numbers.items()}
    else:
        found = disk(int(given[0]), Path(given[1]))
    print(json.dumps(found))
