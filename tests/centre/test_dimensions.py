"""Centres by the dimensions that all plates of one drawing show, against all unknowns at once."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from wheelplane.centre.edge.beams import CHAMFER_M, SIZE_M, STATED_THICKNESS
from wheelplane.centre.edge.dimensions import ALIKE, LAST, Dimensions
from wheelplane.centre.locate_centre import TargetFit
from wheelplane.measurement.plates import with_alike_plates
from wheelplane.uncertainty import centre_component, plane_component

KNOWN = np.array([STATED_THICKNESS, SIZE_M, CHAMFER_M])
MEAN = np.array([np.log(0.01), 0.0, 0.0])
UNITS = np.array([1e-4, 1e-4, *KNOWN])  # of centre and dimensions
PLATES = ("RR", "RL", "RR")


def basis_of(rng):
    return np.linalg.qr(rng.normal(size=(3, 3)))[0].T


def alone(rng, shift=0.0, chamfer=8e-4):
    """What one scan shows of centre and dimensions without what is known: values, covariance."""
    root = 0.4 * rng.normal(size=(5, 5)) + 0.6 * np.eye(5)
    value = np.append(np.zeros(2), MEAN) + 0.3 * UNITS * rng.normal(size=5)
    value[2 + LAST] += chamfer
    return value + shift * UNITS, UNITS[:, None] * (root @ root.T) * UNITS


def fit_of(value, covariance, rng, **changes):
    """The fit of one scan, with what is known beforehand of its dimensions."""
    information = np.linalg.inv(covariance)
    known = np.append(np.zeros(2), KNOWN**-2.0)
    posterior = np.linalg.inv(information + np.diag(known))
    state = posterior @ (information @ value + known * np.append(np.zeros(2), MEAN))
    own, move = posterior[2:, 2:], posterior[:2, 2:] @ np.linalg.inv(posterior[2:, 2:])
    dimensions = Dimensions(
        value=state[2:],
        covariance=own,
        mean=MEAN,
        weight=KNOWN**-2.0,
        centre_m=state[:2],
        move=move,
        noise_m2=posterior[:2, :2] - move @ own @ move.T,
        by_plane=0.3 * KNOWN[:, None] / 1e-4 * rng.normal(size=(3, 3)),
    )
    edge = SimpleNamespace(
        is_clean=False, converged=True, dimensions=dimensions, centre_m=state[:2], dof=np.inf
    )
    edge.__dict__.update(changes.pop("edge", {}))
    basis = basis_of(rng)
    plane = 1e-8 * np.diag([1.0, 9.0, 4.0])
    fit = TargetFit(
        centre_m=basis[:2].T @ edge.centre_m + 0.7 * basis[2],
        normal=basis[2],
        components=(
            plane_component("plane noise", plane, basis, np.zeros(3), rng.normal(size=(2, 3))),
            centre_component("centre noise", posterior[:2, :2], basis),
            centre_component("centre model", 1e-12 * np.eye(2), basis),
        ),
        plane_rms_m=0.0,
        points_on_target=1,
        method="rim",
        edge_fit=edge,
    )
    return replace(fit, **changes), basis


def scans(seed, count=3, **changes):
    """What each scan shows alone, and their fits and bases."""
    rng = np.random.default_rng(seed)
    shown = [alone(rng, **changes) for _ in range(count)]
    fits, bases = zip(*(fit_of(*one, rng) for one in shown), strict=True)
    return shown, list(fits), list(bases)


def before(count):
    """Covariance of the dimensions of so many plates beforehand."""
    common, own = np.diag(KNOWN**2 - ALIKE**2), np.diag(ALIKE**2)
    return np.kron(np.ones((count, count)), common) + np.kron(np.eye(count), own)


def at_once(shown, plates):
    """Centres (N, 2) with their covariance (2 N, 2 N), by one solution for them and all plates."""
    names = sorted(set(plates))
    count, dimensions = 2 * len(shown), 3 * len(names)
    known = np.linalg.inv(before(len(names)))
    information = np.zeros((count + dimensions, count + dimensions))
    information[count:, count:] = known
    pull = np.append(np.zeros(count), known @ np.tile(MEAN, len(names)))
    for k, (value, covariance) in enumerate(shown):
        first = count + 3 * names.index(plates[k])
        here = [2 * k, 2 * k + 1, first, first + 1, first + 2]
        information[np.ix_(here, here)] += np.linalg.inv(covariance)
        pull[here] += np.linalg.solve(covariance, value)
    covariance = np.linalg.inv(information)
    return (covariance @ pull)[:count].reshape(-1, 2), covariance[:count, :count]


def in_plane(fits, bases):
    """Centres (N, 2) in their planes, and their covariance (2 N, 2 N) by edges alone."""
    centres = np.array([b[:2] @ fit.centre_m for fit, b in zip(fits, bases, strict=True)])
    own = np.zeros((2 * len(fits), 2 * len(fits)))
    moves = np.zeros((2 * len(fits), 3 * len(fits)))
    for k, (fit, basis) in enumerate(zip(fits, bases, strict=True)):
        here = slice(2 * k, 2 * k + 2)
        for part in fit.components:
            if part.name == "centre noise":
                own[here, here] += basis[:2] @ part.factor[3:] @ part.factor[3:].T @ basis[:2].T
            if part.shared is not None:
                moves[here, : part.factor.shape[1]] = basis[:2] @ part.factor[3:]
    return centres, own + moves @ moves.T


def test_centres_and_their_covariance_are_those_of_all_unknowns_at_once():
    for seed in range(5):
        shown, fits, bases = scans(seed)
        centres, covariance = in_plane(with_alike_plates(fits, bases, PLATES), bases)
        expected, expected_m2 = at_once(shown, PLATES)
        np.testing.assert_allclose(centres, expected, atol=1e-9)
        np.testing.assert_allclose(covariance, expected_m2, atol=1e-6 * expected_m2.max())
        alone_m = np.array([b[:2] @ fit.centre_m for fit, b in zip(fits, bases, strict=True)])
        assert np.abs(centres - alone_m).max() > 5e-6  # it does matter
        cross = covariance[:2, 2:4]
        assert np.abs(cross).max() > 0.01 * covariance.max()


def test_the_order_of_scans_does_not_matter():
    _, fits, bases = scans(1)
    found = with_alike_plates(fits, bases, PLATES)
    turned = with_alike_plates(fits[::-1], bases[::-1], PLATES[::-1])[::-1]
    for one, other in zip(found, turned, strict=True):
        np.testing.assert_allclose(one.centre_m, other.centre_m, atol=1e-12)
        np.testing.assert_allclose(one.covariance, other.covariance, atol=1e-18)


def test_a_plate_unlike_the_others_is_left_as_it_is_and_they_without_it():
    rng = np.random.default_rng(3)
    shown, fits, bases = scans(3, count=4)
    value, covariance = shown[2]
    off = np.array([0.0, 0.0, 12.0 * np.sqrt(covariance[2, 2]), 0.0, 0.0])
    fits[2], bases[2] = fit_of(value + off, covariance, rng)
    plates = ("RR", "RL", "FR", "FL")
    found = with_alike_plates(fits, bases, plates)
    assert found[2] is fits[2]
    kept = [0, 1, 3]
    others = with_alike_plates(
        [fits[k] for k in kept], [bases[k] for k in kept], [plates[k] for k in kept]
    )
    for k, other in zip(kept, others, strict=True):
        np.testing.assert_array_equal(found[k].centre_m, other.centre_m)


@pytest.mark.parametrize(
    "changes",
    [
        {"method": "combined"},
        {"stations": SimpleNamespace()},
        {"turn": SimpleNamespace()},
        {"edge_fit": None},
        {"edge": {"is_clean": True}},
        {"edge": {"converged": False}},
        {"edge": {"dimensions": None}},
    ],
)
def test_a_centre_that_is_not_by_a_round_rim_alone_stays(changes):
    rng = np.random.default_rng(4)
    (one, other), (fit, basis) = (alone(rng), alone(rng)), fit_of(*alone(rng), rng)
    found, place = fit_of(*one, rng, **changes)
    beside, aside = fit_of(*other, rng)
    assert with_alike_plates([found], [place], ["RR"]) == [found]
    first, *rest = with_alike_plates([found, beside, fit], [place, aside, basis], PLATES)
    assert first is found
    pair = with_alike_plates([beside, fit], [aside, basis], PLATES[1:])
    for k in range(2):
        assert rest[k] is not (beside, fit)[k]
        np.testing.assert_array_equal(rest[k].centre_m, pair[k].centre_m)


def test_a_plane_moves_the_centre_as_its_component_says():
    """By the centre of its own scan, and by the dimensions that this plane shows with it."""
    rng = np.random.default_rng(5)
    _, fits, bases = scans(5)
    found = with_alike_plates(fits, bases, PLATES)
    part = fits[0].components[0]
    at_centre = np.vstack([bases[0][2] @ part.factor[3:], -bases[0][:2] @ part.factor[:3]])
    own = bases[0][:2] @ part.factor[3:] @ np.linalg.inv(at_centre)
    edge = fits[0].edge_fit
    for off in 1e-4 * rng.normal(size=(3, 3)):
        by_dimensions = edge.dimensions.by_plane @ off
        aside = own @ off
        dimensions = replace(
            edge.dimensions,
            value=edge.dimensions.value + by_dimensions,
            centre_m=edge.dimensions.centre_m + aside,
        )
        changed = SimpleNamespace(**{**vars(edge), "dimensions": dimensions})
        changed.centre_m = edge.centre_m + aside
        shifted = replace(
            fits[0], edge_fit=changed, centre_m=fits[0].centre_m + bases[0][:2].T @ aside
        )
        moved = with_alike_plates([shifted, *fits[1:]], bases, PLATES)[0]
        after = found[0].components[0]
        expected = bases[0][:2] @ after.factor[3:] @ np.linalg.solve(at_centre, off)
        seen = bases[0][:2] @ (moved.centre_m - found[0].centre_m)
        np.testing.assert_allclose(seen, expected, atol=1e-9)
        assert np.abs(seen - aside).max() > 0.01 * np.abs(aside).max()


def test_errors_of_centres_are_as_large_as_their_covariance_and_no_chamfer_is_below_zero():
    """Plates drawn as they are known, sharp ones among them."""
    rng, squares = np.random.default_rng(6), []
    plates = ("RR", "RL", "FR", "FL")
    root = np.linalg.cholesky(before(4))
    for _ in range(300):
        true = np.tile(MEAN, 4) + root @ rng.normal(size=12)
        true[LAST::3] = np.abs(true[LAST::3]).clip(min=0.0)
        shown, fits, bases = [], [], []
        for k in range(4):
            _, covariance = alone(rng)
            value = np.append(np.zeros(2), true[3 * k : 3 * k + 3])
            seen = value + np.linalg.cholesky(covariance) @ rng.normal(size=5)
            shown.append((seen, covariance))
            fit, basis = fit_of(seen, covariance, rng)
            fits.append(fit)
            bases.append(basis)
        centres, covariance = in_plane(with_alike_plates(fits, bases, plates), bases)
        squares.append(centres.ravel() @ np.linalg.solve(covariance, centres.ravel()) / 8.0)
    assert 0.85 < np.mean(squares) < 1.15
