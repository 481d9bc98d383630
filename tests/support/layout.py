"""Layout of a page in a browser: whether it fits, and whether words stay whole."""

from __future__ import annotations

from typing import Any

# Words of up to 18 letters in a table that are drawn in more than one line.
BROKEN_WORDS = """() => {
  const broken = [];
  for (const cell of document.querySelectorAll("th, td")) {
    const walker = document.createTreeWalker(cell, NodeFilter.SHOW_TEXT);
    for (let node = walker.nextNode(); node; node = walker.nextNode()) {
      if (node.parentElement.closest("svg")) continue;
      for (const word of node.data.matchAll(/\\p{L}{2,18}/gu)) {
        const range = document.createRange();
        range.setStart(node, word.index);
        range.setEnd(node, word.index + word[0].length);
        const tops = new Set([...range.getClientRects()].map((box) => Math.round(box.top)));
        if (tops.size > 1) broken.push(word[0]);
      }
    }
  }
  return broken;
}"""
# Tables, of those named, that are wider than the place where they stand.
CUT = """(tables) => [...document.querySelectorAll(tables)].filter((table) =>
  table.getBoundingClientRect().right > table.parentElement.getBoundingClientRect().right + 1
).map((table) => table.innerText.slice(0, 60))"""


def check_layout(page: Any, whole: str) -> None:
    """Check that the page is as wide as its window, words whole, and the tables `whole` uncut."""
    width = page.viewport_size["width"]
    assert page.evaluate("document.documentElement.scrollWidth") <= width
    assert page.evaluate(BROKEN_WORDS) == []
    assert page.locator(whole).count() > 0
    assert page.evaluate(CUT, whole) == []
