"""Observation of one scan: what is kept of it, which wheel it shows, what is noted."""

from __future__ import annotations

import hashlib
import math
from contextlib import nullcontext
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from tests.support.scenes import Setup, make
from wheelplane.capture import Capture, ScanEntry
from wheelplane.centre import TargetFit
from wheelplane.config import Config, InstrumentConfig
from wheelplane.errors import InputError, NotMeasuredError
from wheelplane.measure import check_flat, fit_target
from wheelplane.measurement.observe import (
    NOISY,
    by_outermost,
    noisy,
    not_printed,
    observe_entries,
)
from wheelplane.measurement.plates import not_as_thick
from wheelplane.measurement.records import Evidence
from wheelplane.targets.plates import DiscTarget

DISC = DiscTarget(shape="disc", diameter=0.25, thickness=0.01)
SETUP = Setup(spacing_m=0.004, half_width_m=0.19, pairs=12)
FITTED = TargetFit(np.zeros(3), np.array([0.0, 0.0, 1.0]), (), 0.0, 5, "points")


@pytest.fixture(scope="module")
def cloud():
    return make(SETUP, 1)


@pytest.fixture(scope="module")
def scan(cloud, tmp_path_factory):
    path = tmp_path_factory.mktemp("observe") / "rl.npy"
    np.save(path, np.vstack([cloud.points_m, np.full((7, 3), np.nan)]))
    return path


def observe(scan, fit, role="reference", wheel="RL", progress=lambda _: None):
    entry = ScanEntry("RL" if role == "reference" else "1", role, wheel, scan.name, scan)
    capture = Capture("car", None, "m", DISC, None, (entry,))
    (found,) = observe_entries(capture, Config(), fit, progress)
    return found


def shows(wheel):
    """A fit of a target whose markers name `wheel`."""
    return lambda *_: Evidence(replace(FITTED, wheel=wheel))


def not_measured(*_):
    raise NotMeasuredError("wrong-outline", "its outline is bent")


def test_points_and_digest_are_those_of_the_file(scan, cloud):
    shown = []
    found = observe(scan, shows(None), progress=shown.append)
    assert shown == ["rl.npy"]
    assert (found.points_total, found.invalid_points) == (len(cloud.points_m), 7)
    assert found.sha256.endswith(hashlib.sha256(scan.read_bytes()).hexdigest())
    assert (found.name, found.role, found.wheel, found.status) == ("RL", "reference", "RL", "ok")


def test_the_fit_gets_the_target_and_its_surroundings_not_the_scene(scan, cloud):
    patches = []

    def fit(patch, target, config):
        patches.append(patch)
        return Evidence(FITTED)

    observe(scan, fit)
    (patch,) = patches
    assert len(patch.face_m) >= 0.9 * cloud.on_face.sum()
    assert np.linalg.norm(patch.origin_m - cloud.centre_m) < DISC.radius_m
    reach = np.linalg.norm(patch.face_m + patch.origin_m - cloud.centre_m, axis=1).max()
    assert reach < 1.5 * DISC.radius_m


def test_the_target_that_is_measured_is_the_true_one(scan, cloud):
    target = observe(scan, fit_target).fitted
    assert np.linalg.norm(target.centre_m - cloud.centre_m) < 1e-3
    assert np.linalg.norm(np.cross(target.normal, cloud.normal)) < 1e-3


def test_a_trial_that_is_not_measured_keeps_status_and_reason(scan):
    found = observe(scan, not_measured, role="trial")
    assert (found.evidence, found.status) == (None, "wrong-outline")
    assert found.reason == "its outline is bent"
    assert found.points_total > 0
    with pytest.raises(ValueError, match="was not measured"):
        _ = found.fitted


def test_a_reference_wheel_that_is_not_measured_is_refused_by_its_file(scan):
    with pytest.raises(InputError, match=r"car: rl\.npy: .* RL was not measured \(wrong-outline\)"):
        observe(scan, not_measured)


def test_a_scan_without_a_target_is_not_fitted(tmp_path):
    rng = np.random.default_rng(1)
    path = tmp_path / "ball.npy"
    ball = rng.normal(size=(4000, 3))
    np.save(path, ball / np.linalg.norm(ball, axis=1)[:, None] + [3.0, 0.0, 0.0])

    def fit(*_):
        raise AssertionError("there is nothing to fit")

    assert observe(path, fit, role="trial").status == "no-target"


@pytest.mark.parametrize(
    ("named", "marked", "wheel"),
    [("RL", None, "RL"), ("RL", "RL", "RL"), (None, "FR", "FR"), (None, None, None)],
)
def test_the_wheel_is_the_named_one_or_else_the_marked_one(scan, named, marked, wheel):
    assert observe(scan, shows(marked), role="trial", wheel=named).wheel == wheel


