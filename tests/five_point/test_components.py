"""Five points and their instrument: stated uncertainties against drawn observations."""

from functools import cache

import numpy as np
import pytest
from click.testing import CliRunner
from scipy import stats
from scipy.spatial.transform import Rotation

from tests.support.wrong_digits import paper
from wheelplane.cli import cli
from wheelplane.config import StationConfig, load_station
from wheelplane.errors import ConfigError, InputError
from wheelplane.five_point import measure_five_point
from wheelplane.five_point.components import Station
from wheelplane.five_point.file import FivePointFile
from wheelplane.five_point.observe import pooled_noise

STATED = StationConfig(
    range_sigma_m=6e-4,
    range_sigma_ppm=1.0,
    angle_sigma_arcsec=10.0,
    aiming_sigma_m=5e-4,
    range_bias_m=8e-4,
)
CENTRES = np.array([[0, -0.75, 0], [0, 0.75, 0], [2.6, -0.74, 0.01], [2.62, 0.76, 0.0]])


def vehicle(seed):
    """Toes and cambers (4,) of a vehicle, the frames of its targets in the site, a station."""
    rng = np.random.default_rng(seed)
    toe, camber = np.radians(rng.uniform([[-0.6], [-2]], [[0.6], [2]], (2, 4)))
    side = np.array([-1.0, 1.0, -1.0, 1.0])  # outward along y; x is forward
    # Angles are those of the frame that the centres make, so the truth is put into that frame.
    left = (CENTRES[1] - CENTRES[0]) / np.linalg.norm(CENTRES[1] - CENTRES[0])
    line = CENTRES[3] - CENTRES[2]
    middle = (CENTRES[0] + CENTRES[1]) / 2
    foot = CENTRES[2] + line * (left @ (middle - CENTRES[2])) / (left @ line) - middle
    forward = foot / np.linalg.norm(foot)
    up = np.cross(forward, left)
    normals = (
        (np.cos(camber) * np.sin(toe))[:, None] * forward
        + (side * np.cos(camber) * np.cos(toe))[:, None] * left
        - np.sin(camber)[:, None] * up
    )
    R = Rotation.from_euler("z", rng.uniform(0, 2 * np.pi)).as_matrix()
    shift = rng.uniform(-30, 30, 3)
    aside = rng.uniform(5.5, 7.5) * rng.choice([-1, 1])
    place = R @ np.array([rng.uniform(0.3, 2.3), aside, 0.8]) + shift
    return toe, camber, CENTRES @ R.T + shift, normals @ R.T, place, rng


def observed(centres, normals, place, stated, rng):
    """Blocks (4, 5, 3) by a total station: range, azimuth and zenith with their errors."""
    blocks, bias = [], stated.range_bias_m * rng.standard_normal()
    for centre, normal in zip(centres, normals, strict=True):
        e1 = np.cross(normal, [0, 0, 1.0])
        e1 /= np.linalg.norm(e1)
        turn = rng.uniform(0, 2 * np.pi) + 2 * np.pi * np.arange(5) / 5
        ring = 0.088 * np.column_stack([np.cos(turn), np.sin(turn)])
        ring += stated.aiming_sigma_m * rng.standard_normal((5, 2))
        x, y, z = (centre + ring @ [e1, np.cross(normal, e1)] - place).T
        distance = np.sqrt(x * x + y * y + z * z)
        arc = np.radians(stated.angle_sigma_arcsec / 3600)
        zenith = np.arccos(z / distance) + arc * rng.standard_normal(5)
        azimuth = np.arctan2(y, x) + arc * rng.standard_normal(5) / np.hypot(x, y) * distance
        sigma = stated.range_sigma_m + stated.range_sigma_ppm * 1e-6 * distance
        distance = distance + bias + sigma * rng.standard_normal(5)
        level = distance * np.sin(zenith)
        blocks.append(
            place
            + np.column_stack(
                [level * np.cos(azimuth), level * np.sin(azimuth), distance * np.cos(zenith)]
            )
        )
    return np.array(blocks)


def file(blocks):
    return FivePointFile(blocks, "five.txt", "", ())


VEHICLES = 300


@cache
def normalised():
    """Error over stated uncertainty of toe and camber of every wheel, and of total toe, (K, 10)."""
    rows = []
    for seed in range(VEHICLES):
        toe, camber, centres, normals, place, rng = vehicle(seed)
        blocks = observed(centres, normals, place, STATED, rng)
        result = measure_five_point(file(blocks), Station(STATED, place))
        known, angles = result.uncertainty, [w.angles for w in result.wheels]
        error = [a.toe_rad - t for a, t in zip(angles, toe, strict=True)]
        error += [a.camber_rad - c for a, c in zip(angles, camber, strict=True)]
        u = [*known.toe_rad, *known.camber_rad]
        for name, pair in (("rear", (0, 1)), ("front", (2, 3))):
            error.append(result.vehicle[f"{name}_total_toe"] - toe[list(pair)].sum())
            u.append(known.vehicle_standard[f"{name}_total_toe"])
        rows.append(np.array(error) / u)
    return np.array(rows)


