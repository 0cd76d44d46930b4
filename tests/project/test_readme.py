"""README.md: its table is that of the commands."""

from __future__ import annotations

from tests.project.readme import README, with_table


def test_the_table_of_commands_is_that_of_the_app():
    text = README.read_text(encoding="utf-8")
    assert with_table(text) == text, "run `make readme`"
