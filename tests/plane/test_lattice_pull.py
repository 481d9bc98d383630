"""Pull of a voxel lattice by its definition: fit by a general minimiser, priors, covariances."""

import numpy as np
import pytest
from scipy import optimize, stats
from scipy.interpolate import CubicSpline
from scipy.spatial.transform import Rotation

from wheelplane.cloud import VoxelLattice
from wheelplane.plane.thinned.voxel_pull import (
    LEAST_REST,
    NEAREST_U,
    POINTS,
    REST,
    REST_LENGTH,
    REST_TO_MIDDLE,
    SHARE_U,
    TABLE,
    LatticePull,
    _form,
    _forms,
    _positive,
    _unseen,
    fit_pull,
)

MIDDLE = np.array([0.4, -0.3])  # of the points along the face
AXES = Rotation.from_euler("xyz", [0.4, -0.7, 1.1]).as_matrix()  # no two coordinates alike
EDGE = 5e-3


def lattice(noise=0.2, to_middle=0.3, layers=2, edge_m=EDGE, axis=(1.0, 0.0, 0.0)):
    """Lattice whose boundary is uncertain by 0.04 of its cells, noise in cells."""
    where = (edge_m * one for one in (0.3, 0.04, noise))
    return VoxelLattice(edge_m, np.array(axis), *where, to_middle, layers)


def pulled_points(seed, count, rise, noise=0.2):
    """Points (N, 3), depth first, of a face that rises by so many cells, with noise in cells."""
    rng = np.random.default_rng(seed)
    xy = rng.uniform(-0.1, 0.1, (count, 2)) + MIDDLE
    depth = 0.0123 + rise * EDGE / 0.2 * (xy[:, 0] - 0.4) + 0.01 * (xy[:, 1] + 0.3)
    pulled = depth - 0.09 * EDGE * np.sin(2.0 * np.pi * (depth / EDGE - 0.36))
    return np.column_stack([pulled + noise * EDGE * rng.normal(size=count), xy])


def most_probable(points, one):
    """Plane (3,), boundary, pull by depth, and covariances of the plane with and without a pull.

    By scipy's minimiser and splines of the forms. The variance of the points is that of the
    residuals of a plane, found by repetition.
    """
    columns, mean, variance = _forms(one)
    places = np.arange(TABLE + 1) / TABLE
    spline = CubicSpline(places, columns[np.arange(TABLE + 1) % TABLE], bc_type="periodic")
    xy = points[:, 1:] - points[:, 1:].mean(axis=0)

    def rest(state):
        plane, pull = state[:3], state[3:]
        depth = plane[0] + xy @ plane[1:]
        cells = (depth - one.boundary_m - pull[-1]) / one.edge_m
        return points[:, 0] - depth - spline(cells % 1.0) @ pull[:-1]

    terms = np.column_stack([np.ones(len(xy)), xy])
    first = np.linalg.lstsq(terms, points[:, 0], rcond=None)[0]
    state, white = np.concatenate([first, mean]), one.noise_m**2
    for _ in range(12):

        def whole(state, white=white):
            off = (state[3:] - mean) / np.sqrt(variance)
            return np.concatenate([rest(state) / np.sqrt(white), off])

        scale = np.concatenate([[1e-4, 1e-3, 1e-3], np.sqrt(variance)])
        found = optimize.least_squares(whole, state, jac="3-point", x_scale=scale, xtol=1e-12)
        state = found.x
        white = float(np.sum(rest(state) ** 2)) / (len(xy) - 3)
    covariance = np.linalg.inv(found.jac.T @ found.jac)[:3, :3]
    plain = white * np.linalg.inv(terms.T @ terms)
    return state[:3], one.boundary_m + state[-1], columns @ state[3:-1], covariance, plain


CASES = [
    (4, 12, 0.5, 0.3),
    (1, 12, 0.8, 0.2),
    (8, 400, 0.8, 0.2),
    (9, 400, 1.3, 0.12),
    (10, 400, 0.6, 0.12),
    (9, 400, 0.5, 0.3),
]


