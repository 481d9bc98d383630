"""The map of a face and the histogram of its residuals, against what was made."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from tests.support.plates import patch_of
from tests.support.printing import setup_of
from tests.support.reported import PLAIN, evidence_of, margin_m
from tests.support.scenes import make
from wheelplane.config import Config
from wheelplane.measure import fit_target
from wheelplane.measurement.residual_map import (
    BINS,
    CELLS,
    FORM_STEP,
    FORM_U_M,
    SIGMAS,
    smoothed,
)
from wheelplane.targets.registry import load_target

SHAPES = ["disc-250", "ring-300", "rectangle-360x240", "square-300", "pattern-aruco"]
EDGE_M = 0.001  # of an outline's place: the centre to 0.1 mm, the turn to 0.5 mrad at 0.2 m


def made(shape, seed=1, **changes):
    target = load_target(shape)
    cloud = make(setup_of(target, PLAIN).but(**changes), seed)
    return cloud, target, evidence_of(cloud, target, seed)


def in_map(cloud, evidence, points_m):
    """Points (N, 3) of the cloud along the map's u, v and the plane's normal, from its centre."""
    return (points_m - evidence.target.centre_m) @ evidence.plane.basis.T


@pytest.mark.parametrize("shape", SHAPES)
def test_edges_are_those_of_the_plate(shape):
    """In the plate's true axes: on its rim, on its half widths, on its holes."""
    cloud, target, evidence = made(shape)
    basis, centre = evidence.plane.basis, evidence.target.centre_m
    edges = [cloud.in_target(centre + edge @ basis[:2])[:, :2] for edge in evidence.face.edges_m]
    outer, *holes = edges
    if target.turn_period_rad:
        half = np.array(target.region.half_m)
        turned = np.abs(outer)
        swapped = target.turn_period_rad < 2.0  # a square's axes are reported but for a right angle
        fits = [np.abs(turned - h).max() for h in ((half, half[::-1]) if swapped else (half,))]
        assert min(fits) < EDGE_M
    else:
        reach = np.linalg.norm(outer, axis=1)
        np.testing.assert_allclose(reach, target.region.radius_m, atol=EDGE_M)
    assert len(holes) == len(target.region.holes_m)
    true = target.region.holes_m[:, :2]
    for hole in holes:
        middle = hole.mean(axis=0)
        nearest = np.argmin(np.linalg.norm(true - middle, axis=1))
        assert np.linalg.norm(true[nearest] - middle) < EDGE_M
        reach = np.linalg.norm(hole - middle, axis=1)
        np.testing.assert_allclose(reach, target.region.holes_m[nearest, 2], atol=1e-9)


@pytest.mark.parametrize("shape", SHAPES)
def test_the_face_is_reported_from_what_lies_beside_it(shape):
    cloud, target, evidence = made(shape)
    local = cloud.in_target(cloud.points_m)
    shown = evidence.face.on_face(in_map(cloud, evidence, cloud.points_m))
    inside = target.region.shrunk(0.004).holds(local[:, :2]) & (np.abs(local[:, 2]) < 0.004)
    outside = ~target.region.shrunk(-0.004).holds(local[:, :2]) | (np.abs(local[:, 2]) > 0.03)
    assert np.count_nonzero(inside) > 3000
    assert shown[inside].all()
    assert not shown[outside].any()


@pytest.mark.parametrize("shape", SHAPES)
def test_the_histogram_counts_the_points_clear_of_the_edges(shape):
    """Of normal noise: mean 0 and deviation sigma within 5 of their own deviations.

    A cell of the map is 1.25 r/120, 1.6 mm at most, so that points that near to the margin may be
    on either side of it.
    """
    cloud, target, evidence = made(shape)
    face, n = evidence.face, evidence.face.counts.sum()
    local = cloud.in_target(cloud.points_m)
    flat = np.abs(local[:, 2]) < 0.006
    most, least = (
        np.count_nonzero(target.region.shrunk(margin_m() + off).holds(local[:, :2]) & flat)
        for off in (-0.003, 0.003)
    )
    assert least <= n <= most
    assert face.span_m == pytest.approx(SIGMAS * evidence.plane.sigma_m)
    middles = ((np.arange(BINS) + 0.5) / BINS * 2.0 - 1.0) * face.span_m
    mean = np.average(middles, weights=face.counts)
    deviation = np.sqrt(np.average((middles - mean) ** 2, weights=face.counts))
    sigma, bin_m = PLAIN.noise_m, 2.0 * face.span_m / BINS
    assert abs(mean) < 5.0 * sigma / np.sqrt(n) + 1e-5
    # noise runs along the beam, at up to 20 degrees to the normal
    low, high = sigma * np.cos(np.radians(22.0)), np.hypot(sigma, bin_m)
    assert low * (1 - 5 / np.sqrt(2 * n)) < deviation < high * (1 + 5 / np.sqrt(2 * n))


