"""Centres by all edges of one drawing, in observations of several targets, wheels and scans."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace

import numpy as np

from tests.centre.test_dimensions import scans
from wheelplane.measurement.plates import with_alike_edges, with_alike_plates
from wheelplane.measurement.records import Evidence, Observation
from wheelplane.targets.registry import load_target

DISC, OTHER = load_target("disc-250"), load_target("ring-300")
NAMES = ("RR", "RL", "FR", "FL", "RR 1")


def observed(targets):
    """Observations of so many scans, the last of which is of the first's wheel again."""
    _, fits, bases = scans(2, count=len(targets))
    found = [
        Observation(
            name=name,
            role="reference",
            wheel=name[:2],
            source=f"{name}.ply",
            sha256="",
            points_total=1,
            invalid_points=0,
            evidence=Evidence(fit, SimpleNamespace(basis=basis), None),
            target=target,
        )
        for name, fit, basis, target in zip(NAMES, fits, bases, targets, strict=False)
    ]
    return found, fits, bases


def centres(observations):
    return [one.evidence.target.centre_m for one in observations]


def test_scans_of_one_target_count_for_each_other_and_for_no_other_target():
    found, fits, bases = observed([DISC, OTHER, DISC, OTHER, DISC])
    joint = with_alike_edges(found)
    for kept in ([0, 2, 4], [1, 3]):
        expected = with_alike_plates(
            [fits[k] for k in kept], [bases[k] for k in kept], [NAMES[k][:2] for k in kept]
        )
        for k, fit in zip(kept, expected, strict=True):
            np.testing.assert_array_equal(joint[k].evidence.target.centre_m, fit.centre_m)
            assert np.any(fit.centre_m != fits[k].centre_m)
    keys = [{c.shared for c in one.evidence.target.components if c.shared} for one in joint]
    assert keys[0] == keys[2] == keys[4] != keys[1] == keys[3]
    assert [len(key) for key in keys] == [1] * 5


def test_scans_that_show_no_target_stay_and_count_for_nothing():
    found, _, _ = observed([DISC] * 4)
    missed = replace(found[1], evidence=None, status="no-target")
    joint = with_alike_edges([found[0], missed, *found[2:]])
    assert joint[1] is missed
    others = with_alike_edges([found[0], *found[2:]])
    for one, other in zip(centres([joint[0], *joint[2:]]), centres(others), strict=True):
        np.testing.assert_array_equal(one, other)
    bare = replace(found[1], evidence=replace(found[1].evidence, plane=None))
    again = with_alike_edges([found[0], bare, *found[2:]])
    assert again[1] is bare


def test_one_scan_alone_stays():
    found, _, _ = observed([DISC])
    assert with_alike_edges(found)[0].evidence.target is found[0].evidence.target
