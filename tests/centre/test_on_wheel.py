"""Targets that stand off: their centres carried to the wheels, and unlike ones on an axle."""

import numpy as np
import pytest

from wheelplane.centre.locate_centre import TargetFit
from wheelplane.centre.on_wheel import (
    MOST_BULGE_M,
    MOST_M,
    off_tyre,
    on_wheel,
    unlike_wheels,
    with_unstated,
)
from wheelplane.targets import load_target, parse_target
from wheelplane.uncertainty import UncertaintyComponent

BARE, DISC = load_target("wheel"), load_target("disc-250")
HELD = DISC.model_copy(update={"stand_off": 0.085, "stand_off_u": 0.0005})
NORMAL = np.array([0.01, 1.0, -0.02]) / np.linalg.norm([0.01, 1.0, -0.02])
CENTRE = np.array([0.3, 0.8, 0.31])


def fit(sign=1.0):
    factor = np.random.default_rng(1).normal(size=(6, 3)) * 1e-4
    components = (UncertaintyComponent("plane noise", factor),)
    return TargetFit(CENTRE, sign * NORMAL, components, 1e-4, 1000, "rim")


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_the_centre_is_carried_inwards_whichever_way_the_normal_was_fitted(sign):
    moved = on_wheel(fit(sign), HELD, NORMAL)
    assert np.allclose(moved.centre_m, CENTRE - 0.085 * NORMAL, atol=1e-15)


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_its_covariance_is_that_of_carrying_each_draw(sign):
    given = fit(sign)
    moved = on_wheel(given, HELD, NORMAL)
    rng = np.random.default_rng(2)
    draws = rng.normal(size=(200_000, 3)) @ given.components[0].factor.T
    stand_off = 0.085 + 0.0005 * rng.normal(size=len(draws))
    normals = given.normal + draws[:, :3]
    centres = given.centre_m + draws[:, 3:] - sign * stand_off[:, None] * normals
    found = np.cov(np.hstack([draws[:, :3], centres]), rowvar=False)
    size = np.sqrt(np.outer(np.diag(found), np.diag(found)))
    assert np.abs((found - moved.covariance) / size).max() < 5.0 / np.sqrt(len(draws))
    assert np.abs((found - given.covariance) / size).max() > 0.1


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_a_tyre_s_ring_is_carried_inwards_by_the_bulge_and_by_half_the_most_where_unknown(sign):
    moved, unknown = (off_tyre(fit(sign), bulge, NORMAL, "RL") for bulge in (0.012, None))
    assert np.allclose(moved.centre_m, CENTRE - 0.012 * NORMAL, atol=1e-15)
    assert np.allclose(unknown.centre_m, CENTRE - MOST_BULGE_M / 2.0 * NORMAL, atol=1e-15)
    along = np.sqrt(NORMAL @ unknown.components[-1].covariance[3:, 3:] @ NORMAL)
    draws = np.random.default_rng(3).uniform(0.0, MOST_BULGE_M, 100_000)
    assert along == pytest.approx(draws.std(), rel=0.01)
    assert moved.components[-1].shared == "tyre of RL"


def test_a_target_without_a_stated_stand_off_and_a_bare_wheel_stay():
    assert on_wheel(fit(), DISC, NORMAL) is None
    assert on_wheel(fit(), BARE, NORMAL) is None


@pytest.mark.parametrize(
    ("targets", "unlike"),
    [
        ([DISC] * 4, ()),
        ([BARE] * 4, ()),
        ([DISC, DISC, BARE, BARE], ()),
        ([DISC, BARE, BARE, BARE], ("RR",)),
        ([DISC, BARE, BARE, DISC], ("RR", "FL")),
        ([HELD, BARE, BARE, HELD], ()),
        ([HELD, DISC, BARE, BARE], ("RL",)),
        ([DISC, load_target("ring-300"), BARE, BARE], ("RR", "RL")),
    ],
)
def test_wheels_unlike_the_other_side_are_named(targets, unlike):
    assert unlike_wheels(targets) == unlike


def test_an_unstated_stand_off_counts_along_the_axle_by_its_root_mean_square():
    added = with_unstated(fit(), DISC, NORMAL).components[-1]
    along = np.sqrt(NORMAL @ added.covariance[3:, 3:] @ NORMAL)
    assert abs(along - MOST_M / np.sqrt(3.0)) < 1e-12
    assert np.trace(added.covariance) == pytest.approx(along**2)


@pytest.mark.parametrize(
    ("more", "fact"),
    [({"stand_off": 0.08}, "state both"), ({"stand_off_u": 0.001}, "state both")],
)
def test_a_stand_off_has_its_uncertainty(more, fact):
    with pytest.raises(Exception, match=fact):
        parse_target({"shape": "disc", "diameter": 0.25, **more}, "disc")


def test_a_bare_wheel_has_none():
    with pytest.raises(Exception, match="a bare wheel has no stand_off"):
        parse_target({"shape": "wheel", "stand_off": 0.08, "stand_off_u": 0.0}, "wheel")
