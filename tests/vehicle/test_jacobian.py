"""Derivatives of every quantity are those of central differences, for cars far from square."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from tests.vehicle.test_vehicle import MIRROR, WHEELS, normals_of, some_car
from wheelplane.vehicle.definitions import VEHICLE
from wheelplane.vehicle.jacobian import linearise

STEP = 1e-5


def skewed_car(seed):
    """Scanner-frame centres and normals, of either sense; the front axle oblique, to one side."""
    rng = np.random.default_rng(seed)
    centres = np.array([[0, -0.6, 0], [0, 0.6, 0], [2.2, -0.4, 0], [2.9, 1.1, 0.2]])
    centres += rng.uniform(-0.1, 0.1, (4, 3))
    normals = normals_of(rng.uniform(-0.3, 0.3, 6), rng.uniform(-0.2, 0.2, 6))
    pose = Rotation.random(rng=rng)
    vertical = pose.apply([0.08, -0.05, 1.0])
    senses = np.array([1.0, -1.0, 1.0, 1.0, -1.0, -1.0])[:, None]
    return (
        pose.apply(centres) + np.array([3, -2, 1]),
        senses * pose.apply(normals),
        vertical / np.linalg.norm(vertical),
    )


def difference(function, at):
    """Return the central differences (Q, at.size) of function(at)."""
    steps = STEP * np.eye(at.size).reshape(-1, *at.shape)
    return np.stack([(function(at + s) - function(at - s)) / (2 * STEP) for s in steps], axis=1)


@pytest.mark.parametrize("seed", range(3))
@pytest.mark.parametrize("with_vertical", [False, True])
def test_derivatives_of_a_skewed_car_are_those_of_central_differences(seed, with_vertical):
    centres, normals, vertical = skewed_car(seed)

    def values(centres=centres, normals=normals, e=vertical):
        e = e / np.linalg.norm(e) if with_vertical else None
        return linearise(centres, normals, WHEELS, e).values

    slopes = linearise(centres, normals, WHEELS, vertical if with_vertical else None).slopes
    slopes = slopes.reshape(len(slopes), -1, 2, 3)
    # A third derivative of some 30 times step^2, and rounding of 1e-15 over the step.
    of_normals = difference(lambda n: values(normals=n), normals)
    np.testing.assert_allclose(slopes[:, :6, 0].reshape(of_normals.shape), of_normals, atol=2e-8)
    of_centres = difference(lambda c: values(centres=c), centres)
    np.testing.assert_allclose(slopes[:, :4, 1].reshape(of_centres.shape), of_centres, atol=2e-8)
    np.testing.assert_array_equal(slopes[:, 4:, 1], 0.0)  # no centre but the first four counts
    assert slopes.shape[1] == 6 + with_vertical
    if with_vertical:
        level = np.eye(3) - np.outer(vertical, vertical)  # a direction moves across itself alone
        of_vertical = difference(lambda e: values(e=e), vertical)
        np.testing.assert_allclose(slopes[:, 6, 0] @ level, of_vertical, atol=2e-8)
        assert np.abs(of_vertical).max() > 0.5


def test_a_car_at_any_distance_has_the_same_values_and_derivatives():
    """Coordinates of whole 2^-20 m, shifted by 2^32 m: float64 holds both exactly."""
    centres, normals = some_car(1)
    centres = np.round(centres * 2**20) / 2**20
    near, far = (linearise(centres + shift, normals, WHEELS) for shift in (0.0, 2.0**32))
    np.testing.assert_allclose(far.values, near.values, rtol=0, atol=1e-14)
    np.testing.assert_allclose(far.slopes, near.slopes, rtol=0, atol=1e-13)


def test_lengths_without_a_sign_are_those_positive_in_a_mirror_too():
    centres, normals = some_car(0)
    order, wheels = [1, 0, 3, 2], WHEELS[:4]
    mirrored = (centres * MIRROR)[order], (normals[:4] * MIRROR)[order]
    pair = [linearise(*car, wheels).values for car in ((centres, normals[:4]), mirrored)]
    lowest = np.minimum(*pair)[-len(VEHICLE) :]
    for entry, value in zip(VEHICLE, lowest, strict=True):
        if entry.unit == "m":
            assert entry.signed == (value < 0.0), entry.name
