"""The vehicle frame: the paper's definition, its three rotations, and what defines no frame."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from wheelplane.errors import InputError
from wheelplane.vehicle.frame import (
    REFERENCE_WHEELS,
    VehicleFrame,
    build_reference_frame,
    rotation_by_basis,
)

EPS = np.finfo(float).eps
# A car whose axes are left = y, forward = x, up = z; RR, RL, FR, FL.
RECTANGLE = np.array([[0, -0.75, 0], [0, 0.75, 0], [2.6, -0.75, 0], [2.6, 0.75, 0]])


def car(rng: np.random.Generator) -> np.ndarray:
    """Four centres, each off the rectangle by up to 0.1 m, in a random pose."""
    offsets = rng.uniform(-0.1, 0.1, (4, 3))
    return Rotation.random(rng=rng).apply(RECTANGLE + offsets) + rng.uniform(-5, 5, 3)


def rotation_by_rodrigues(frame: VehicleFrame) -> np.ndarray:
    """Return the rotation of `rotation_by_basis` by Rodrigues' formula, then one about x.

    The formula about k = i x u_R by omega takes i to u_R; its transpose takes u_R to i.
    Source: the paper, equations (2, 3), with k normalised in every term.
    """
    k, omega = _axis_and_angle(frame.left)
    k_cross = np.array([[0, -k[2], k[1]], [k[2], 0, -k[0]], [-k[1], k[0], 0]])
    M = np.cos(omega) * np.eye(3) + np.sin(omega) * k_cross
    M += (1 - np.cos(omega)) * np.outer(k, k)
    return _with_front_axle_on_y(M.T, frame)


def rotation_by_quaternion(frame: VehicleFrame) -> np.ndarray:
    """Return the rotation of `rotation_by_basis` by the quaternion matrix, then one about x.

    Source: the paper, equation (5), with a = cos(omega/2) where it prints a sine.
    """
    k, omega = _axis_and_angle(frame.left)
    a, (b, c, d) = np.cos(omega / 2), k * np.sin(omega / 2)
    M = np.array(
        [
            [a * a + b * b - c * c - d * d, 2 * (b * c - a * d), 2 * (b * d + a * c)],
            [2 * (b * c + a * d), a * a + c * c - b * b - d * d, 2 * (c * d - a * b)],
            [2 * (b * d - a * c), 2 * (c * d + a * b), a * a + d * d - b * b - c * c],
        ]
    )
    return _with_front_axle_on_y(M.T, frame)


def _axis_and_angle(u_R: np.ndarray) -> tuple[np.ndarray, float]:
    """Return k = i x u_R normalised, and omega; where they are parallel any k across i serves."""
    sine = float(np.hypot(u_R[1], u_R[2]))
    k = np.array([0.0, -u_R[2] / sine, u_R[1] / sine]) if sine > 0 else np.array([0.0, 1.0, 0.0])
    return k, float(np.arctan2(sine, u_R[0]))


def _with_front_axle_on_y(R: np.ndarray, frame: VehicleFrame) -> np.ndarray:
    """Follow R with the paper's last rotation, about x, which brings the thrust axis to y."""
    _, y, z = R @ frame.forward
    cosine, sine = np.array([y, z]) / np.hypot(y, z)
    about_x: np.ndarray = np.array([[1.0, 0.0, 0.0], [0.0, cosine, sine], [0.0, -sine, cosine]])
    return about_x @ R


ROTATIONS = (rotation_by_basis, rotation_by_rodrigues, rotation_by_quaternion)


def axes(frame: VehicleFrame) -> np.ndarray:
    return np.array([frame.left, frame.forward, frame.up])


def test_no_user_of_a_frame_can_alter_it_for_the_next():
    """The frame of the same centres is built once, and shared."""
    before = build_reference_frame(RECTANGLE)
    for array in (before.origin_m, before.left, before.forward, before.up):
        with pytest.raises(ValueError, match="read-only"):
            array += 1.0
    np.testing.assert_array_equal(axes(build_reference_frame(RECTANGLE)), axes(before))


def test_rectangle_gives_its_own_axes():
    frame = build_reference_frame(RECTANGLE)
    np.testing.assert_allclose(axes(frame), [[0, 1, 0], [1, 0, 0], [0, 0, 1]], atol=4 * EPS)
    assert frame.origin_m == pytest.approx([0, 0, 0], abs=4 * EPS)
    sizes = (frame.rear_track_m, frame.front_track_m, frame.wheelbase_m)
    assert sizes == pytest.approx((1.5, 1.5, 2.6), abs=8 * EPS)
    ends = frame.to_vehicle(RECTANGLE)
    np.testing.assert_allclose(ends[3], [0.75, 2.6, 0], atol=8 * EPS)  # FL: left, in front, level