def test_a_name_that_the_markers_contradict_is_refused(scan):
    with pytest.raises(InputError, match=r"named for RL, but the markers .* those of FR: correct"):
        observe(scan, shows("FR"))


@pytest.mark.parametrize("factor", [0.5, 0.99, 1.01, 3.0])
def test_noise_is_noted_beyond_the_stated_one(scan, factor):
    found = observe(scan, fit_target)
    sigma_m = found.evidence.plane.sigma_m
    stated = InstrumentConfig(range_sigma_m=sigma_m / (NOISY * factor))
    notes = list(noisy([found, observe(scan, not_measured, role="trial")], stated))
    assert len(notes) == (factor > 1.0)
    assert all(f"{sigma_m * 1e3:.2f} mm" in note and "RL" in note for note in notes)


def test_without_stated_noise_nothing_is_noted(scan):
    found = observe(scan, fit_target)
    assert list(noisy([found], InstrumentConfig(range_sigma_m=None))) == []


@pytest.mark.parametrize(("within_m", "noted"), [(0.122, True), (0.15, False)])
def test_a_centre_by_the_outermost_points_is_noted_with_its_u(cloud, tmp_path, within_m, noted):
    """A crop leaves nothing behind the edge of a disc of 250 mm; a wider one leaves enough."""
    middle = np.asarray(cloud.centre_m)
    across = cloud.points_m - middle
    across = across - np.outer(across @ cloud.normal, cloud.normal)
    np.save(tmp_path / "rl.npy", cloud.points_m[np.linalg.norm(across, axis=1) < within_m])
    found = observe(tmp_path / "rl.npy", fit_target)
    notes = list(by_outermost([found, observe(tmp_path / "rl.npy", not_measured, role="trial")]))
    assert len(notes) == noted
    u_mm = 1e3 * math.sqrt(np.linalg.eigvalsh(found.fitted.centre_covariance_m2)[-1])
    assert all("of RL are" in note and f"up to {u_mm:.2g} mm" in note for note in notes)


def test_a_lone_point_far_off_is_noted_and_changes_nothing(scan, cloud, tmp_path):
    points = np.vstack([cloud.points_m, [[9.9e9, 0.0, 0.0]]])
    np.save(tmp_path / "rl.npy", points)
    found = observe(tmp_path / "rl.npy", fit_target)
    assert found.notes == (
        f"rl.npy: 1 of {len(points)} points lies 9.9e+06 km from the others: check its export.",
    )
    plain = observe(scan, fit_target)
    assert plain.notes == ()
    np.testing.assert_allclose(found.fitted.centre_m, plain.fitted.centre_m, atol=1e-4)
    np.testing.assert_allclose(found.fitted.normal, plain.fitted.normal, atol=1e-3)


def test_a_print_that_was_not_used_is_noted_with_its_wheels_and_why(scan):
    """One note for each reason; none of targets whose print was read."""
    reasons = {"RR": "no-intensity", "RL": None, "FR": "not-found", "FL": "no-intensity"}
    found = [
        replace(observe(scan, lambda *_, r=r: Evidence(replace(FITTED, print_missed=r))), name=name)
        for name, r in reasons.items()
    ]
    unseen, unfound = not_printed(found)
    assert unseen.startswith("The scans of RR, FL hold no intensities")
    assert unfound.startswith("The print on the targets of FR was not found")
    assert all("by the edges alone" in note for note in (unseen, unfound))
    assert not list(not_printed([replace(found[0], evidence=None), found[1]]))


def test_a_thickness_that_the_edges_contradict_is_noted_with_what_they_show(scan):
    """One note for each stated one, with the median by its scans; none of confirmed ones."""
    shown = {"RR": (0.0031, 0.01), "RL": (0.0029, 0.01), "FR": (0.01, None), "FL": (0.0033, 0.01)}
    found = [
        replace(observe(scan, lambda *_, e=e: Evidence(replace(FITTED, edge_fit=e))), name=name)
        for name, (seen_m, stated_m) in shown.items()
        for e in [SimpleNamespace(thickness_m=seen_m, stated_thickness_m=stated_m)]
    ]
    (note,) = not_as_thick(found)
    assert note.startswith(
        "By its mixed pixels, the target's edge is 3.1 mm thick, its file says 10 mm: RR, RL, FL. "
    )
    assert not list(not_as_thick([replace(found[0], evidence=None), found[2]]))


def test_what_shows_no_tilt_is_no_target():
    """Mixed pixels that passed for a disc were a trial of 53 degrees of camber, at u 3 degrees."""
    for u_deg, is_target in ((0.3, True), (3.0, False)):
        covariance = np.diag([math.radians(u_deg) ** 2, 1e-9, 0.0])
        with nullcontext() if is_target else pytest.raises(NotMeasuredError, match="tilt is known"):
            check_flat(SimpleNamespace(normal_covariance=covariance), DISC)
