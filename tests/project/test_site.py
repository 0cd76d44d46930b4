"""The pages of the site that follow from the code name all of it, and every page has its place in the contents."""

from __future__ import annotations

import importlib.util
import json
import re
import sys
from pathlib import Path

import pytest

import testbed
from testbed.scenario.schema import schema

DOCS = Path(__file__).parents[2] / "docs"
GALLERY = DOCS.parent / "examples" / "gallery"


@pytest.fixture(scope="module")
def generated():
    pytest.importorskip("numpydoc", reason="the extra docs is not installed")
    spec = importlib.util.spec_from_file_location("generated", DOCS / "generated.py")
    module = importlib.util.module_from_spec(spec)
    sys.modules["generated"] = module
    spec.loader.exec_module(module)
    return module


def test_every_key_of_the_schema_stands_on_the_page(generated):
    page = generated.keys()

    def names(entry):
        if isinstance(entry, dict):
            for name, value in entry.get("properties", {}).items():
                yield name
                yield from names(value)
            for value in entry.values():
                yield from names(value) if not isinstance(value, str) else ()
        elif isinstance(entry, list):
            for one in entry:
                yield from names(one)

    wanted = set(names(json.loads(json.dumps(schema()))))
    assert len(wanted) > 150
    assert [name for name in sorted(wanted) if f"`{name}`" not in page and f"### {name}" not in page] == []


def test_every_preset_and_public_name_stands_on_its_page(generated):
    presets, names = generated.presets(), generated.api()
    assert [name for name in testbed.list_presets() if f"## {name}\n" not in presets] == []
    assert [name for name in testbed.__all__ if name != "__version__" and f"testbed.{name}\n" not in names] == []


def test_every_command_has_its_whole_summary(generated):
    """Typer's generator ends a summary after 45 letters, in the middle of a sentence."""
    listed = re.findall(r"^\* `(\w+)`: (.*)$", generated.commands(), re.MULTILINE)
    assert {"run", "train", "inspect"} <= {name for name, _ in listed}
    assert [one for one in listed if not one[1].endswith(".")] == []


def test_every_page_is_in_the_contents():
    contents = set(re.findall(r"^[\w/]+$", (DOCS / "index.md").read_text("utf-8"), re.MULTILINE))
    pages = {str(path.relative_to(DOCS).with_suffix("")) for path in DOCS.rglob("*.md")}
    written = {page for page in pages if not page.startswith(("_build", "gallery", "reference/generated"))}
    assert written - contents == {"index"}


def test_the_options_of_a_directive_have_lines_of_their_own():
    """Two on one are the first with a long value: cards of the first page that led nowhere."""
    pages = [path for path in DOCS.rglob("*.md") if not {"_build", "_static"} & set(path.parts)]
    lines = [line for path in pages for line in path.read_text("utf-8").splitlines()]
    assert [line for line in lines if re.match(r"\s*:[a-z-]+:.* :[a-z-]+:", line)] == []


def test_no_mean_is_taken_for_markup():
    """``<s>`` in prose is an element of HTML that strikes out the rest of the page, its contents too."""
    pages = [path for path in DOCS.rglob("*.md") if not {"_build", "_static", "gallery", "generated"} & set(path.parts)]
    found = []
    for path in pages:
        text = re.sub(r"^```.*?^```$|`[^`]*`|^    .*?$", "", path.read_text("utf-8"), flags=re.DOTALL | re.MULTILINE)
        found += [(path.name, tag) for tag in re.findall(r"<[A-Za-z]+>", text)]
    assert found == []


def test_the_gallery_has_a_question_and_a_picture_a_script():
    scripts = sorted(GALLERY.glob("plot_*.py"))
    assert len(scripts) >= 12
    for script in scripts:
        text = script.read_text("utf-8")
        title = re.match(r'r?"""\n(.+)\n=+\n', text)
        assert title, script.name
        assert "?" in title.group(1), script.name
        assert text.rstrip().endswith("plt.show()"), script.name
