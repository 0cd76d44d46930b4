"""README.md is a page; the table of the commands stands in docs/commands.md and is that of the app."""

from __future__ import annotations

import re
from pathlib import Path

from ruamel.yaml import YAML

import testbed
from tests.project.commands import PAGE, with_table

README = Path(__file__).parents[2] / "README.md"


def test_the_table_of_commands_is_that_of_the_app():
    text = PAGE.read_text(encoding="utf-8")
    assert with_table(text) == text, "run `make commands`"


def test_the_readme_is_a_page_with_a_picture_two_commands_and_a_scenario():
    text = README.read_text(encoding="utf-8")
    assert len(text.splitlines()) <= 80
    assert text.index("docs/images/recording.png") < text.index("## Start")
    assert re.findall(r"^make (\w+)", text, re.MULTILINE) == ["run", "view"]


def test_its_scenario_is_the_one_that_ships_less_a_filter():
    (text,) = re.findall(r"```yaml\n(.*?)```", README.read_text(encoding="utf-8"), re.DOTALL)
    said = YAML(typ="safe").load(text)
    shipped = YAML(typ="safe").load(README.parent / "scenarios" / f"{said['name']}.yaml")
    testbed.Scenario.from_dict(said)
    for key in ("seed", "duration", "settle", "turntable", "motion"):
        assert said[key] == shipped[key]
    assert said["fusion"].items() <= shipped["fusion"].items()
    presets = {name: part["preset"] for name, part in shipped["sensors"].items()}
    assert {name: part["preset"] for name, part in said["sensors"].items()} == presets