@pytest.mark.parametrize(("seed", "count", "rise", "noise"), CASES)
def test_plane_and_pull_are_the_most_probable_ones(seed, count, rise, noise):
    """The fit agrees with a general minimiser within a fiftieth of its u."""
    points, one = pulled_points(seed, count, rise, noise), lattice(noise)
    got = fit_pull(points, one, np.eye(3))
    plane, boundary_m, table_m, covariance, plain = most_probable(points, one)
    u = np.sqrt(np.diag(covariance))
    assert got.plane / u == pytest.approx(plane / u, abs=0.02)
    assert abs(got.boundary_m - boundary_m) < 0.02 * one.boundary_u_m
    assert got.table_m == pytest.approx(table_m, abs=0.002 * one.noise_m)
    added = _positive(covariance - plain)
    assert got.added / np.outer(u, u) == pytest.approx(added / np.outer(u, u), abs=0.02)


@pytest.mark.parametrize("order", [(0, 1, 2), (2, 0, 1), (1, 2, 0)])
@pytest.mark.parametrize("layers", [1, 2])
def test_the_pull_turns_and_moves_with_the_points(order, layers):
    """Points about other axes, in any order, and elsewhere along the face, have the same pull."""
    points = pulled_points(5, 300, 0.8)
    basis = Rotation.from_euler("xyz", [0.01, 0.05, -0.02]).as_matrix()[[1, 2, 0]]
    plain = fit_pull(points, lattice(layers=layers), np.eye(3))
    effect = plain.thinning(points.mean(axis=0), basis)
    along = np.array([0.0, 0.7, -0.4])
    there = fit_pull(
        (points + along) @ AXES, lattice(layers=layers, axis=AXES[0]), AXES[list(order)]
    )
    moved = (plain.levelled(points) + along) @ AXES
    assert there.levelled((points + along) @ AXES) == pytest.approx(moved, abs=1e-9)
    other = there.thinning((points.mean(axis=0) + along) @ AXES, basis @ AXES)
    u = np.sqrt(np.diag(effect.covariance))
    assert u.all()
    off = (other.covariance - effect.covariance) / np.outer(u, u)
    assert np.abs(off).max() < 1e-6
    assert other.edge_m == effect.edge_m == EDGE


SLOPES = np.array([0.08, -0.15])


def known_pull(added):
    """Pull of an arbitrary table about a plane of known slopes, far from the origin."""
    table = np.random.default_rng(6).normal(0.0, 1e-3, TABLE)
    plane = np.array([0.7, *SLOPES])
    return LatticePull(lattice(), AXES, MIDDLE, plane, 0.0131, table, added)


def test_points_are_levelled_along_the_axis_by_the_depth_of_the_plane():
    """A point loses the pull at the depth where the plane lies, however far it is off the plane."""
    pull = known_pull(np.zeros((3, 3)))
    rng = np.random.default_rng(7)
    number, row = rng.integers(-3, 4, 50), rng.uniform(0.0, TABLE, 50)
    height = 0.0131 + (number + row / TABLE) * EDGE  # of the plane at each point
    across = rng.uniform(-0.1, 0.1, 50)
    along = (height - 0.7 - SLOPES[1] * across) / SLOPES[0]
    xy = MIDDLE + np.column_stack([along, across])
    off = rng.normal(0.0, 0.01, 50)
    points = np.column_stack([height + off, xy]) @ AXES
    pulled = np.interp(row, np.arange(TABLE), pull.table_m, period=TABLE)
    wanted = np.column_stack([height + off - pulled, xy]) @ AXES
    assert pull.levelled(points) == pytest.approx(wanted, abs=1e-12)


