"""Points of the 3D view: which of a large cloud are chosen."""

from __future__ import annotations

import dataclasses
import json

import numpy as np
import pytest

from tests.support.made import write_small_capture
from wheelplane.capture import open_capture
from wheelplane.config import Config
from wheelplane.measure import measure_capture
from wheelplane.readers import Scan
from wheelplane.report.scene.points import to_view
from wheelplane.web.content import points

FAR = 400_000  # points of a hall about the vehicle, in each scan
MOST = 20_000


@pytest.fixture(scope="module")
def shown(tmp_path_factory):
    """Measurement, head, places (N, 3) and scans (N,) of points chosen in a hall, few of many."""
    place = tmp_path_factory.mktemp("hall")
    write_small_capture(place / "car", trials=0)
    rng = np.random.default_rng(1)
    with open_capture(place / "car") as capture, pytest.MonkeyPatch.context() as patch:
        measurement = measure_capture(capture, Config())
        patch.setattr(points, "MOST_POINTS", MOST)
        entries = []
        for entry in capture.entries:
            scan = entry.read(capture.length_unit, entry.file, capture.reading)
            hall = rng.uniform([-20, -20, -3], [20, 20, 6], (FAR, 3))
            every = np.vstack([hall, scan.points_m])
            entries.append(dataclasses.replace(entry, scan=Scan(every, None, entry.file, 0)))
        points.write_points(
            dataclasses.replace(capture, entries=tuple(entries)), measurement, place / "points.bin"
        )
    head, _, rest = (place / "points.bin").read_bytes().partition(b"\n")
    head, parts, scans = json.loads(head), [], []
    while rest:
        group, count = np.frombuffer(rest[:8], "<u4")
        parts.append(np.frombuffer(rest[8 : 8 + 6 * count], "<i2").reshape(-1, 3))
        scans += [group] * count
        rest = rest[8 + 10 * count :]
    places = np.array(head["origin"]) + head["step_m"] * np.concatenate(parts)
    return measurement, head, places, np.array(scans)


@pytest.mark.slow
def test_the_vehicle_is_cropped_before_points_are_chosen(shown):
    """Chosen of all, 9 of 10 would be of the hall, and the budget not used."""
    _, head, places, scans = shown
    assert head["total"] > 4 * FAR
    assert head["near"] < 0.3 * head["total"]
    assert head["count"] == len(places)
    assert 0.95 * MOST < len(places) < 1.05 * MOST  # a sample by hashes is of about that number
    assert (np.bincount(scans) > 0.2 * MOST).all()


def test_half_of_the_points_are_close_to_the_targets(shown):
    """To the target of their own scan, within 1.4 of its radius."""
    measurement, _, places, scans = shown
    for index, wheel in enumerate(measurement.wheels):
        centre = to_view(measurement.frame, wheel.observation.fitted.centre_m)
        apart = np.linalg.norm(places[scans == index] - centre, axis=1)
        close = np.count_nonzero(apart < 1.4 * wheel.observation.evidence.face.radius_m)
        assert 0.4 * len(apart) < close < 0.6 * len(apart)


def test_every_prefix_has_both(shown):
    """So that the first budget of points shows the whole, and the targets finer."""
    measurement, _, places, scans = shown
    own = places[scans == 0]
    centre = to_view(measurement.frame, measurement.wheels[0].observation.fitted.centre_m)
    close = np.linalg.norm(own - centre, axis=1) < 0.175
    first = close[: len(close) // 8]
    assert abs(first.mean() - close.mean()) < 0.02
