"""Points of the 3D view: all of them around the vehicle, in a tree, the same bytes for the same."""

from __future__ import annotations

import dataclasses
import os
from pathlib import Path

import numpy as np
import pytest

from tests.support.made import write_small_capture
from tests.support.trees import OFF_TARGET, tree_in, whole
from wheelplane.capture import open_capture
from wheelplane.cloud import octree
from wheelplane.config import Config
from wheelplane.errors import InputError
from wheelplane.measure import measure_capture
from wheelplane.readers import Scan
from wheelplane.report.scene.points import to_view
from wheelplane.web.content import points, tree

HALL = 40_000  # points of a hall about the vehicle, in each scan
ROOM = 2**30


@pytest.fixture(scope="module")
def car(tmp_path_factory):
    """A folder with a capture, and its measurement."""
    place = tmp_path_factory.mktemp("points") / "car"
    write_small_capture(place, trials=1)
    with open_capture(place) as capture:
        return place, measure_capture(capture, Config())


def written(car, out, change=lambda capture: capture, most_bytes=ROOM):
    """Head and nodes of the points of a capture, which may be changed before they are read."""
    place, measurement = car
    out.mkdir(exist_ok=True)
    shares = []
    with open_capture(place) as capture:
        measured = points.stamps(capture)
        capture = change(capture)
        points.write_points(capture, measurement, out, measured, most_bytes, shares.append)
    assert shares == sorted(shares)
    assert shares[-1] == 1.0
    return tree_in(out)


@pytest.fixture(scope="module")
def shown(car, tmp_path_factory):
    return written(car, tmp_path_factory.mktemp("shown"))


@pytest.fixture
def small(monkeypatch):
    """Limits that a small capture exceeds: it is sorted out of core, and in several steps."""
    monkeypatch.setattr(octree, "LEAF", 300)
    monkeypatch.setattr(tree, "LEAF", 300)
    monkeypatch.setattr(tree, "HELD_BYTES", 10_000)
    monkeypatch.setattr(tree, "MOST_ROWS", 2_000)


def in_order(rows):
    return rows[np.lexsort(rows.T)]


def near(car):
    """Points of all scans around the vehicle, from the origin of the tree, and of all."""
    place, measurement = car
    box = points._box(measurement)
    with open_capture(place) as capture:
        scans = [
            entry.read(capture.length_unit, entry.file, capture.reading).points_m
            for entry in capture.entries
        ]
    local = np.concatenate([to_view(measurement.frame, scan) for scan in scans])
    inside = ((local > box[0]) & (local < box[1])).all(axis=1)
    return (local[inside] - box.mean(axis=0)).astype(np.float32), len(local)


def test_each_point_around_the_vehicle_is_in_the_tree_once(car, shown):
    head, nodes = shown
    own, total = near(car)
    assert np.array_equal(in_order(whole(nodes, "xyz")), in_order(own))
    assert (head["count"], head["total"]) == (len(own), total)
    assert head["count"] == sum(count for *_, count in head["nodes"])
    assert len(np.unique([(*node.cell, node.depth) for node in nodes], axis=0)) == len(nodes)
    low, high = head["box"]
    assert np.array_equal(own.min(axis=0), np.float32(low))
    assert np.array_equal(own.max(axis=0), np.float32(high))


def test_out_of_core_it_holds_the_same_within_the_cells(car, small, tmp_path):
    head, nodes = written(car, tmp_path / "out")
    own, _ = near(car)
    assert np.array_equal(in_order(whole(nodes, "xyz")), in_order(own))
    assert max(node.depth for node in nodes) > 5
    for node in nodes:
        edge = head["edge_m"] / 2**node.depth
        low = np.array(node.cell) * edge - head["edge_m"] / 2
        assert ((node.xyz >= low) & (node.xyz < low + edge)).all()


def test_the_same_bytes_for_the_same_whatever_is_held_in_memory(car, small, tmp_path, monkeypatch):
    first, again = tmp_path / "first", tmp_path / "again"
    _, nodes = written(car, first)
    monkeypatch.setattr(tree, "HELD_BYTES", ROOM)
    written(car, again)
    for file in ("points.json", "points.bin"):
        assert (first / file).read_bytes() == (again / file).read_bytes()
    monkeypatch.setattr(tree, "MOST_ROWS", ROOM)  # sorted at once: in another order, the same nodes
    _, others = written(car, again)
    by_cell = {(node.depth, node.cell): node for node in others}
    assert len(by_cell) == len(nodes)
    for node in nodes:
        assert np.array_equal(node.xyz, by_cell[node.depth, node.cell].xyz)


