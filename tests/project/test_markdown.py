"""The pages are written one sentence a line, so that a change shows what it changes."""

from __future__ import annotations

import pytest

from tests.project.markdown import PAGES, reflowed


@pytest.mark.parametrize("page", PAGES, ids=lambda path: path.name)
def test_a_page_has_one_sentence_a_line(page):
    text = page.read_text(encoding="utf-8")
    assert reflowed(text) == text, "run `python -m tests.project.markdown`"


KEPT = "| a. B | c |\n\n```\nx. Y\n```\n\n    a = b. C\n    d = e\n"


def test_code_tables_and_links_stay_whole_and_sentences_are_parted():
    text = f"One. Two `a b. C` three.\nFour\n\n{KEPT}\n- item one. Item two [a link](b c).\n"
    assert reflowed(text) == (f"One.\nTwo `a b. C` three.\nFour\n\n{KEPT}\n- item one.\n  Item two [a link](b c).\n")
    assert max(len(line) for line in reflowed("word " * 60).splitlines()) <= 120