def test_the_effect_on_a_plane_is_that_of_a_plane_moved_as_far():
    """Height along the normal and slopes over u and v, of planes whose parts differ by little."""
    added = Rotation.from_euler("xyz", [0.5, 1.0, 2.0]).as_matrix() @ np.diag([1.0, 0.6, 0.3])
    pull = known_pull(added @ added.T)
    upright = np.array([1.0, *-SLOPES])
    normal = upright / np.linalg.norm(upright)
    first = np.cross([0.3, 0.5, 0.9], normal)
    first /= np.linalg.norm(first)
    basis = np.stack([first, np.cross(normal, first), normal])
    xy = MIDDLE + np.array([0.05, 0.09])
    centroid = np.array([0.7 + SLOPES @ (xy - MIDDLE), *xy])

    def on(moved, place):
        """Distance along the normal from a place on the plane to the moved plane."""
        above = moved[0] + moved[1:] @ (place[1:] - MIDDLE) - place[0]
        return above / (normal @ [1.0, *-moved[1:]])

    step, effect = 1e-6, np.zeros((3, 3))
    for column in range(3):
        moved = pull.plane + step * np.eye(3)[column]
        height = on(moved, centroid)
        rise = [on(moved, centroid + 0.1 * axis) - height for axis in basis[:2]]
        effect[:, column] = [height / step, *(np.array(rise) / 0.1 / step)]
    got = pull.thinning(centroid @ AXES, basis @ AXES).covariance
    assert got == pytest.approx(effect @ added @ added.T @ effect.T, rel=1e-4, abs=1e-4)


def test_in_one_layer_the_covariance_is_that_of_depths_drawn_to_its_middle():
    """Points that are drawn to the middle by a part of their distance: the plane is off by its u.

    The slopes are off by what was drawn, the height by what was drawn if the middle is known to u.
    """
    rng = np.random.default_rng(8)
    xy = rng.uniform(-0.1, 0.1, (40, 2))
    true = np.array([0.011, 0.006, -0.004])  # at the origin, and slopes
    depth = true[0] + xy @ true[1:]
    for to_middle in (0.2, 0.6):
        middle = 0.0105
        kept = depth - to_middle * (depth - middle)
        found = np.linalg.lstsq(np.column_stack([np.ones(40), xy]), kept, rcond=None)[0]
        one = VoxelLattice(EDGE, np.eye(3)[0], 0.008, found[0] - middle, 1e-3, to_middle, 1)
        off = true - found
        got = _unseen(one, found)
        assert got[0] == pytest.approx([off[0] ** 2, 0.0, 0.0], rel=1e-9)
        assert got[1:, 1:] == pytest.approx(np.outer(off[1:], off[1:]), rel=1e-9)
        whole = fit_pull(np.column_stack([kept, xy]), one, np.eye(3))
        assert whole.added == pytest.approx(got, rel=1e-9)
        assert not whole.table_m.any()


@pytest.mark.parametrize("to_middle", [0.0, 0.4])
@pytest.mark.parametrize("noise", [0.08, 0.2, 0.35, 0.8])
def test_pulls_are_odd_about_a_boundary(noise, to_middle):
    """Seen from the other side of the boundary, the same pull is the opposite one."""
    columns = _forms(lattice(noise, to_middle))[0]
    assert columns[1:] == pytest.approx(-columns[:0:-1], abs=1e-10)
    assert columns[0] == pytest.approx(np.zeros(columns.shape[1]), abs=1e-4 * EDGE)
    assert np.abs(columns[:, [0, 1, 3]]).max(axis=0).min() > 1e-8


def test_of_means_nothing_is_drawn_to_the_middle():
    """The third form is what the pull of nearest points has beyond that of means of as many."""
    assert not _forms(lattice(to_middle=0.0))[0][:, 2].any()
    depth, one = np.arange(TABLE) / TABLE, lattice(to_middle=0.4)
    few, many, selected = _forms(one)[0].T[:3]
    assert np.abs(few).max() < np.abs(many).max()
    nearest = _form(depth, 0.2, max(POINTS), 0.4) * EDGE
    assert many + selected == pytest.approx(nearest, abs=1e-12)


