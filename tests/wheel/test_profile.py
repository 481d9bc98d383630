"""Profile of a wheel about its axis, against the meridian that its points were made on."""

import numpy as np

from tests.support.round_wheels import EDGE_M, MERIDIAN, wheel_points
from wheelplane.wheel.find_wheel import find_wheel
from wheelplane.wheel.fit_wheel import fit_surface, target_of
from wheelplane.wheel.profile import SHOWN, profile_of

NOISE_M = 0.0008


def test_the_profile_is_the_meridian_and_its_residuals_the_noise_of_the_cells():
    rng = np.random.default_rng(21)
    direction = np.array([0.2, 0.9, 0.1]) / np.linalg.norm([0.2, 0.9, 0.1])
    centre = np.array([1.0, -2.0, 0.3])
    patch = find_wheel(wheel_points(rng, centre, direction, count=120_000, noise_m=NOISE_M))
    found = fit_surface(patch, None)
    profile = profile_of(found, patch)
    assert profile.method == "flange"
    assert abs(profile.ring_m[0] - EDGE_M) < 0.003
    gentle = (profile.radius_m > 0.202) & (profile.radius_m < 0.31)
    expected = np.interp(profile.radius_m, *MERIDIAN.T)
    assert np.abs(profile.height_m - expected)[gentle].max() < 0.002
    assert np.ptp(expected[gentle]) > 0.02  # a flat profile fails
    assert np.all(profile.radius_m[profile.used] < EDGE_M + 0.002)
    cells = found.fit.cells
    seen = cells.weight > 0.0
    noise = NOISE_M / np.sqrt(np.mean(cells.count[seen]))
    assert noise < np.sqrt(np.mean(profile.kept_m[:, 1] ** 2)) < 2.5 * noise
    assert max(map(len, (profile.points_m, profile.kept_m, profile.rejected_m))) <= SHOWN
    level = (target_of(found, patch).centre_m - centre) @ direction
    assert abs(level) < 0.001  # heights are counted from the centre
