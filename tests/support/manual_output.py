"""Rewriter of the printed output that the manual and the README show.

.venv/bin/python -m tests.support.manual_output            lists the blocks that are out of date
.venv/bin/python -m tests.support.manual_output --write    rewrites them in place

It runs every command as tests/docs does. A block is replaced only where the words, the numbers
(beyond the tolerance of `alike`) or the columns of a line changed, and then all of it: its lines
are of one run. `...` still stands for the lines left out.
"""

from __future__ import annotations

import re
import sys
import tempfile
from difflib import SequenceMatcher
from itertools import groupby
from pathlib import Path

import pytest

from tests.support.manual_blocks import (
    ENDLESS,
    NUMBER,
    OTHERS,
    Command,
    File,
    alike,
    blocks,
    differs,
    folder,
    prepare,
    run,
)
from wheelplane.manual.build import chapter_files

ROOT = Path(__file__).resolve().parents[2]
README = ROOT / "README.md"
DEMO = "wheelplane demo"
README_DEMO = re.compile(r"^```text\n(Making a vehicle .*?)^```$", re.MULTILINE | re.DOTALL)
README_CONSOLE = re.compile(r"^```console\n\$ (wheelplane [^\n]*)\n(.*?)^```$", re.M | re.S)
ELISION = "..."
GAP = -0.3  # score of a line without a counterpart; a pair of lines scores its likeness - 0.4
UNLIKE = 0.4


def main(write: bool) -> int:
    """Compare, or rewrite, all printed output; return 1 where a command or a block failed."""
    texts = {path.name: path for path in [README, *chapter_files()]}
    changes, faults = readme_changes()
    more, others = manual_changes(demo=changes[DEMO].new)
    found = [*changes.values(), *more]
    others += [f"{one.where}: a shown part is no longer printed" for one in found if one.lost]
    for file, group in groupby(found, key=lambda change: change.where.split(":")[0]):
        _report_and_replace(texts[file], [one for one in group if one.old != one.new], write)
    for fault in [*faults, *others]:
        print(f"not updated: {fault}")
    return 1 if faults or others else 0


class Change:
    """Shown text at a span of a file, and the text that replaces it."""

    def __init__(self, where: str, span: tuple[int, int], old: str, printed: str) -> None:
        self.where, self.span, self.old = where, span, old
        self.new = updated(old, printed)
        self.lost = f"{ELISION}\n{ELISION}\n" in self.new


def readme_changes() -> tuple[dict[str, Change], list[str]]:
    """Run the commands of the README; the demo's change is stored under its command."""
    text = README.read_text(encoding="utf-8")
    changes, faults = {}, []
    demo = README_DEMO.search(text)
    assert demo, "the README has no block that begins with 'Making a vehicle'"
    with tempfile.TemporaryDirectory() as scratch, folder(Path(scratch)):
        _, printed = run(DEMO)
        changes[DEMO] = Change(_where(text, demo), demo.span(1), demo[1], printed)
    with folder(ROOT):
        for found in README_CONSOLE.finditer(text):
            code, printed = run(found[1])
            if code:
                faults.append(f"{_where(text, found)}: {found[1]}: exit code {code}: {printed}")
            else:
                changes[found[1]] = Change(_where(text, found), found.span(2), found[2], printed)
    return changes, faults


def _where(text: str, found: re.Match[str]) -> str:
    return f"{README.name}:{text.count(chr(10), 0, found.start()) + 1}"


def manual_changes(demo: str) -> tuple[list[Change], list[str]]:
    """Run the commands of the manual in order; `demo` is the output of `wheelplane demo`."""
    changes: list[Change] = []
    faults: list[str] = []
    with (
        tempfile.TemporaryDirectory() as name,
        pytest.MonkeyPatch.context() as patch,
        folder(Path(name)),
    ):
        patch.setenv("XDG_CACHE_HOME", str(Path(name, "cache")))
        patch.setattr("webbrowser.open", lambda url: True)
        prepare(Path(name))
        for one in blocks():
            if isinstance(one, File):
                one.write()
            elif not ENDLESS.match(one.line) and not one.line.startswith(OTHERS):
                code, printed = (0, demo) if one.line == DEMO else run(one.line)
                if code != one.code:
                    faults.append(f"{one.where}: {one.line}: exit code {code}: {printed[-300:]}")
                elif one.shown is not None:
                    changes.append(_change(one, printed))
    return changes, faults