@pytest.mark.slow
def test_errors_are_as_large_as_the_instrument_makes_them():
    found = normalised()
    low, high = stats.chi2.ppf([0.0005, 0.9995], VEHICLES) / VEHICLES
    for column in (found**2).mean(axis=0):
        assert low < column < high
        assert not low < 4 * column < high
        assert not low < column / 4 < high
    inside = np.mean(np.abs(found[:, [0, 4, 8]]) < 1.96)
    assert abs(inside - 0.95) < 4 * np.sqrt(0.95 * 0.05 / (3 * VEHICLES))


def lines(stated):
    _, _, centres, normals, place, rng = vehicle(3)
    blocks = observed(centres, normals, place, STATED, rng)
    return measure_five_point(file(blocks), Station(stated, place)).uncertainty


def test_each_statement_is_a_line_of_the_budget():
    assert lines(STATED).components == ("range noise", "angle noise", "aiming", "range bias")
    bare = StationConfig(range_sigma_m=6e-4, angle_sigma_arcsec=0.0)
    assert lines(bare).components == ("range noise",)
    double = STATED.model_copy(update={"aiming_sigma_m": 1e-3})
    index = lines(STATED).components.index("aiming")
    np.testing.assert_allclose(
        lines(double).contributions[:, index], 4 * lines(STATED).contributions[:, index]
    )
    assert lines(STATED).contributions[:, index].max() > 0.0
    assert (
        lines(STATED).contributions[12, index] < 1e-3 * lines(STATED).contributions[0, index]
    )  # total toe


def test_scatter_beyond_the_instrument_is_not_hidden():
    found = []
    for seed in range(40):
        _, _, centres, normals, place, rng = vehicle(seed)
        blocks = observed(centres, normals, place, STATED, rng)
        better = STATED.model_copy(update={"range_sigma_m": 6e-5, "angle_sigma_arcsec": 1.0})
        found.append([pooled_noise(blocks, Station(s, place)).sigma_m for s in (STATED, better)])
    honest, boasting = np.array(found).T
    assert np.count_nonzero(honest) <= stats.binom.ppf(0.999, 40, 0.01)
    assert np.all(boasting > 2e-4)
    station = Station(better, place)
    assert "unexplained scatter" in measure_five_point(file(blocks), station).uncertainty.components


def test_without_a_station_the_residuals_count_with_their_degrees_of_freedom():
    inside, dof = [], None
    for seed in range(200):
        toe, _, centres, normals, place, rng = vehicle(seed)
        noise = 5e-4 * rng.standard_normal((4, 5, 3))
        exact = STATED.model_copy(update={"range_sigma_m": 0, "angle_sigma_arcsec": 0})
        exact = exact.model_copy(update={"aiming_sigma_m": 0, "range_bias_m": 0})
        blocks = observed(centres, normals, place, exact, rng) + noise
        known = measure_five_point(file(blocks))
        error = np.array([w.angles.toe_rad for w in known.wheels]) - toe
        dof = known.uncertainty.dof[:4]
        inside += list(
            np.abs(error) < known.uncertainty.coverage_factor[:4] * known.uncertainty.toe_rad
        )
    np.testing.assert_allclose(dof, 8.0, rtol=1e-9)  # five points less three, four times
    assert abs(np.mean(inside) - 0.95) < 4 * np.sqrt(0.95 * 0.05 / 400)  # wheels share one sigma
    assert stats.t.ppf(0.975, 8) > 2.3


def test_command_names_what_is_missing(tmp_path):
    _, _, centres, normals, place, rng = vehicle(1)
    path = tmp_path / "five.txt"
    np.savetxt(path, observed(centres, normals, place, STATED, rng).reshape(-1, 3))
    there = ",".join(f"{x:.6f}" for x in place)

    def run(*options):
        return CliRunner().invoke(cli, ["five-point", str(path), *options])

    done = run("--total-station", "leica-tm30", "--total-station-position", there, "--json")
    assert run("--scanner", "leica-tm30", "--station", there, "--json").output == done.output
    assert done.exit_code == 0
    assert '"station"' in done.output
    for options, said in (
        (["--scanner", "leica-tm30"], "--total-station-position X,Y,Z"),
        (["--station", there], "--total-station"),
        (["--scanner", "leica-tm30", "--station", "1,2"], "three numbers"),
        (["--scanner", "default", "--station", there], "instrument"),
        (["--method", "tcgc-2013", "--scanner", "leica-tm30"], "tcgc-2013"),
    ):
        assert said in str(run(*options).exception)


def test_shipped_station_is_read_and_a_scanner_is_refused():
    assert load_station("leica-tm30").range_sigma_m > 0.0
    with pytest.raises(ConfigError, match="instrument"):
        load_station("default")


@pytest.mark.parametrize(
    ("apart_m", "says"),
    [
        (0.0, r"nearest point lies 0 mm from the total station, sights are 100 mm to 1 km long"),
        (0.05, r"nearest point lies 47\.07 mm"),
        (0.2, ""),
        (900.0, ""),
        (3e4, r"nearest point lies 30 km .*: check --total-station-position"),
    ],
)
def test_a_station_at_a_point_or_out_of_sight_is_refused(apart_m, says):
    """At a point u was not a number; of metres for millimetres it is tens of degrees."""
    blocks = paper()
    station = Station(STATED, blocks[0, 0] + [0.0, 0.0, apart_m])
    if says:
        with pytest.raises(InputError, match=says):
            measure_five_point(file(blocks), station)
    else:
        u = measure_five_point(file(blocks), station).uncertainty.standard
        assert np.isfinite(u).all()
