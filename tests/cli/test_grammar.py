"""The grammar of the command line, held for every command; what a command says to a program, and where."""

from __future__ import annotations

import importlib
import inspect
import json
import math
import os
import re
import subprocess
import sys
import zipfile
from dataclasses import dataclass, field
from pathlib import Path
from typing import Annotated

import numpy as np
import pytest
import typer
from typer.testing import CliRunner

import testbed
from testbed.cli import main
from testbed.cli.catalogue import POINTING, catalogue
from testbed.cli.options import Output, expanded
from testbed.compensation import FITS, LITERATURE
from testbed.fusion import FILTERS
from testbed.models.motions import MOTIONS
from testbed.parts import resolve
from testbed.reproduce import PAPERS
from testbed.sensors import SENSORS
from tests.cli.commands import COMMANDS, arguments, documented, options
from tests.scenes import short_file

# One prints a document anyway, the other opens a window.
WITHOUT_TABLE = {"testbed schema", "testbed view"}


def say(*words, monkeypatch, capsys):
    """Run the installed command; return status, standard output and standard error."""
    monkeypatch.setattr("sys.argv", ["testbed", *map(str, words)])
    with pytest.raises(SystemExit) as end:
        main()
    return end.value.code, *capsys.readouterr()


@pytest.fixture
def spoken(monkeypatch, capsys):
    return lambda *words: say(*words, monkeypatch=monkeypatch, capsys=capsys)


@pytest.mark.contract
@pytest.mark.parametrize("name", COMMANDS)
def test_every_command_keeps_the_grammar(name):
    command = COMMANDS[name]
    assert is_sentence(" ".join(command.help.split()))
    for part in arguments(command):
        assert re.fullmatch(r"[A-Z_]+(\.[a-z]+)?", part.metavar), "placeholders are capitals"
    for word, part in options(command).items():
        assert re.fullmatch(r"--[a-z]+(-[a-z]+)*", word), "options are whole words"
        assert is_sentence(part.help), f"{word}: help is a finished sentence"
    if name not in WITHOUT_TABLE:
        assert {"--json", "--quiet"} <= options(command).keys()
    if "--out" in options(command) and (default := options(command)["--out"].default) is not None:
        assert Path(default).parts[0] == "runs"


def is_sentence(text: str) -> bool:
    return bool(re.fullmatch(r"[A-Z\"'(N0-9].*[.]", text)) and "`" not in text and ":math:" not in text


@pytest.mark.contract
def test_every_document_is_on_the_page():
    assert documented().keys() == COMMANDS.keys() - WITHOUT_TABLE
    written = {name for name, command in COMMANDS.items() if "--out" in options(command)}
    assert {name for name, keys in documented().items() if "written" in keys} == written | {"testbed report"}


@pytest.mark.contract
def test_every_summary_is_one_finished_sentence():
    summaries = [summary for names in catalogue().values() for summary in names.values()]
    assert len(summaries) > 50
    assert [summary for summary in summaries if not is_sentence(summary) or len(summary) > 140] == []
    assert [summary for summary in summaries if re.search(r"[a-z0-9)]\. [A-Z]", summary)] == []


@pytest.mark.contract
@pytest.mark.parametrize(
    ("kind", "registry"),
    [
        ("motions", MOTIONS),
        ("sensors", SENSORS),
        ("filters", FILTERS),
        ("pointing", POINTING),
        ("drift_models", FITS),
        ("drift_methods", LITERATURE),
        ("papers", PAPERS),
    ],
)
def test_a_summary_that_was_read_is_what_an_import_gives(kind, registry):
    for name, place in registry.items():
        part = resolve(kind, name, registry) if ":" in place else importlib.import_module(place)
        first = inspect.getdoc(part).split("\n\n")[0]
        assert catalogue()[kind][name] == re.sub(r"(:\w+:)?`", "", " ".join(first.splitlines()))


