"""Layers of a face: stations that disagree along its normal, where no grid of beams shows them."""

import numpy as np
import pytest

from tests.centre.test_beam_grids import but, in_units_of_u, ordered
from tests.support.merged import STATIONS, merged
from tests.support.plates import patch_of
from wheelplane.centre.layers import find_layers
from wheelplane.centre.stations import of_stations
from wheelplane.config import Config
from wheelplane.measure import fit_target
from wheelplane.targets.registry import load_target

DISC = load_target("disc-250")
SIGMA_M = 3e-4
NO_GRID = {"pointing_m": 1.2e-3}  # errors of the angles of a third of a step
COUNT = 4000


def at_random(rng, heights_m, count=COUNT):
    """Points of a tilted disc, of which each has one of these heights, and noise."""
    a, r = rng.uniform(0.0, 2.0 * np.pi, count), 0.12 * np.sqrt(rng.uniform(size=count))
    u, v = r * np.cos(a), r * np.sin(a)
    return np.column_stack([u, v, heights_m + 0.004 * u - 0.003 * v])


def noise(rng, count=COUNT):
    return rng.normal(0.0, SIGMA_M, count)


@pytest.mark.parametrize("heights_m", [(0.0, 0.0015), (0.0, 0.004), (-0.0015, 0.0, 0.002)])
@pytest.mark.parametrize("share", [0.5, 0.15])
def test_points_of_each_layer_are_its_own(heights_m, share):
    rng = np.random.default_rng(1)
    others = (1.0 - share) / (len(heights_m) - 1)
    true = rng.choice(len(heights_m), COUNT, p=[*[others] * (len(heights_m) - 1), share])
    uvw = at_random(rng, np.array(heights_m)[true] + noise(rng))
    found = find_layers(uvw, 0.0)
    assert found is not None
    assert np.mean(found.of(uvw) == true) > 0.97


ONE_LAYER = {
    "normal": noise,
    "uniform": lambda rng: rng.uniform(-1e-3, 1e-3, COUNT),
    "long tails": lambda rng: SIGMA_M * rng.standard_t(2, COUNT),
    "twice the noise apart": lambda rng: noise(rng) + 2 * SIGMA_M * rng.integers(0, 2, COUNT),
    "exact": lambda rng: np.where(rng.random(COUNT) < 0.01, 0.004, 0.0),
    "halves of one mode": lambda rng: (x := noise(rng)) + np.where(x < 0.0, -2e-4, 0.0),
    "few strays": lambda rng: np.where(rng.random(COUNT) < 0.03, 0.003, 0.0) + noise(rng),
    "many strays": lambda rng: np.where(
        rng.random(COUNT) < 0.2, rng.uniform(0.0, 0.005, COUNT), noise(rng)
    ),
}


@pytest.mark.parametrize("heights", ONE_LAYER)
def test_heights_of_one_mode_are_one_layer(heights):
    for seed in range(20):
        rng = np.random.default_rng(seed)
        assert find_layers(at_random(rng, ONE_LAYER[heights](rng)), 0.0) is None


def test_parts_of_a_face_at_two_heights_are_no_layers():
    """A label, a checkerboard whose bright squares look nearer, and a step."""
    rng = np.random.default_rng(2)
    uvw = at_random(rng, noise(rng))
    u, v = uvw[:, :2].T
    squares = (np.floor(u / 0.02) + np.floor(v / 0.02)) % 2 == 1
    for raised in (np.hypot(u - 0.03, v) < 0.05, squares, v > 0.03):
        assert find_layers(uvw + np.outer(raised, [0.0, 0.0, 0.0015]), 0.0) is None
    among = rng.permutation(len(u))[: np.count_nonzero(squares)]  # as many, beside the others
    uvw[among, 2] += 0.0015
    assert find_layers(uvw, 0.0) is not None


def test_steps_of_rounding_are_no_layers():
    rng = np.random.default_rng(3)
    uvw = at_random(rng, noise(rng))
    uvw[:, 2] = 1e-3 * np.rint(1e3 * (uvw[:, 2] - 0.004 * uvw[:, 0] + 0.003 * uvw[:, 1] + 4e-4))
    assert find_layers(uvw, 0.0) is not None
    assert find_layers(uvw, 1e-3) is None


@pytest.mark.parametrize(("noise_m", "shift_mm"), [(2e-4, 1.0), (8e-4, 4.0)])
def test_stations_without_a_grid_that_disagree_along_the_normal_are_in_u(noise_m, shift_mm):
    setups = but(STATIONS, noise_m=noise_m, **NO_GRID)
    cloud, _ = merged(1, setups, np.array([0.0, 0.0, 1e-3 * shift_mm]))
    fit = fit_target(patch_of(ordered(cloud, "shuffled"), DISC), DISC, Config()).target
    assert fit.stations.significant
    assert fit.stations.count == 2
    off, u = in_units_of_u(cloud, fit)
    assert (np.abs(off) < 3.0).all()
    assert u[-1] < 0.6e-3 * shift_mm


def test_one_station_without_a_grid_stays_whole():
    for seed in range(4):
        cloud, _ = merged(seed, but(STATIONS[:1], noise_m=2e-4, **NO_GRID), of=0)
        patch = patch_of(ordered(cloud, "shuffled", seed), DISC, seed)
        assert of_stations(patch, DISC.region)[0] is patch


def test_no_layer_loses_points():
    cloud, _ = merged(5, but(STATIONS, noise_m=2e-4, **NO_GRID), np.array([0.0, 0.0, 2e-3]))
    cloud = ordered(cloud, "shuffled")
    patch = patch_of(cloud, DISC)
    parts = of_stations(patch, DISC.region)
    assert sum(len(one.face_m) for one in parts) == len(patch.face_m)
    assert sorted(len(one.around_m) for one in parts) == [0, len(patch.around_m)]