@pytest.mark.parametrize("seed", range(20))
def test_frame_keeps_the_definition(seed):
    centres = car(np.random.default_rng(seed))
    frame = build_reference_frame(centres)
    R = frame.R_vehicle_scanner
    np.testing.assert_allclose(R @ R.T, np.eye(3), atol=10 * EPS)
    np.testing.assert_allclose(np.cross(frame.forward, frame.left), frame.up, atol=10 * EPS)
    rr, rl, fr, fl = frame.to_vehicle(centres)
    np.testing.assert_allclose(rl, [frame.rear_track_m / 2, 0, 0], atol=100 * EPS)
    np.testing.assert_allclose(rr, -rl, atol=100 * EPS)
    # e = (0, wheelbase, 0) lies on the front axle line
    e = np.array([0, frame.wheelbase_m, 0])
    np.testing.assert_allclose(np.cross(e - fr, fl - fr), 0, atol=1000 * EPS)
    assert frame.front_track_m == pytest.approx(np.sqrt(((fl - fr) ** 2).sum()), abs=100 * EPS)


@pytest.mark.parametrize("seed", range(20))
def test_three_derivations_agree(seed):
    frame = build_reference_frame(car(np.random.default_rng(seed)))
    basis, rodrigues, quaternion = (rotation(frame) for rotation in ROTATIONS)
    np.testing.assert_allclose(rodrigues, basis, rtol=0, atol=1e-12)
    np.testing.assert_allclose(quaternion, basis, rtol=0, atol=1e-12)
    assert np.linalg.det(basis) == pytest.approx(1, abs=1e-12)
    np.testing.assert_allclose(basis @ frame.left, [1, 0, 0], atol=1e-12)
    np.testing.assert_allclose(basis @ frame.up, [0, 0, -1], atol=1e-12)
    assert np.abs(basis - basis.T).max() > 1e-3  # the transposed rotation would not pass


@pytest.mark.parametrize("sign", [1, -1])
@pytest.mark.parametrize("tilt", [0, 1e-300, 1e-160, 1e-17, 1e-9, 1e-8, 1e-4])
@pytest.mark.parametrize("roll", [0.0, 0.3, 2.0, -3.1])
def test_three_derivations_agree_where_the_axle_is_parallel_to_x(sign, tilt, roll):
    left = np.array([sign * np.sqrt(1 - tilt**2), tilt * 0.6, -tilt * 0.8])
    level = np.array([0, np.cos(roll), np.sin(roll)])
    forward = level - (level @ left) * left
    forward /= np.linalg.norm(forward)
    frame = VehicleFrame(np.zeros(3), left, forward, np.cross(forward, left), 1.5, 1.5, 2.6)
    basis = rotation_by_basis(frame)
    np.testing.assert_allclose(rotation_by_rodrigues(frame), basis, rtol=0, atol=1e-12)
    np.testing.assert_allclose(rotation_by_quaternion(frame), basis, rtol=0, atol=1e-12)


@pytest.mark.parametrize("seed", range(10))
def test_frame_turns_and_shifts_with_the_car(seed):
    rng = np.random.default_rng(seed)
    centres = car(rng)
    turn, shift = Rotation.random(rng=rng), rng.uniform(-1, 1, 3) * 1e7
    before, after = (
        build_reference_frame(centres),
        build_reference_frame(turn.apply(centres) + shift),
    )
    # A coordinate of 1e7 m is known to half a step; two centres make an axle, a lever of 0.65 m.
    half_step = np.spacing(1e7) / 2
    tolerance = 8 * half_step * np.sqrt(3) / 0.65
    np.testing.assert_allclose(axes(after), turn.apply(axes(before)), rtol=0, atol=tolerance)
    assert after.wheelbase_m == pytest.approx(before.wheelbase_m, abs=tolerance)
    assert np.abs(axes(after) - axes(before)).max() > 1000 * tolerance


def test_mirrored_car_has_the_mirrored_frame():
    centres = car(np.random.default_rng(5))
    mirror = np.diag([1.0, -1.0, 1.0])
    before = build_reference_frame(centres)
    after = build_reference_frame((centres @ mirror)[[1, 0, 3, 2]])
    expected = axes(before) @ mirror * [[-1], [1], [1]]
    np.testing.assert_allclose(axes(after), expected, atol=100 * EPS)


