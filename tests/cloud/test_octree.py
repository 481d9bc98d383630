"""Octree of points: each in one node, nodes within their cells, each depth an even sample."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from wheelplane.cloud import GRID_BITS, MOST_DEPTH, cell_index, divide, mixed, morton_codes, octree

EDGE_M = 8.0


def cloud(seed, count=60_000):
    """A dense patch on a plane, a sparse ball around it, and points at one place."""
    rng = np.random.default_rng(seed)
    plane = rng.uniform([-0.2, -0.2, 0], [0.2, 0.2, 1e-4], (count // 2, 3))
    ball = rng.normal(0.0, 0.8, (count // 2 - 50, 3))
    return np.vstack([plane, ball, np.full((50, 3), 0.3)]).astype(np.float32)


def nodes_of(points, depth=0):
    """Rows of each node (depth, cell), divided at once or cell by cell."""
    codes = morton_codes(points, EDGE_M)
    cells = codes >> np.uint64(3 * (octree.CODE_BITS - depth))
    nodes, before = {}, None
    for cell in np.unique(cells):
        rows = np.flatnonzero(cells == cell)
        for part in divide(codes[rows], depth, before, None):
            nodes.setdefault((part.depth, part.cell), []).append(rows[part.rows])
        before = int(codes[rows].max())
    return {key: np.concatenate(parts) for key, parts in nodes.items()}


def grid(points, depth):
    """Cell (N, 3) of each point in a grid of 2^depth cells along the edge."""
    return np.floor((points.astype(float) + EDGE_M / 2) * (2**depth / EDGE_M)).astype(int)


@pytest.fixture
def small_leaves(monkeypatch):
    monkeypatch.setattr(octree, "LEAF", 500)


@pytest.mark.parametrize("depth", [0, 1, 3])
def test_each_point_is_in_exactly_one_node_within_its_cell(small_leaves, depth):
    points = cloud(1)
    nodes = nodes_of(points, depth)
    rows = np.sort(np.concatenate(list(nodes.values())))
    assert np.array_equal(rows, np.arange(len(points)))
    assert {key[0] for key in nodes} >= set(range(6))
    for (level, cell), own in nodes.items():
        assert (grid(points[own], level) == cell_index(cell, level)).all()


def test_nodes_down_to_a_depth_hold_one_point_of_each_cell_of_its_grid(small_leaves):
    """Unless a leaf ends above: there they hold every point."""
    points = cloud(2)
    nodes = nodes_of(points)
    for depth in range(4):
        own = np.concatenate([rows for (level, _), rows in nodes.items() if level <= depth])
        fine = grid(points, depth + GRID_BITS)
        cells, counts = np.unique(grid(points, depth), axis=0, return_counts=True)
        whole = {tuple(cell) for cell in cells[counts <= octree.LEAF]}
        in_leaf = np.array([tuple(cell) in whole for cell in grid(points, depth)])
        held = np.zeros(len(points), bool)
        held[own] = True
        assert held[in_leaf].all()
        found, of = np.unique(fine[~in_leaf], axis=0, return_inverse=True)
        sampled = np.bincount(of.ravel(), weights=held[~in_leaf], minlength=len(found))
        assert (sampled == 1).all()
        assert len(found) < np.count_nonzero(~in_leaf)  # a node that held all would fail


def test_cell_by_cell_the_nodes_are_the_same(small_leaves):
    points = cloud(3)
    at_once, by_cells = nodes_of(points), nodes_of(points, 2)
    assert at_once.keys() == by_cells.keys()
    for key, rows in at_once.items():
        assert np.array_equal(rows, by_cells[key])


def test_a_few_points_are_one_node():
    points = cloud(4, 1000)
    assert list(nodes_of(points)) == [(0, 0)]


def test_points_at_one_place_are_in_the_deepest_node(small_leaves):
    points = np.repeat(cloud(5, 1000)[:2], 2000, axis=0)
    nodes = nodes_of(points)
    assert sum(map(len, nodes.values())) == len(points)
    assert max(depth for depth, _ in nodes) == MOST_DEPTH


@given(st.integers(1, 5000))
def test_every_prefix_of_a_node_is_even(count):
    """Gaps between the first k rows are at most twice their mean."""
    order = mixed(count)
    assert np.array_equal(np.sort(order), np.arange(count))
    for k in {max(1, count // 10), max(1, count // 3)}:
        ends = np.concatenate([[-1], np.sort(order[:k]), [count]])
        assert np.diff(ends).max() <= 2 * (count / k) + 1