def test_what_is_listed_is_found_in_an_archive_too(tmp_path):
    """Modules on the path need not be files of their own."""
    root, archive = Path(testbed.__file__).parent, tmp_path / "testbed.zip"
    with zipfile.ZipFile(archive, "w") as packed:
        for file in root.rglob("*"):
            if file.suffix in {".py", ".yaml"}:
                packed.write(file, Path("testbed") / file.relative_to(root))
    code = "import json; from testbed.cli.catalogue import catalogue; print(json.dumps(catalogue()))"
    environment = os.environ | {"PYTHONPATH": str(archive), "NUMBA_CACHE_DIR": str(tmp_path)}
    made = [sys.executable, "-c", code]
    said = subprocess.run(made, env=environment, cwd=tmp_path, capture_output=True, text=True, check=True)
    assert json.loads(said.stdout) == catalogue()


def test_list_says_the_whole_summary_on_a_narrow_terminal(monkeypatch, capsys):
    from rich.console import Console

    monkeypatch.setattr("testbed.cli.catalogue.terminal", lambda: Console(width=60))
    _, narrow, _ = say("list", monkeypatch=monkeypatch, capsys=capsys)
    assert max(map(len, narrow.splitlines())) <= 60
    words = " ".join(narrow.split())
    for names in catalogue().values():
        for summary in names.values():
            assert summary in words


def test_a_table_is_folded_or_shortened_on_a_narrow_terminal_never_cut(tmp_path, monkeypatch, capsys, rng):
    from rich.console import Console

    monkeypatch.chdir(tmp_path)
    for module in ("allan", "recordings", "understood"):
        monkeypatch.setattr(f"testbed.cli.{module}.terminal", lambda: Console(width=80, markup=False))
    np.savetxt("a_long_name.csv", rng.standard_normal(5_000), header="a_long_name_of_a_channel [deg/s]", comments="")
    for words in (
        ("allan", "a_long_name.csv", "--rate", "100"),
        ("log", "inspect", "a_long_name.csv"),
        ("check", short_file(tmp_path)),
    ):
        status, out, _ = say(*words, monkeypatch=monkeypatch, capsys=capsys)
        assert status == 0
        assert "…" not in out
        assert max(len(line) for line in out.splitlines() if "│" in line) <= 80


def test_version_is_that_of_the_package(spoken):
    assert spoken("--version") == (0, f"testbed {testbed.__version__}\n", "")


@pytest.mark.parametrize("shell", ["bash", "zsh", "fish"])
def test_completion_knows_commands_and_papers(shell, tmp_path):
    def complete(line: str) -> str:
        words = {
            "COMP_WORDS": line,
            "COMP_CWORD": str(len(line.split(" ")) - 1),
            "_TYPER_COMPLETE_ARGS": line,
            "_TYPER_COMPLETE_FISH_ACTION": "get-args",
            "_TESTBED_COMPLETE": f"complete_{shell}",
            "PYTHONPATH": str(Path(testbed.__file__).parents[1]),
        }
        code = "import sys; sys.argv = ['testbed']; from testbed.cli import main; main()"
        done = subprocess.run(
            [sys.executable, "-c", code], env=words, capture_output=True, text=True, cwd=tmp_path, check=False
        )
        assert "Traceback" not in done.stderr
        return done.stdout

    assert "reproduce" in complete("testbed rep")
    found = complete("testbed reproduce pap")
    assert all(paper in found for paper in ("paper1", "paper2", "paper3"))


def test_run_prints_its_metrics_as_one_document(tmp_path, monkeypatch, spoken):
    monkeypatch.chdir(tmp_path)
    status, out, err = spoken("run", short_file(tmp_path), "--json")
    assert status == 0
    document = json.loads(out)
    assert document.pop("written") == "runs/short"
    assert documented()["testbed run"] == {"metrics.json", "written"}
    assert document == json.loads((tmp_path / "runs" / "short" / "metrics.json").read_text())
    assert "short: " in err, "progress goes to standard error"


def test_a_missed_expectation_ends_with_1_beside_the_document(tmp_path, monkeypatch, spoken):
    monkeypatch.chdir(tmp_path)
    status, out, _ = spoken("run", short_file(tmp_path, ('"< 1"', '"< 1e-9"')), "--json", "--quiet")
    assert status == 1
    assert json.loads(out)["expectations"][0]["met"] is False


