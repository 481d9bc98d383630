"""Sentences of the source that remember their parts, and all its other texts."""

from __future__ import annotations

import ast
import re
from collections.abc import Iterator
from pathlib import Path

PART = re.compile(r"{(\w+)}")


def sentences(*folders: Path) -> set[str]:
    """Templates of Wordings: constants with parts, and what stands in the call itself."""
    found = set()
    for tree in _trees(folders):
        calls = [
            node.args[0]
            for node in ast.walk(tree)
            if isinstance(node, ast.Call) and getattr(node.func, "id", "") == "Wording"
        ]
        known = {
            node.targets[0].id: node.value.value
            for node in tree.body
            if isinstance(node, ast.Assign) and isinstance(node.value, ast.Constant)
        }
        named = {node.id for first in calls for node in ast.walk(first) if hasattr(node, "id")}
        found |= {first.value for first in calls if isinstance(first, ast.Constant)}
        found |= {
            text
            for name, text in known.items()
            if name in named or (calls and isinstance(text, str) and PART.search(text))
        }
    return found


def texts(*folders: Path) -> set[str]:
    """All texts in the modules of folders."""
    constants = (
        node
        for tree in _trees(folders)
        for node in ast.walk(tree)
        if isinstance(node, ast.Constant)
    )
    return {node.value for node in constants if isinstance(node.value, str)}


def _trees(folders: tuple[Path, ...]) -> Iterator[ast.Module]:
    for folder in folders:
        for path in folder.rglob("*.py"):
            yield ast.parse(path.read_text(encoding="utf-8"))