def _change(one: Command, printed: str) -> Change:
    return Change(one.where, one.span, one.shown or "", printed)


def _report_and_replace(path: Path, changes: list[Change], write: bool) -> None:
    text = path.read_text(encoding="utf-8")
    for change in changes:
        print(f"{change.where}: {'rewritten' if write else 'out of date'}")
    for change in sorted(changes, key=lambda one: one.span, reverse=True):
        start, end = change.span
        assert text[start:end] == change.old, f"{path} was edited meanwhile: run this again"
        text = text[:start] + change.new + text[end:]
    if write and changes:
        path.write_text(text, encoding="utf-8")


def updated(shown: str, printed: str) -> str:
    """Return the shown text with the words of the printed one, `...` in the same places.

    Each shown line is aligned with the printed line most like it, in order. Between two elisions
    stays what is printed from the first aligned line to the last.
    """
    new = printed.rstrip("\n").split("\n")
    old = shown.rstrip("\n").split("\n")
    if not differs(shown, printed) and all(
        line == ELISION or any(_same_columns(line, other) for other in new) for line in old
    ):
        return shown
    pairs = _aligned(old, new)
    lines: list[str] = []
    for elided, group in groupby(range(len(old)), key=lambda i: old[i] == ELISION):
        indices = list(group)
        if elided:
            lines.append(ELISION)
            continue
        matched = [pairs[i] for i in indices if i in pairs]
        at_start, at_end = indices[0] == 0, indices[-1] == len(old) - 1
        first = min(matched, default=len(new) - len(indices) if at_end else 0)
        last = max(matched, default=len(indices) - 1 if at_start else -1)
        first, last = 0 if at_start else first, len(new) - 1 if at_end else last
        lines += [line.rstrip() for line in new[first : last + 1]]
    return "\n".join(lines) + "\n"


def _same_columns(line: str, other: str) -> bool:
    return alike(line, other) and NUMBER.sub("#", line).rstrip() == NUMBER.sub("#", other).rstrip()


def _aligned(old: list[str], new: list[str]) -> dict[int, int]:
    """Return the alignment of highest score, old index -> new index (Needleman-Wunsch)."""
    rows, columns = len(old) + 1, len(new) + 1
    score = [[0.0] * columns for _ in range(rows)]
    step = [[""] * columns for _ in range(rows)]
    for i in range(rows):
        for j in range(columns):
            if i == j == 0:
                continue
            free = i > 0 and old[i - 1] == ELISION
            options = []
            if i and j and not free:
                options.append((score[i - 1][j - 1] + _likeness(old[i - 1], new[j - 1]), "pair"))
            if i:
                options.append((score[i - 1][j] + (0.0 if free else GAP), "old"))
            if j:
                options.append((score[i][j - 1] + (0.0 if free else GAP), "new"))
            score[i][j], step[i][j] = max(options)
    pairs, i, j = {}, len(old), len(new)
    while i or j:
        if step[i][j] == "pair":
            i, j = i - 1, j - 1
            pairs[i] = j
        elif step[i][j] == "old":
            i -= 1
        else:
            j -= 1
    return pairs


def _likeness(line: str, other: str) -> float:
    if line == other:
        return 1.0
    masked, other_masked = NUMBER.sub("#", line), NUMBER.sub("#", other)
    exact = 0.1 if line.split()[:2] == other.split()[:2] else 0.0
    return SequenceMatcher(None, masked, other_masked, False).ratio() - UNLIKE - 0.1 + exact


if __name__ == "__main__":
    sys.exit(main(write="--write" in sys.argv[1:]))