DIAGONALS = RECTANGLE[[0, 3, 1, 2]]
BAD = {
    "equal": (RECTANGLE[[0, 1, 2, 2]], "FR and FL are only 0.0000 m apart"),
    "all equal": (RECTANGLE[[0, 0, 0, 0]], "RR and RL are only 0.0000 m apart"),
    "near": (np.vstack([RECTANGLE[:3], RECTANGLE[1] + 0.001]), "RL and FL are only 0.0017 m"),
    "collinear": (np.outer([0, 1, 2, 3], [1, 2, 3]), "RR, RL, FR lie on one line"),
    "three": ([[0, 0, 0], [0, 1, 0], [0.01, 2, 0], [2, 1, 0]], "RR, RL, FR lie on one line"),
    "three of the front": (
        [[0, 0, 0], [0, 1.5, 0], [2, 0, 0], [1, 0.75, 0]],
        "RL, FR, FL lie on one line",
    ),
    "perpendicular": ([[0, 0, 0], [0, 1.5, 0], [1, 0.7, 0], [2.5, 0.7, 0]], "90.00°"),
    "diagonals": (DIAGONALS, "passes 0.0000 m from the middle"),
    "nan": (np.where(np.eye(4, 3) == 1, np.nan, RECTANGLE), "wheel RR is \\(nan, "),
    "inf": (RECTANGLE + np.array([[0], [np.inf], [0], [0]]), "wheel RL is \\(inf, "),
    "huge": (RECTANGLE * 1e200, "below 1e\\+10 m"),
    "three wheels": (RECTANGLE[:3], "needs 4 wheel centres"),
}


@pytest.mark.parametrize("name", BAD)
def test_no_frame_is_one_line_with_the_fact_and_what_to_do(name):
    centres, fact = BAD[name]
    with pytest.raises(InputError, match=fact) as caught:
        build_reference_frame(centres)
    text = str(caught.value)
    assert "\n" not in text
    assert ": " in text
    assert any(wheel in text for wheel in REFERENCE_WHEELS)


@pytest.mark.parametrize("height", [0.04, 0.06])
def test_limit_of_collinearity_is_a_share_of_the_spread(height):
    """Spread 2.8 m, so 0.14 m; FR is at `height` of the spread from the line RR-RL."""
    spread = 2.8
    centres = [[0, 0, 0], [0, spread, 0], [height * spread, 1.4, 0], [1.4, 1.6, 0]]
    if height < 0.05:
        with pytest.raises(InputError, match="one line"):
            build_reference_frame(centres)
    else:
        build_reference_frame(centres)


def bounded(closest: float = 1.0, height: float = 1.0, base: float = 1.0) -> np.ndarray:
    """Four centres whose largest distance is 1 m, with one small length; 1: none is small."""
    if closest < 1.0:
        return np.array([[0, 0, 0], [0, closest, 0], [1, 0, 0], [0.9, 0.4, 0]], dtype=float)
    if height < 1.0:
        return np.array([[0, 0, 0], [0, 0.9, 0], [height, 0.45, 0], [0.4, 0.9, 0]])
    angle = 1.2  # of the front axle to the rear one: a cosine of 0.36
    along = np.array([np.sin(angle), np.cos(angle), 0.0])
    across = np.array([np.cos(angle), -np.sin(angle), 0.0])
    rear = np.array([[0, -0.25, 0], [0, 0.25, 0]])
    front = (
        np.array([0.5 * -along, 0.5 * along]) + base * np.cos(angle) * across
    )  # it meets the x axis at base
    return np.vstack([rear, front])


@pytest.mark.parametrize(
    ("case", "words"),
    [
        ("closest", "are only 0.0.* m apart"),
        ("height", "lie on one line within 0.0"),
        ("base", "passes 0.0.* m from the middle of the rear axle"),
    ],
)
def test_no_length_of_a_frame_is_under_a_twentieth_of_its_spread(case, words):
    for share in (0.056, 0.08):
        build_reference_frame(bounded(**{case: share}))
    for share in (0.0481, 0.03, 0.001):
        with pytest.raises(InputError, match=words):
            build_reference_frame(bounded(**{case: share}))


def front_axle_at(cosine):
    along = np.array([np.sqrt(1.0 - cosine**2), cosine, 0.0])
    front = np.array([[1.5, 1.0, 0.0]] * 2) + np.outer([-0.35, 0.35], along)
    return np.vstack([[[0, -0.25, 0], [0, 0.25, 0]], front])


@pytest.mark.parametrize("scale", [0.01, 1.0, 100.0])
def test_what_is_refused_does_not_depend_on_the_size_of_the_vehicle(scale):
    """Shares of the spread and the cosine of the axles have no unit."""
    for case in ("closest", "height", "base"):
        build_reference_frame(scale * bounded(**{case: 0.056}))
        with pytest.raises(InputError):
            build_reference_frame(scale * bounded(**{case: 0.0481}))
    build_reference_frame(scale * front_axle_at(0.101))
    with pytest.raises(InputError, match=r"is at 84\.\d\d° to the rear axle"):
        build_reference_frame(scale * front_axle_at(0.099))
    with pytest.raises(InputError, match=r"is at 95\.\d\d° to the rear axle"):
        build_reference_frame(scale * front_axle_at(-0.099))
    with pytest.raises(InputError, match="runs against the rear axle"):
        build_reference_frame(scale * front_axle_at(-0.101))
