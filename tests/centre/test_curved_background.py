"""Backgrounds that curve behind an edge itself, nearer to it than where they are looked up."""

from __future__ import annotations

import numpy as np

from tests.support.plates import found
from tests.support.printing import setup_of
from tests.support.scenes import Setup, Sheet, make
from wheelplane.centre.edge import edge_residuals
from wheelplane.centre.edge.edge_residuals import CURVED, _without_curve
from wheelplane.targets.registry import load_target

DISC = load_target("disc-250").model_copy(update={"chamfer": 0.0})
INCIDENCE_DEG, AZIMUTH_DEG, DISTANCE_M = 24.0, 30.0, 2.5
QUIET = Setup(
    spacing_m=0.0013,
    noise_m=0.0001,
    spot_m=0.003,
    incidence_deg=INCIDENCE_DEG,
    azimuth_deg=AZIMUTH_DEG,
    distance_m=DISTANCE_M,
    background_m=0.08,
    background_tilt_deg=0.0,
)


def stepped(depth_m: float, beyond_m: float) -> Setup:
    """A sheet before half of the background, from so far beyond the edge as it is seen on."""
    turn, slope = np.radians(AZIMUTH_DEG), np.tan(np.radians(INCIDENCE_DEG))
    u, v = -slope * depth_m * np.array([np.cos(turn), np.sin(turn)])
    inner = 0.125 * (1.0 + depth_m / DISTANCE_M) + beyond_m
    sheet = Sheet(point=(u, v, -depth_m), inner=inner, outer=0.3, spokes=1)
    return setup_of(DISC, QUIET).but(extra=(sheet,))


def test_a_background_deeper_behind_half_of_the_edge_hardly_moves_the_centre(monkeypatch):
    """By 4 mm of 80, within the footprint alone; as a rim is behind the far side of a ring."""
    clouds = [make(stepped(0.076, 0.003), seed) for seed in range(1, 4)]
    here = [found(cloud, DISC, seed) for seed, cloud in enumerate(clouds, 1)]
    monkeypatch.setattr(edge_residuals, "CURVED", 1e-9)
    taken_as_it_is = [found(cloud, DISC, seed) for seed, cloud in enumerate(clouds, 1)]
    off_m, straight_m = (
        np.sqrt(np.mean([result.error_m**2 for result in results]))
        for results in (here, taken_as_it_is)
    )
    assert straight_m > 1.3e-5
    assert off_m < 0.6 * straight_m


def test_rows_without_curves_weigh_as_the_inverse_covariance_of_all():
    """V = W^-1 + s^2 c c' in each zone, inverted as a whole."""
    rng, count = np.random.default_rng(3), 60
    zone, weight = rng.integers(0, 4, count), rng.uniform(0.0, 3.0, count)
    curve = np.where(rng.uniform(size=count) < 0.8, rng.uniform(size=count) / CURVED, 0.0)
    rows = rng.normal(size=(5, count))
    left = _without_curve(curve, weight, zone, rows)
    alike = (zone[:, None] == zone) * np.outer(curve, curve)
    inverse = np.linalg.inv(np.diag(1.0 / weight) + CURVED**2 * alike)
    np.testing.assert_allclose((left * weight) @ left.T, rows @ inverse @ rows.T, rtol=1e-9)
    plain = (rows * weight) @ rows.T
    assert np.abs(plain - rows @ inverse @ rows.T).max() > 0.1 * plain.max()
