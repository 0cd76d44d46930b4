"""A browser that is there, without a window, and what it says of a page that it has drawn."""

from __future__ import annotations

import shutil
from contextlib import contextmanager
from typing import TYPE_CHECKING, Any

import pytest

if TYPE_CHECKING:
    from collections.abc import Iterator

NAMES = ("chromium", "chromium-browser", "google-chrome")
# What a reader sees: every line of text and every label of a figure, with its box and what clips it.
BOXES = """() => {
  const seen = [];
  const add = (text, box, kind) => {
    if (box.width > 1 && box.height > 1) seen.push({text, kind, x: box.x, y: box.y, w: box.width, h: box.height});
  };
  const walk = document.createTreeWalker(document.body, NodeFilter.SHOW_TEXT);
  for (let node = walk.nextNode(); node; node = walk.nextNode()) {
    const owner = node.parentElement;
    if (!node.data.trim() || owner.closest("script, style, svg") || !owner.checkVisibility()) continue;
    const range = document.createRange();
    range.selectNodeContents(node);
    for (const box of range.getClientRects()) add(node.data.trim().slice(0, 40), box, "text");
  }
  for (const label of document.querySelectorAll('svg g[id*="text_"]')) {
    const words = [...label.childNodes].find((one) => one.nodeType === Node.COMMENT_NODE);
    add(words ? words.data.trim() : label.id, label.getBoundingClientRect(), "label");
  }
  return seen;
}"""


@contextmanager
def browser() -> Iterator[Any]:
    """Yield a headless browser; the test is skipped where none is installed."""
    playwright = pytest.importorskip("playwright.sync_api", reason="the extra test is not installed")
    path = next(filter(None, map(shutil.which, NAMES)), None)
    if path is None:
        pytest.skip(f"no browser: none of {', '.join(NAMES)} is installed")
    with playwright.sync_playwright() as driver:
        started = driver.chromium.launch(executable_path=path, args=["--no-sandbox"])
        yield started
        started.close()


def overlaps(boxes: list[dict[str, Any]]) -> list[tuple[str, str]]:
    """Return the pairs of texts that cover more than two pixels of each other, each way."""
    found = []
    boxes = sorted(boxes, key=lambda box: box["y"])
    for i, one in enumerate(boxes):
        for other in boxes[i + 1 :]:
            if other["y"] > one["y"] + one["h"]:
                break
            wide = min(one["x"] + one["w"], other["x"] + other["w"]) - max(one["x"], other["x"])
            high = min(one["y"] + one["h"], other["y"] + other["h"]) - max(one["y"], other["y"])
            if wide > 2.0 and high > 2.0 + 0.25 * (one["kind"] == "text") * min(one["h"], other["h"]):
                found.append((one["text"], other["text"]))
    return found
