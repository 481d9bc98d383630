"""The independent model: the same quantities as vehicle/ and plain geometry give."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from tests.support.plain_geometry import all_plain
from tests.uncertainty.test_propagation import NAMES, WHEELS, car
from wheelplane.uncertainty.monte_carlo_model import independent_quantities
from wheelplane.vehicle.jacobian import linearise

VEHICLES = 8


@pytest.fixture(scope="module")
def vehicles():
    """Normals and centres (T, W, 3) in random poses."""
    cars = [car(seed) for seed in range(VEHICLES)]
    normals = np.array([[target.normal for target in targets] for targets in cars])
    centres = np.array([[target.centre_m for target in targets] for targets in cars])
    return normals, centres - centres[:, :4].mean(axis=1, keepdims=True)


def test_quantities_are_those_of_two_other_derivations(vehicles):
    normals, centres = vehicles
    found = independent_quantities(normals, centres, WHEELS)
    assert found.shape == (VEHICLES, len(NAMES))
    for row, n, c in zip(found, normals, centres, strict=True):
        np.testing.assert_allclose(row, linearise(c[:4], n, WHEELS).values, rtol=0, atol=1e-13)
        np.testing.assert_allclose(row, all_plain(c[:4], n, WHEELS), rtol=0, atol=1e-13)
    assert np.abs(found).max(axis=0).min() > 1e-5  # none is right by being zero


def test_camber_from_a_vertical_is_that_of_the_other_derivation(vehicles):
    """Normals have either sense, and a vertical of any length, 100 mrad off the frame's up."""
    normals, centres = vehicles
    rng = np.random.default_rng(1)
    signed = normals * rng.choice([-1.0, 1.0], normals.shape[:2])[..., None]
    ahead = centres[:, 2:4].mean(axis=1) - centres[:, :2].mean(axis=1)
    up = np.cross(ahead, centres[:, 1] - centres[:, 0])
    vertical = up / np.linalg.norm(up, axis=1)[:, None] + rng.normal(0, 0.1, (VEHICLES, 3))
    length = np.linalg.norm(vertical, axis=1)[:, None]
    found = independent_quantities(
        np.concatenate([signed, vertical[:, None]], axis=1), centres, WHEELS
    )
    for row, n, c, e in zip(found, signed, centres, vertical / length, strict=True):
        np.testing.assert_allclose(row, linearise(c[:4], n, WHEELS, e).values, rtol=0, atol=1e-13)
    assert np.abs(found - independent_quantities(signed, centres, WHEELS)).max() > 0.05


def test_wheels_steered_by_77_degrees_keep_their_outer_side(vehicles):
    """A fifth of the outward normal is along the axle; by the other derivation, with a vertical."""
    _, centres = vehicles
    for c in centres:
        left = (c[1] - c[0]) / np.linalg.norm(c[1] - c[0])
        ahead = c[2:4].mean(axis=0) - c[:2].mean(axis=0)
        up = np.cross(ahead, left) / np.linalg.norm(np.cross(ahead, left))
        for angle in (-1.35, 1.35):
            n = Rotation.from_rotvec(angle * up).apply(np.tile(left, (len(WHEELS), 1)))
            n = (n + 0.1 * up) / np.sqrt(1.01)
            found = independent_quantities(np.vstack([n, up])[None], c[None], WHEELS)[0]
            wanted = linearise(c[:4], n, WHEELS, up).values
            np.testing.assert_allclose(found, wanted, rtol=0, atol=1e-12)


def test_each_vehicle_is_computed_alone(vehicles):
    normals, centres = vehicles
    together = independent_quantities(normals, centres, WHEELS)
    order = np.random.default_rng(0).permutation(VEHICLES)
    mixed = independent_quantities(normals[order], centres[order], WHEELS)
    np.testing.assert_array_equal(mixed, together[order])
    assert np.abs(mixed - together).max() > 1e-3


def test_rotation_and_sense_of_normals_change_nothing(vehicles):
    normals, centres = vehicles
    rng = np.random.default_rng(1)
    R = Rotation.random(rng=rng).as_matrix()
    signs = rng.choice([-1.0, 1.0], (VEHICLES, len(WHEELS), 1))
    moved = independent_quantities(signs * normals @ R.T, centres @ R.T, WHEELS)
    np.testing.assert_allclose(
        moved, independent_quantities(normals, centres, WHEELS), rtol=0, atol=1e-13
    )


def test_length_of_normals_does_not_matter(vehicles):
    """Drawn normals are off unit length in second order."""
    normals, centres = vehicles
    scaled = independent_quantities(1.01 * normals, centres, WHEELS)
    np.testing.assert_allclose(
        scaled, independent_quantities(normals, centres, WHEELS), rtol=0, atol=1e-13
    )
