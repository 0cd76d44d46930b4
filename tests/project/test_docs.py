"""The pages: what they name exists, and the picture of the house shows the house."""

from __future__ import annotations

import importlib
import re
from pathlib import Path

import pytest

from testbed.inputs.plugins import GROUPS
from tests.project.picture import PICTURE, ROOMS, picture
from tests.test_architecture import ROOMS as RULES
from tests.test_architecture import TOP

ROOT = Path(__file__).parents[2]
PAGES = sorted([*ROOT.glob("docs/*.md"), ROOT / "README.md", ROOT / "CONTRIBUTING.md"])
NAME = re.compile(r"\btestbed(?:\.[A-Za-z_]\w*)+")
QUOTED = re.compile(rf"`({NAME.pattern})`")
TOP_FOLDERS = "testbed|scenarios|examples|benchmarks|tests|docs|changes"


@pytest.mark.parametrize("page", PAGES, ids=lambda path: path.name)
def test_every_path_and_link_exists(page):
    text = page.read_text(encoding="utf-8")
    named = re.findall(rf"`((?:{TOP_FOLDERS})/[\w./*-]*)`", text)
    missing = [name for name in named if not any(ROOT.glob(name.rstrip("/")))]
    links = re.findall(r"\]\((?!https?:)([^)#\s]+)", text)
    # What docs/generated.py writes is there once the site is built.
    written = [link for link in links if "reference/generated/" not in link]
    assert [*missing, *(link for link in written if not (page.parent / link).exists())] == []


# The recipes of CONTRIBUTING.md make names that are not there before; test_contributing.py follows them.
@pytest.mark.parametrize("page", [page for page in PAGES if page.stem != "CONTRIBUTING"], ids=lambda path: path.name)
def test_every_dotted_name_can_be_imported(page):
    # Groups of entry points are dotted as well.
    names = set(NAME.findall(page.read_text(encoding="utf-8"))) - set(GROUPS.values())
    assert [name for name in sorted(names) if not is_there(name)] == []


def test_every_dotted_name_in_the_code_can_be_imported():
    said = {name for path in (ROOT / "testbed").rglob("*.py") for name in QUOTED.findall(path.read_text("utf-8"))}
    assert [name for name in sorted(said) if not is_there(name)] == []


def is_there(name: str) -> bool:
    """Whether a dotted name is a module, or something in one."""
    module, rest = name, []
    while True:
        try:
            item = importlib.import_module(module)
        except ModuleNotFoundError:
            module, _, last = module.rpartition(".")
            rest.insert(0, last)
            continue
        for part in rest:
            if not hasattr(item, part):
                return False
            item = getattr(item, part)
        return True


# What has no reader of its own: lists of links, and pages of the repository itself.
OTHER = {"index", "howto", "glossary", "contributing", "security"}


@pytest.mark.parametrize("page", sorted(ROOT.glob("docs/*.md")), ids=lambda path: path.stem)
def test_every_page_begins_with_whom_it_is_for_or_its_question(page):
    if page.stem not in OTHER:
        begin = page.read_text(encoding="utf-8").split("\n\n")[1]
        assert begin.startswith(("For who", "For everyone", "**The question.**")), begin


def test_the_picture_is_that_of_the_house():
    assert PICTURE.read_text(encoding="utf-8") == picture(), "run `make pictures`"


def test_every_room_is_in_the_picture_and_on_the_page():
    rooms = {*RULES, *TOP}
    assert rooms - {"chain"} <= set(ROOMS), "give it its place in tests/project/picture.py"
    page = (ROOT / "docs" / "architecture.md").read_text(encoding="utf-8")
    assert [room for room in sorted(rooms) if f"**{room}/**" not in page] == []
