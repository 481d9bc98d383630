"""Scans thinned to a least distance: what it may pull is in u where their beams are known."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest

from tests.support.scenes import Setup, make
from tests.support.thinned import least_distance
from wheelplane.config import Config
from wheelplane.detection.find_target import find_target
from wheelplane.measure import fit_target
from wheelplane.measurement import spaced
from wheelplane.targets.registry import load_target

DISC, DISTANCE_M = load_target("disc-250"), 2e-3
SCENE = Setup(spacing_m=1.4e-3, incidence_deg=20.0, pairs=12)


def evidence(distance_m, **changes):
    points = make(SCENE.but(**changes), 0).points_m
    points = points[least_distance(points, distance_m)] if distance_m else points
    patch = find_target(points, DISC, Config().segment, 0)
    return fit_target(patch, DISC, Config())


def thinning(found):
    return [part for part in found.target.components if part.name == "thinning"]


@pytest.mark.parametrize("distance_m", [0.0, DISTANCE_M])
def test_a_least_distance_is_in_u_with_a_note(distance_m):
    found = evidence(distance_m)
    (part,) = thinning(found) or (None,)
    notes = list(spaced([SimpleNamespace(evidence=found, name="FL")]))
    assert (part is not None) == (len(notes) == 1) == (distance_m > 0.0)
    if part is not None:
        along_m = part.factor[3:, 0] @ found.target.normal
        assert 3e-5 < abs(along_m) < 2e-4
        np.testing.assert_allclose(part.factor[3:, 0], along_m * found.target.normal, atol=1e-12)
        assert "FL" in str(notes[0])
        assert "2 mm" in str(notes[0])


def test_beams_that_nothing_shows_say_nothing_of_it():
    """No background, no station: noise may be along any beams."""
    found = evidence(DISTANCE_M, background_m=None)
    assert found.target.edge_fit is None
    assert not thinning(found)
    assert found.plane.spaced_m == 0.0
