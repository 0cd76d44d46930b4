"""README.md: its table is that of the commands, and what it points to exists."""

from __future__ import annotations

import re

from tests.project.readme import README, with_table


def test_the_table_of_commands_is_that_of_the_app():
    text = README.read_text(encoding="utf-8")
    assert with_table(text) == text, "run `make readme`"


def test_every_path_exists():
    text = README.read_text(encoding="utf-8")
    links = re.findall(r"\]\((?!https?:)([^)#]+)", text)
    named = re.findall(r"`((?:testbed|scenarios|examples|benchmarks|tests|docs)/[\w./]*)`", text)
    assert links
    assert [path for path in (*links, *named) if not (README.parent / path).exists()] == []