def test_quiet_says_nothing_but_errors(tmp_path, monkeypatch, spoken):
    monkeypatch.chdir(tmp_path)
    assert spoken("run", short_file(tmp_path), "--quiet") == (0, "", "")
    assert spoken("check", "short.yaml", "--quiet") == (0, "", "")
    assert spoken("report", "runs/short", "--quiet") == (0, "", "")
    status, out, err = spoken("check", "missing.yaml", "--quiet")
    assert (status, out) == (2, "")
    assert "missing.yaml" in err


def test_a_path_may_hold_what_elsewhere_is_markup(tmp_path, monkeypatch, spoken):
    folder = tmp_path / "b[/red]"
    folder.mkdir(parents=True)
    monkeypatch.chdir(folder)
    short_file(folder)
    assert spoken("check", folder / "short.yaml")[0] == 0
    status, out, _ = spoken("run", "short.yaml", "--out", folder / "[bold]out")
    assert (status, f"wrote {folder / '[bold]out'}: " in out) == (0, True)
    status, out, _ = spoken("allan", folder / "[bold]out", "--out", "[blue].svg")
    assert (status, "wrote [blue].svg" in out) == (0, True)


def test_check_says_each_key_as_written_and_in_si(tmp_path, spoken):
    status, out, _ = spoken("check", short_file(tmp_path), "--json")
    document = json.loads(out)
    assert status == 0
    assert document.keys() == documented()["testbed check"]
    assert document["scenario"] == "short"
    assert document["keys"]["motion.0.sine.rate"] == {"written": "1 deg/s", "si": f"{math.radians(1.0)!r} rad/s"}
    assert document["datasheets"]["mems_gyro"]
    assert document["turntable"]["required_torque_nm"] < document["turntable"]["torque_limit_nm"]


def test_list_says_what_the_catalogue_holds(spoken):
    _, out, _ = spoken("list", "--json")
    assert json.loads(out) == catalogue()
    assert catalogue().keys() == documented()["testbed list"]


def test_allan_says_coefficients_and_curve(tmp_path, monkeypatch, spoken, rng):
    """White noise of 0.15 deg/sqrt(h) at 100 Hz; N of 20 000 samples is known to 1/sqrt(2 n) = 0.5 %; six times."""
    monkeypatch.chdir(tmp_path)
    np.savetxt("white.csv", 0.15 / 60.0 * np.sqrt(100.0) * rng.standard_normal(20_000))
    status, out, _ = spoken("allan", "white.csv", "--unit", "deg/s", "--rate", "100 Hz", "--max-tau", "20", "--json")
    assert status == 0
    document = json.loads(out)
    assert document.keys() == documented()["testbed allan"]
    assert Path(document["written"]) == Path("runs/allan_white.svg")
    assert Path("runs/allan_white.svg").is_file()
    (record,) = document["records"]
    assert record["coefficients"]["N"]["value"] == pytest.approx(0.15, rel=0.03)
    assert record["coefficients"]["N"]["unit"] == "deg/sqrt(h)"
    assert record["coefficients"]["K"]["value"] is None
    assert record["fitted_to_s"] <= 20.0 < record["curve"]["tau_s"][-1]
    # deg/sqrt(h) over sqrt(tau = 10 ms in hours) is deg/h.
    assert record["curve"]["deviation_deg_h"][0] == pytest.approx(0.15 / np.sqrt(0.01 / 3600.0), rel=0.03)


def test_log_inspect_and_psd_say_what_the_page_says(tmp_path, monkeypatch, spoken, rng):
    monkeypatch.chdir(tmp_path)
    np.savetxt("white.csv", rng.standard_normal(5_000), header="w [deg/s]", comments="")
    status, out, _ = spoken("log", "inspect", "white.csv", "--out", "map.yaml", "--json")
    document = json.loads(out)
    assert (status, document["written"]) == (0, "map.yaml")
    assert document.keys() == documented()["testbed log inspect"]
    assert Path("map.yaml").is_file()
    status, out, _ = spoken("psd", "white.csv", "--rate", "100", "--json")
    assert (status, json.loads(out).keys()) == (0, documented()["testbed psd"])


