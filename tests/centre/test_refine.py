"""Printed features are located where they are, and nothing is located where there are none."""

from __future__ import annotations

import math

import numpy as np
import pytest

from wheelplane.centre.pattern.refine import crossing, place_feature, round_spot

BLUR = 0.0015
RADIUS = 0.01
SHADES = {"circle": round_spot(RADIUS), "crossing": crossing(0.3)}
LEVELS = {"circle": [0.9, -0.6], "crossing": [0.8, -0.5, 0.3, 0.2]}


def feature(kind, true, noise=0.0, count=1200, seed=0):
    """Points about the origin, and intensities of a feature at `true`."""
    rng = np.random.default_rng(seed)
    q = rng.uniform(-1.6 * RADIUS, 1.6 * RADIUS, (count, 2))
    blur = np.full(count, BLUR)
    terms = SHADES[kind](q - true, blur).terms
    return q, terms @ LEVELS[kind] + noise * rng.normal(size=count), blur


@pytest.mark.parametrize("kind", SHADES)
def test_derivatives_are_those_of_the_terms(kind):
    q, _, blur = feature(kind, np.zeros(2))
    shading, step = SHADES[kind](q, blur), 1e-8
    for k, slopes in enumerate((shading.by_u, shading.by_v)):
        d = step * np.eye(2)[k]
        difference = (SHADES[kind](q + d, blur).terms - SHADES[kind](q - d, blur).terms) / (
            2 * step
        )
        largest = np.abs(difference).max()
        close = np.abs(slopes - difference).max(axis=1) < 0.02 * largest
        assert largest > 1.0 / BLUR / 4.0
        assert close.mean() > 0.99  # but for points within a step of the table's nodes


@pytest.mark.parametrize("true", [(0.0, 0.0), (0.002, -0.001), (-0.0025, 0.0025)])
@pytest.mark.parametrize("kind", SHADES)
def test_without_noise_the_position_is_exact(kind, true):
    q, intensity, blur = feature(kind, np.array(true))
    found = place_feature(q, intensity, blur, SHADES[kind])
    np.testing.assert_allclose(found, true, atol=1e-3 * BLUR)


@pytest.mark.parametrize("kind", SHADES)
def test_gain_offset_polarity_and_order_of_the_points_do_not_matter(kind):
    q, intensity, blur = feature(kind, np.array([0.001, 0.002]), noise=0.02)
    here = place_feature(q, intensity, blur, SHADES[kind])
    order = np.random.default_rng(1).permutation(len(q))
    for changed in (300.0 * intensity + 7.0, -intensity):
        there = place_feature(q[order], changed[order], blur, SHADES[kind])
        np.testing.assert_allclose(there, here, atol=1e-6 * BLUR)


@pytest.mark.parametrize("kind", SHADES)
def test_error_falls_with_the_square_root_of_the_points(kind):
    rms = []
    for count in (300, 4800):
        errors = []
        for seed in range(12):
            q, intensity, blur = feature(kind, np.zeros(2), 0.05, count, seed)
            errors.append(place_feature(q, intensity, blur, SHADES[kind]))
        rms.append(math.sqrt(np.mean(np.square(errors))))
    assert 2.5 < rms[0] / rms[1] < 6.5  # 4, within what 24 numbers show


@pytest.mark.parametrize("kind", SHADES)
def test_nothing_is_found_where_there_is_nothing(kind):
    rng = np.random.default_rng(3)
    q, intensity, blur = feature(kind, np.zeros(2), noise=0.05)
    assert place_feature(q[:10], intensity[:10], blur[:10], SHADES[kind]) is None
    noise = 1.0 + 0.05 * rng.normal(size=len(q))
    assert place_feature(q, noise, blur, SHADES[kind]) is None


def test_one_straight_edge_is_no_crossing():
    """Along an edge nothing fixes the position."""
    q, _, blur = feature("crossing", np.zeros(2))
    a = np.array([math.cos(0.3), math.sin(0.3)])
    edge = (q @ a > 0.0).astype(float)
    assert place_feature(q, edge, blur, SHADES["crossing"]) is None
