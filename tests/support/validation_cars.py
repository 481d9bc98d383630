"""Cars whose angles are known, seen by two methods: drawn as uncertainties say, or scanned."""

from __future__ import annotations

import json
from dataclasses import replace
from functools import cache

import numpy as np

from tests.support.given import root
from tests.support.scenes import Setup, make
from wheelplane.centre.locate_centre import TargetFit
from wheelplane.config import StationConfig, config_file
from wheelplane.five_point import measure_five_point
from wheelplane.five_point.components import Station
from wheelplane.five_point.file import FivePointFile
from wheelplane.uncertainty.components import UncertaintyComponent
from wheelplane.validation.comparison import ComparedMethod, compare
from wheelplane.validation.five_point import FivePointOptions, with_aiming
from wheelplane.validation.frame_effect import angles_in
from wheelplane.validation.request import as_method
from wheelplane.vehicle.frame import build_reference_frame
from wheelplane_synth.output.files import capture_toml, ply, scan_file
from wheelplane_synth.output.five_point import draw_position, measure_five
from wheelplane_synth.output.truth import Truth, site_point
from wheelplane_synth.parameters.parameters import TotalStation, VehicleFile
from wheelplane_synth.parameters.recipe import read_recipe
from wheelplane_synth.parameters.target_file import read_target
from wheelplane_synth.vehicle.vehicle import WHEELS, draw_trial, draw_vehicle, draw_wheel

ARCSEC = np.pi / 648_000
TM30 = TotalStation(
    distance_m=6.5,
    height_m=1.5,
    pentagon_radius_m=0.088,
    aiming_sigma_m=0.002,
    range_sigma_m=0.0006,
    range_sigma_ppm=1.0,
    angle_sigma_arcsec=1.0,
)
NORMAL, CENTRE = 10.0 * ARCSEC, 4e-5  # of the dense method, as it states them for disc-250
SCENE = Setup(spacing_m=0.003, half_width_m=0.18, noise_m=0.0008, pairs=6, thickness_m=0.01)


def stated(station):
    """What a file says of such an instrument."""
    return StationConfig(
        range_sigma_m=station.range_sigma_m,
        range_sigma_ppm=station.range_sigma_ppm,
        angle_sigma_arcsec=station.angle_sigma_arcsec,
        aiming_sigma_m=station.aiming_sigma_m,
    )


@cache
def saloon():
    """The recipe of all cars here."""
    return read_recipe(config_file("vehicles", "saloon"), VehicleFile)