def test_what_stands_out_towards_the_scanner_is_positive_and_in_its_place():
    """A bump of 1.5 mm: there in the map, and in the bins of the histogram beyond one sigma."""
    cloud, target, _ = made("disc-250", noise_m=0.0003)
    local = cloud.in_target(cloud.points_m)
    bump = (np.hypot(local[:, 0] - 0.05, local[:, 1]) < 0.02) & cloud.on_face
    assert np.count_nonzero(bump) > 100
    cloud.points_m[bump] += 0.0015 * cloud.normal
    evidence = evidence_of(cloud, target, 1)
    place = in_map(cloud, evidence, cloud.points_m[bump].mean(axis=0)[None])[0]
    face = evidence.face
    column = int((place[0] + face.half_width_m) * CELLS / (2 * face.half_width_m))
    row = int((-place[1] + face.half_width_m) * CELLS / (2 * face.half_width_m))
    near = face.residual_m[row - 5 : row + 6, column - 5 : column + 6]
    assert np.nanmean(near) == pytest.approx(0.0015, abs=0.0003)
    across = face.residual_m[CELLS - row - 6 : CELLS - row + 5, CELLS - column - 6 : CELLS - column]
    assert abs(np.nanmean(across)) < 0.0003


@pytest.mark.parametrize("share", [0.1, 0.6])
def test_smoothing_shows_a_form_of_a_tenth_of_a_millimetre_under_the_noise(share):
    """A bow of 0.1 mm under noise of 0.8 mm, in a share of the cells: to the stated u, and no more.

    u_m is the root mean square; the map has some 60 independent values, hence within a third.
    """
    face = made("disc-250")[2].face
    noise_m, height_m = 8e-4, 1e-4
    tick = (np.arange(CELLS) + 0.5) * 2 * face.half_width_m / CELLS - face.half_width_m
    bow = height_m * np.cos(np.pi * np.add.outer(0.0 * tick, tick) / face.radius_m)
    rng = np.random.default_rng(5)
    noise = noise_m * rng.normal(size=bow.shape)
    noise[rng.uniform(size=bow.shape) > share] = np.nan
    form = smoothed(replace(face, residual_m=(bow + noise).astype(np.float32)))
    smooth = smoothed(replace(face, residual_m=bow.astype(np.float32)))
    known = np.isfinite(form.deviation_m)
    true = bow[FORM_STEP // 2 :: FORM_STEP, FORM_STEP // 2 :: FORM_STEP][known]
    error = form.deviation_m[known] - true
    area = np.pi * face.radius_m**2
    assert np.count_nonzero(known) * (FORM_STEP * 2 * face.half_width_m / CELLS) ** 2 == (
        pytest.approx(area, rel=0.05)
    )
    assert form.u_m < 1.7 * FORM_U_M  # at the edge, half of the Gaussian is empty
    assert np.sqrt(np.mean(error**2)) < 1.5 * form.u_m + 0.35 * height_m
    assert np.corrcoef(form.deviation_m[known], true)[0, 1] > 0.6
    flat = smoothed(replace(face, residual_m=noise.astype(np.float32)))
    assert np.nanstd(flat.deviation_m) == pytest.approx(flat.u_m, rel=0.35)
    assert np.nanmax(smooth.deviation_m) > 0.6 * height_m


def test_a_target_is_the_same_whether_its_residuals_are_mapped_or_not():
    cloud, target, _ = made("disc-250")
    patch = patch_of(cloud, target, 1)
    plain, mapped = (fit_target(patch, target, Config(), mapped=way) for way in (False, True))
    assert plain.face is None
    assert mapped.face is not None
    assert np.array_equal(plain.target.covariance, mapped.target.covariance)
    assert np.array_equal(plain.target.centre_m, mapped.target.centre_m)
    assert np.array_equal(plain.plane.basis, mapped.plane.basis)