def test_the_coarsest_nodes_show_the_whole(shown):
    """The root has one point in each cell of a grid of 128 along its edge that has any."""
    head, nodes = shown
    every = whole(nodes, "xyz")
    cells = np.floor(every.astype(float) / head["edge_m"] * 128)
    (root,) = (node for node in nodes if node.depth == 0)
    of_root = np.floor(root.xyz.astype(float) / head["edge_m"] * 128)
    assert len(of_root) == len(np.unique(of_root, axis=0)) == len(np.unique(cells, axis=0))
    assert len(of_root) < 0.1 * len(every)


def test_points_beyond_the_vehicle_are_left_out(car, tmp_path):
    rng = np.random.default_rng(1)

    def in_a_hall(capture):
        entries = []
        for entry in capture.entries:
            scan = entry.read(capture.length_unit, entry.file, capture.reading)
            hall = rng.uniform([-20, -20, -3], [20, 20, 6], (HALL, 3))
            scan = Scan(np.vstack([hall, scan.points_m]), None, entry.file, 0)
            entries.append(dataclasses.replace(entry, scan=scan))
        return dataclasses.replace(capture, entries=tuple(entries))

    head, nodes = written(car, tmp_path / "out", in_a_hall)
    own, total = near(car)
    assert head["total"] == total + 5 * HALL
    assert len(own) <= head["count"] < len(own) + 0.1 * 5 * HALL
    assert np.abs(whole(nodes, "xyz")).max() <= head["edge_m"] / 2
    assert head["intensity"] is None


def test_points_of_targets_lie_on_them(car, shown):
    """Their distance is that from the fitted plane; those of others have none."""
    _, measurement = car
    head, nodes = shown
    assert head["groups"] == ["RR", "RL", "FR", "FL", "1"]
    xyz, residual, scan = (whole(nodes, name) for name in ("xyz", "residual_um", "scan"))
    for index, wheel in enumerate(measurement.wheels):
        own = (scan == index) & (residual != OFF_TARGET)
        places = xyz[own] + np.array(head["origin"])
        centre = to_view(measurement.frame, wheel.observation.fitted.centre_m)
        normal = (measurement.frame.R_vehicle_scanner @ wheel.normal)[[1, 0, 2]]
        apart = np.linalg.norm(places - centre, axis=1)
        assert np.count_nonzero(own) > 300
        assert 0.1 < apart.max() < 0.135  # the disc's radius is 0.125 m
        off_um = 1e6 * (places - centre) @ normal
        noise_um = residual[own].std()
        assert 300 < noise_um < 3 * head["residual_um"]
        assert np.abs(np.abs(off_um - off_um.mean()) - np.abs(residual[own])).max() < 0.2 * noise_um
    low, high = head["intensity"]
    assert low < high
    assert len(np.unique(whole(nodes, "intensity"))) > 50
    assert whole(nodes, "intensity").max() == 255


def grown(capture):
    """The capture, the first of whose files has another byte since it was measured."""
    path = Path(capture.entries[0].path)
    os.utime(path, ns=(0, path.stat().st_mtime_ns + 1_000_000_000))
    return capture


def lost(capture):
    gone = dataclasses.replace(capture.entries[0], path=Path("gone.ply"))
    return dataclasses.replace(capture, entries=(gone, *capture.entries[1:]))


@pytest.mark.parametrize(
    ("change", "words"),
    [(grown, "it has changed since it was measured"), (lost, "there is no such file")],
)
def test_a_file_that_has_changed_or_gone_is_named(car, tmp_path, change, words):
    with pytest.raises(InputError, match=words) as refused:
        written(car, tmp_path / "out", change)
    assert "rr.ply" in str(refused.value)
    assert list((tmp_path / "out").iterdir()) == []


def test_without_room_one_line_says_so(car, small, tmp_path, monkeypatch):
    with pytest.raises(InputError, match=r"no room for all points of 0\.0 GB that the page allows"):
        written(car, tmp_path / "out", most_bytes=100_000)
    monkeypatch.setattr(tree.Spill, "_path", lambda self, cell: Path("/dev/full"))
    with pytest.raises(InputError, match=r"no room for all points \(No space left on device\)"):
        written(car, tmp_path / "out")
    assert list((tmp_path / "out").iterdir()) == []