def test_reproduce_says_the_rows_of_its_tables(tmp_path, monkeypatch, spoken):
    def report(seeds, out):
        (out / "scale_factor.csv").write_text("frequency_hz,fused\n0.5,1.01\n1,\n")
        (out / "linearity.csv").write_text("frequency_hz,name\n2,nan\n3,gyro\n")
        (out / "linearity_bent.csv").write_text("rate_deg_s\n1\n")
        (out / "rivals.csv").write_text("filter\nkalman\n")
        yield f"{seeds} seed"

    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr("testbed.reproduce.paper2.report", report)
    status, out, err = spoken("reproduce", "paper2", "--json")
    assert (status, err) == (0, "1 seed\n")
    assert json.loads(out).keys() == documented()["testbed reproduce"]
    assert json.loads(out) == {
        "paper": "paper2",
        "tables": {
            "scale_factor": [{"frequency_hz": 0.5, "fused": 1.01}, {"frequency_hz": 1.0, "fused": None}],
            "linearity": [{"frequency_hz": 2.0, "name": None}, {"frequency_hz": 3.0, "name": "gyro"}],
            "linearity_bent": [{"rate_deg_s": 1.0}],
            "rivals": [{"filter": "kalman"}],
        },
        "written": "runs/paper2",
    }
    assert spoken("reproduce", "paper2")[1:] == ("1 seed\nwrote runs/paper2\n", "")
    assert spoken("reproduce", "paper2", "--quiet")[1:] == ("", "")


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (("--block", "0"), "--block: expected more than 0 s, got 0"),
        (("--block", "5 Hz"), "--block: "),
        (("--block", "long"), "--block: "),
    ],
    ids=lambda value: value if isinstance(value, str) else " ".join(value),
)
def test_a_quantity_is_a_number_in_si_or_has_its_unit(tmp_path, spoken, words, message):
    status, _, err = spoken("run", short_file(tmp_path), "--out", tmp_path / "run", *words)
    assert status == 2
    assert message in err


def test_a_block_with_its_unit_gives_the_same_signals(tmp_path, spoken):
    path = short_file(tmp_path)
    for name, block in (("number", "0.1"), ("unit", "100 ms")):
        assert spoken("run", path, "--out", tmp_path / name, "--block", block, "--quiet")[0] == 0
    one, other = (testbed.open_run(tmp_path / name) for name in ("number", "unit"))
    np.testing.assert_array_equal(one.fusion["kalman"].rate, other.fusion["kalman"].rate)


@dataclass(frozen=True)
class Pair:
    left: str = field(default="l", metadata={"option": "--left", "help": "One.", "metavar": "L"})
    right: int | None = field(default=None, metadata={"option": "--right-hand", "help": "Other."})


def test_expanded_gives_an_option_for_each_field_and_hands_on_the_whole():
    seen = []
    small = typer.Typer()

    @small.command()
    @expanded
    def command(name: Annotated[str, typer.Argument()], pair: Pair, output: Output, more: bool = False) -> None:
        """Keep its words."""
        seen.append((name, pair, output, more))

    assert CliRunner().invoke(small, ["x", "--right-hand", "3", "--json", "--more"]).exit_code == 0
    assert CliRunner().invoke(small, ["x"]).exit_code == 0
    assert seen == [("x", Pair("l", 3), Output(json=True), True), ("x", Pair(), Output(), False)]
    assert CliRunner().invoke(small, ["x", "--right-hand", "three"]).exit_code == 2
    assert inspect.signature(command).parameters.keys() == {"name", "more", "left", "right", "json", "quiet"}


def test_a_run_names_the_files_that_it_wrote_and_no_other(spoken, tmp_path):
    status, out, _ = spoken("run", short_file(tmp_path), "--out", tmp_path / "run", "--outputs", "metrics")
    assert status == 0
    (line,) = (line for line in out.splitlines() if line.startswith("wrote "))
    names = line.rpartition(": ")[2].split(", ")
    assert sorted(names) == sorted(path.name for path in (tmp_path / "run").iterdir())
    assert "run.nc" not in names
