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
