"""Tree of points of the 3D view, read by its description."""

from __future__ import annotations

import json
from dataclasses import dataclass
from pathlib import Path

import numpy as np

OFF_TARGET = -32768


@dataclass(frozen=True)
class Node:
    """A node: depth, cell (column, row, level), and its points: columns of their values."""

    depth: int
    cell: tuple[int, int, int]
    xyz: np.ndarray
    residual_um: np.ndarray
    intensity: np.ndarray
    scan: np.ndarray


def read_tree(head: dict, data: bytes) -> list[Node]:
    """Return the nodes of a file."""
    nodes = []
    for depth, x, y, z, count in head["nodes"]:
        own, data = data[: 16 * count], data[16 * count :]
        extra = np.frombuffer(own, "<u4", offset=12 * count)
        nodes.append(
            Node(
                depth,
                (x, y, z),
                np.frombuffer(own, "<f4", 3 * count).reshape(-1, 3),
                (extra & 0xFFFF).astype("<u2").view("<i2"),
                (extra >> 16 & 0xFF).astype(np.uint8),
                extra >> 24,
            )
        )
    assert data == b""
    return nodes


def tree_in(folder: Path) -> tuple[dict, list[Node]]:
    """Return head and nodes of the files in a folder."""
    head = json.loads((folder / "points.json").read_text())
    return head, read_tree(head, (folder / "points.bin").read_bytes())


def whole(nodes: list[Node], column: str) -> np.ndarray:
    """Return a column of all points."""
    return np.concatenate([getattr(node, column) for node in nodes])