def test_the_prior_is_half_way_between_what_programs_do():
    """Its mean lies between few and many points, and between means and nearest points."""
    one = lattice(to_middle=0.4)
    columns, mean, variance = _forms(one)
    few, many, selected = columns.T[:3]
    assert columns @ mean[:-1] == pytest.approx((few + many + selected) / 2.0, abs=1e-12)
    assert np.sqrt(variance[:3]) == pytest.approx([SHARE_U, SHARE_U, NEAREST_U])
    assert mean[-1] == 0.0
    assert np.sqrt(variance[-1]) == pytest.approx(one.boundary_u_m)


@pytest.mark.parametrize("noise", [0.058, 0.1, 0.2, 0.28, 0.35])
def test_the_rest_is_smooth_over_its_length(noise):
    """Its waves have the spectrum of a normal curve of that length, by a Fourier transform.

    It holds the waves whose variance exceeds the least part of the longest one's.
    """
    one = lattice(noise, 0.0)
    columns, _, variance = _forms(one)
    waves, variance = columns[:, 3:], variance[3:-1]
    places = np.arange(TABLE) / TABLE
    curve = stats.norm.pdf(places[:, None] + np.arange(-20, 21), scale=REST_LENGTH * noise).sum(
        axis=1
    )
    power = np.fft.rfft(curve).real[1:]
    power = power[power > LEAST_REST * power[0]]
    assert len(variance) == len(power)
    assert variance / variance[0] == pytest.approx(power / power[0], rel=1e-6)
    mean_square = np.mean(np.sum(variance * waves**2, axis=1))
    assert np.sqrt(mean_square) == pytest.approx(REST * one.noise_m, rel=1e-6)
    assert np.abs(np.fft.rfft(waves, axis=0)).argmax(axis=0).tolist() == [*range(1, len(power) + 1)]


def test_the_longest_wave_takes_what_the_pull_to_the_middle_leaves():
    """Its standard deviation is a part of what is drawn to the middle; the others have none."""
    plain = _forms(lattice(to_middle=0.0))[2][3:-1]
    for to_middle in (0.2, 0.4):
        more = _forms(lattice(to_middle=to_middle))[2][3:-1] - plain
        assert np.sqrt(more[0]) == pytest.approx(REST_TO_MIDDLE * to_middle * EDGE, rel=1e-6)
        assert not more[1:].any()


def test_a_larger_lattice_has_a_larger_pull():
    """In cells, pulls and their priors are those of any lattice of the same noise."""
    columns, mean, variance = _forms(lattice())
    larger, same, wider = _forms(lattice(edge_m=3.0 * EDGE))
    assert larger[:, :3] == pytest.approx(3.0 * columns[:, :3], rel=1e-9)
    assert larger[:, 3:] == pytest.approx(columns[:, 3:], rel=1e-9)
    assert same == pytest.approx(mean)
    assert wider[:3] == pytest.approx(variance[:3])
    assert wider[3:] == pytest.approx(9.0 * variance[3:], rel=1e-9)


def test_a_covariance_keeps_what_is_positive_of_it_in_any_unit():
    """A positive one stays; of another, heights in other units have the same in those."""
    root = Rotation.from_euler("xyz", [0.5, 1.0, 2.0]).as_matrix() * [1.0, 0.1, 0.01]
    units = np.diag([1e-6, 1.0, 1e3])
    positive = units @ root @ root.T @ units
    assert _positive(positive) / positive == pytest.approx(np.ones((3, 3)), rel=1e-6)
    part = np.array([[1.0, 0.9, 0.4], [0.9, -0.5, 0.2], [0.4, 0.2, 0.8]])
    kept = _positive(part)
    assert np.linalg.eigvalsh(kept).min() > -1e-12
    assert np.linalg.eigvalsh(kept - part).min() > -1e-12  # nothing of it is lost
    scaled = _positive(units @ part @ units)
    assert np.linalg.solve(units, np.linalg.solve(units, scaled).T) == pytest.approx(kept, rel=1e-9)
    assert not _positive(np.zeros((3, 3))).any()
