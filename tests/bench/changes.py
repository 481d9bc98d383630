"""One-token changes of a module's code, and those that are known to change nothing."""

from __future__ import annotations

import ast
import contextlib
import functools
import io
import itertools
import keyword
import os
import re
import tokenize
import tomllib
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
OTHERS = {
    "<": "<=", "<=": "<", ">": ">=", ">=": ">", "==": "!=", "!=": "==",
    "+": "-", "-": "+", "*": "/", "/": "*", "//": "*", "%": "*", "**": "*", "@": "*",
    "&": "|", "|": "&", "+=": "-=", "-=": "+=", "*=": "/=", "&=": "|=", "|=": "&=",
    "and": "or", "or": "and", "True": "False", "False": "True", "break": "continue",
    "min": "max", "max": "min", "any": "all", "all": "any", "sin": "cos", "cos": "sin",
    "argmin": "argmax", "argmax": "argmin", "minimum": "maximum", "maximum": "minimum",
}  # fmt: skip
UNSEEN = re.compile(r"strict=$|reshape\(.*-$")  # a guard of lengths; any negative number is -1
EQUIVALENT = ROOT / "tests" / "bench" / "equivalent_mutants.toml"
MARKED = "«(.*?)→(.*?)»"
TIMES = itertools.count(1_000_000_000)  # no two versions of a file have one modification time


@dataclass(frozen=True)
class Change:
    """A line of a file that is otherwise; `nth` counts lines of the same text from 0."""

    file: str
    line: int
    nth: int
    was: str
    now: str

    @property
    def key(self) -> tuple[str, int, str, str]:
        """Return what stays when other lines change."""
        return self.file, self.nth, self.was, self.now

    def source(self) -> str:
        """Return the changed file's text."""
        lines = (ROOT / self.file).read_text().splitlines(keepends=True)
        lines[self.line - 1] = lines[self.line - 1].replace(self.was, self.now)
        return "".join(lines)

    @contextlib.contextmanager
    def on_disk(self) -> Iterator[None]:
        """Keep the changed file on disk while this is entered."""
        path = ROOT / self.file
        before, times = path.read_bytes(), path.stat()
        path.write_text(self.source())
        modified = next(TIMES)
        os.utime(path, (modified, modified))
        try:
            yield
        finally:
            path.write_bytes(before)
            os.utime(path, ns=(times.st_atime_ns, times.st_mtime_ns))


@dataclass(frozen=True)
class Outcome:
    """Outcome of a change: the test that saw it, or None, and the number of tests run."""

    change: Change
    seen_by: str | None
    tests: int
    seconds: float


def changes_of(room: str) -> list[Change]:
    """Return all changes of a room but for those that are known to be equivalent."""
    found = []
    for path in sorted((ROOT / room).rglob("*.py")):
        file, lines = str(path.relative_to(ROOT)), path.read_text().splitlines()
        stripped = [line.strip() for line in lines]
        for line, column, token, other in tokens(path):
            text, was = lines[line - 1], stripped[line - 1]
            now = (text[:column] + other + text[column + len(token) :]).strip()
            found.append(Change(file, line, stripped[: line - 1].count(was), was, now))
    return list({one.key: one for one in found if not reason(one)}.values())


def reason(change: Change) -> str | None:
    """Return why a change is equivalent, if that is known."""
    return equivalents().get((change.file, change.was, change.now))


@functools.cache
def equivalents() -> dict[tuple[str, str, str], str]:
    """Return the reasons by file, line, and changed line, both without indent."""
    kinds = tomllib.loads(EQUIVALENT.read_text())["kind"] if EQUIVALENT.exists() else []
    found = {}
    for kind in kinds:
        for file, lines in kind["changes"].items():
            for line in lines:
                sides = (re.sub(MARKED, side, line) for side in (r"\1", r"\2"))
                found[f"pipeline/{file}", *sides] = kind["reason"]
    return found


def tokens(path: Path) -> list[tuple[int, int, str, str]]:
    """Return line, column, token and other token of all changes of a module's code.

    Texts, annotations, imports, signatures with their decorators, and messages are left out.
    """
    text = path.read_text()
    skipped: list[tuple[tuple[int, int], tuple[int, int]]] = []
    for node in ast.walk(ast.parse(text)):
        match node:
            case ast.Import() | ast.ImportFrom() | ast.Raise():
                skipped.append(span(node, node))
            case ast.FunctionDef() | ast.AsyncFunctionDef() | ast.ClassDef():
                first = (node.decorator_list or [node])[0]
                skipped.append(((first.lineno, 0), (node.body[0].lineno, 0)))
            case ast.match_case():
                skipped.append(span(node.pattern, node.pattern))
            case ast.AnnAssign():
                skipped.append(span(node, node.annotation))
    found, before = [], None
    for token in tokenize.generate_tokens(io.StringIO(text).readline):
        line, column = token.start
        if not any(start <= token.start < end for start, end in skipped):
            other = OTHERS.get(token.string) if token.type in (1, 54) else number(token.string)
            is_unary = token.string in ("+", "-", "*", "**") and (
                before is None
                or before.string in ("(", "[", ",", "=", ":", "return", "{")
                or keyword.iskeyword(before.string)
            )
            if is_unary:
                other = "" if token.string == "-" else None
            if UNSEEN.search(text_before(token)):
                other = None
            if other is not None and token.type in (1, 2, 54):
                found.append((line, column, token.string, other))
        if token.type not in (tokenize.NL, tokenize.COMMENT):
            before = token
    return found


def text_before(token: tokenize.TokenInfo) -> str:
    """Return the text of a token's line before it."""
    return token.line[: token.start[1]]


def span(
    first: ast.stmt | ast.pattern, last: ast.stmt | ast.pattern | ast.expr
) -> tuple[tuple[int, int], tuple[int, int]]:
    """Return the positions at which the first begins and the last ends."""
    end = (last.end_lineno or last.lineno, last.end_col_offset or 0)
    return (first.lineno, first.col_offset), end


def number(text: str) -> str | None:
    """Return another number: half as much more, or one more of a whole one."""
    try:
        return str(int(text) + 1)
    except ValueError:
        pass
    try:
        return repr(1.5 * float(text) or 0.5)
    except ValueError:
        return None