class Car:
    """A vehicle of configs/vehicles/saloon.toml with `trials` trials; its wheels, true normals."""

    def __init__(self, seed, trials=0):
        self.rng = np.random.default_rng(seed)
        recipe = saloon()
        self.vehicle = draw_vehicle(recipe, self.rng)
        self.drawn = [draw_wheel(self.vehicle, recipe, name, self.rng) for name in WHEELS]
        for number in range(trials):
            wheel = WHEELS[number % 4]
            self.drawn.append(draw_trial(self.vehicle, recipe, wheel, str(number + 1), self.rng))
        self.wheels = [wheel.wheel or wheel.name for wheel in self.drawn]
        self.names = [wheel.name for wheel in self.drawn]
        T = self.vehicle.T_site_vehicle
        self.normals = np.array([T[:3, :3] @ wheel.normal_vehicle for wheel in self.drawn])
        self.centres = np.array([site_point(self.vehicle, w.centre_vehicle_m) for w in self.drawn])

    def dense(self, normal=NORMAL, centre=CENTRE, toe_error=None):
        """The dense method: truth with errors as it states them; toe_error (W,) it does not."""
        targets = []
        for n, c in zip(self.normals, self.centres, strict=True):
            across = np.eye(3) - np.outer(n, n)
            factor = np.zeros((6, 6))
            factor[:3, :3] = normal * root(across)
            factor[3:, 3:] = centre * np.eye(3)
            lean = factor @ self.rng.standard_normal(6)
            seen = (n + lean[:3]) / np.linalg.norm(n + lean[:3])
            targets.append(
                TargetFit(c + lean[3:], seen, (UncertaintyComponent("plane", factor),), 0, 1, "rim")
            )
        frame = build_reference_frame(np.stack([t.centre_m for t in targets[:4]]))
        angles = angles_in(frame, np.stack([t.normal for t in targets]), self.wheels)
        if toe_error is not None:
            angles[: len(self.wheels)] += toe_error
        return ComparedMethod("dense", tuple(targets), angles)

    def blocks(self, station=TM30):
        """Five points a wheel by a total station, (W, 5, 3), and where it stood."""
        place = draw_position(self.vehicle, station, self.rng)
        rows = measure_five(self.vehicle, self.drawn, station, place, self.rng)
        return rows.reshape(-1, 5, 3), np.array(site_point(self.vehicle, place))

    def five(self, station=TM30, known=True, scale=1.0):
        """The five-point method; known: the instrument is stated, `scale` times as uncertain.

        Not known: by the scatter of the points, and the aiming that is stated.
        """
        blocks, place = self.blocks(station)
        said = StationConfig(**{k: v * scale for k, v in stated(station).model_dump().items()})
        if known:
            return points(blocks, Station(said, place))
        return aimed(points(blocks), said.aiming_sigma_m)

    def compare_by_scatter(self, noise_m=0.0006, aiming_m=0.002):
        """Dense against five points with equal noise along each axis, which their scatter shows."""
        phase = 2 * np.pi * np.arange(5) / 5
        blocks = []
        for wheel in self.drawn:
            turn = phase + self.rng.uniform(0, 2 * np.pi)
            ring = TM30.pentagon_radius_m * np.column_stack([np.cos(turn), np.sin(turn)])
            ring += self.rng.normal(0.0, aiming_m, (5, 2))
            T = self.vehicle.T_site_vehicle @ wheel.T_vehicle_target
            blocks.append(ring @ T[:3, :2].T + T[:3, 3] + self.rng.normal(0.0, noise_m, (5, 3)))
        second = aimed(points(np.array(blocks)), aiming_m)
        return compare("car", self.names, self.wheels, self.dense(), second)

    def compare(self, **options):
        """Dense against five points."""
        toe_error = options.pop("toe_error", None)
        first, second = self.dense(toe_error=toe_error), self.five(**options)
        return compare("car", self.names, self.wheels, first, second)


def points(blocks, station=None):
    """The five-point method on blocks (W, 5, 3)."""
    return as_method("five", measure_five_point(FivePointFile(blocks, "", "", ()), station).wheels)


def aimed(found, aiming_m):
    """The five-point method with the aiming that is stated."""
    options = FivePointOptions(aiming_m=aiming_m)
    return replace(found, targets=tuple(with_aiming(t, options) for t in found.targets))


def write_capture(folder, seed, station=TM30, trials=1, scene=SCENE):
    """A coarse capture with five-point.txt and truth.json, made in half a second."""
    car = Car(seed, trials)
    plate = read_target(config_file("targets", "disc-250"))
    folder.mkdir(parents=True)
    for wheel in car.drawn:
        setup = scene.but(
            distance_m=car.rng.uniform(2.0, 3.0),
            incidence_deg=car.rng.uniform(3.0, 25.0),
            azimuth_deg=car.rng.uniform(0.0, 360.0),
        )
        cloud = make(setup, car.rng, car.vehicle.T_site_vehicle @ wheel.T_vehicle_target).points_m
        (folder / scan_file(wheel)).write_bytes(ply(cloud, np.ones(len(cloud), np.float32)))
    (folder / "capture.toml").write_text(capture_toml(f"saloon {seed}", plate, car.drawn))
    blocks, place = car.blocks(station)
    rows = "".join(f"{x:.6f},{y:.6f},{z:.6f}\n" for x, y, z in blocks.reshape(-1, 3))
    (folder / "five-point.txt").write_text(rows)
    truth = Truth(seed, car.vehicle, tuple(car.drawn), {}).to_json()
    (folder / "truth.json").write_text(json.dumps(truth))
    return car, place
