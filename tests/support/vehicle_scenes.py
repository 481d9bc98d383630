"""Hard scenes in closed form: whole cars in a workshop, single wheels, clouds of any size.

Vehicle frame: x forward, y left, z up, origin on the floor below the middle of the rear axle. Every
draw comes from the scene's number, which replays it; the cloud is then turned and shifted.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np

from tests.support.scenes import Cone, Piece, Setup, Sheet, Wall, make, rotation

Array = np.ndarray
UP = np.array([0.0, 0.0, 1.0])
RADIUS_M = 0.125
SPOT_M = 0.0015
PAIRS = 6  # rays of a beam near an edge, in opposite pairs
HARDSHIPS = ("plain", "rim", "step", "panel", "plate", "hidden")
AXLES_M = (0.0, 2.7)
FACE_M = 0.86  # of a target's face from the middle of the car
HEIGHT_M = 0.32


@dataclass(frozen=True)
class TrueFace:
    """A target's face: centre (3,), unit normal outwards, what makes it hard.

    points: returns of beams that lay on it with their whole spot.
    """

    name: str
    centre_m: Array
    normal: Array
    hardship: str
    points: int


@dataclass(frozen=True)
class Scene:
    """points_m (N, 3); row ranges of its single scans; what is true of them; what makes it hard.

    stations_m: (3,) each, where the single scans were taken from.
    """

    points_m: Array
    parts: tuple[tuple[int, int], ...]
    faces: tuple[TrueFace, ...]
    note: str
    stations_m: tuple[Array, ...]


@dataclass(frozen=True)
class Ellipsoid:
    """About the origin; half axes along x, y, z."""

    half: tuple[float, float, float]

    def meet(self, origin: Array, ray: Array) -> Array:
        o, d = origin / self.half, ray / self.half
        a, b = np.sum(d * d, axis=1), np.sum(o * d, axis=1)
        with np.errstate(invalid="ignore"):
            run = (-b - np.sqrt(b * b - a * (np.sum(o * o, axis=1) - 1.0))) / a
        return np.where(run > 0.0, run, np.inf)


@dataclass(frozen=True)
class Box:
    """About the origin; half widths along x, y, z."""

    half: tuple[float, float, float]

    def meet(self, origin: Array, ray: Array) -> Array:
        with np.errstate(divide="ignore", invalid="ignore"):
            enter = ((-np.sign(ray) * self.half - origin) / ray).max(axis=1)
            leave = ((np.sign(ray) * self.half - origin) / ray).min(axis=1)
        return np.where((enter > 0.0) & (enter < leave), enter, np.inf)


@dataclass(frozen=True)
class Placed:
    """A piece in its place: x_vehicle = R @ x_piece + shift_m. reach_m: of a ball that holds it."""

    piece: Piece | Ellipsoid | Box
    R: Array
    shift_m: Array
    reach_m: float = np.inf

    def meet(self, origin: Array, ray: Array) -> Array:
        return self.piece.meet((origin - self.shift_m) @ self.R, ray @ self.R)

    def rows(self, station_m: Array, ray: Array) -> Array:
        """Beams from the station that may meet it."""
        towards = self.shift_m - station_m
        distance = float(np.linalg.norm(towards))
        sine = (self.reach_m + 0.01) / distance
        if sine >= 1.0:
            return np.arange(len(ray))
        return np.flatnonzero(ray @ (towards / distance) > np.sqrt(1.0 - sine * sine))


@dataclass(frozen=True)
class Wheel:
    """Columns of R: target axes u, v (up), w (outwards). pieces: in these axes, the face first."""

    name: str
    R: Array
    centre_m: Array
    hardship: str
    pieces: tuple[Piece, ...]

    def place(self, piece: Piece) -> Placed:
        return Placed(piece, self.R, self.centre_m, _reach(piece))


@dataclass(frozen=True)
class Window:
    """A grid of beams about a point aimed at: half angles to the side and up, angular step."""

    aim_m: Array
    half_rad: tuple[float, float]
    step_rad: float

    def rays(self, station_m: Array, rng: np.random.Generator) -> tuple[Array, tuple[int, int]]:
        ahead = _unit(self.aim_m - station_m)
        left = _unit(np.cross(UP, ahead))
        counts = [round(half / self.step_rad) for half in self.half_rad]
        side, rise = (
            (np.arange(-count, count + 1) + rng.uniform(-0.5, 0.5)) * self.step_rad
            for count in counts
        )
        rise, side = np.meshgrid(rise, side, indexing="ij")
        out, level = np.cos(rise) * np.cos(side), np.cos(rise) * np.sin(side)
        over = np.cross(ahead, left)
        ray = out[..., None] * ahead + level[..., None] * left + np.sin(rise)[..., None] * over
        return ray.reshape(-1, 3), rise.shape


@dataclass(frozen=True)
class Station:
    """A scanner's place and windows; the wheels it is there for; noise and steps of its ranges."""

    place_m: Array
    windows: tuple[Window, ...]
    wheels: tuple[str, ...]
    noise_m: float
    step_m: float


def vehicle_scene(number: int) -> Scene:
    """Four targets on a car in a workshop, from two to four stations, about a million points."""
    rng = np.random.default_rng([number, 77])
    sides = [str(side) for side in rng.choice(["own", "shared", "oblique"], 2, p=[0.4, 0.4, 0.2])]
    sparse = bool(rng.random() < 0.25 and "oblique" not in sides)
    step_m = float(rng.uniform(0.001, 0.005)) if rng.random() < 0.25 else 0.0
    noise_m = 0.0002 if step_m else float(rng.uniform(0.0003, 0.001))
    wheels = [_wheel(axle, side, step_m, rng) for side in (0, 1) for axle in (0, 1)]
    stations = [
        Station(place, _windows(place, there, sparse, rng), names, noise_m, step_m)
        for side in (0, 1)
        for place, there in _places(sides[side], wheels[2 * side :][:2], rng)
        for names in [tuple(wheel.name for wheel in there)]
    ]
    wheels = [_hidden(wheel, stations, rng) for wheel in wheels]
    note = "+".join(sides) + " sparse" * sparse
    note += f", steps {step_m * 1e3:.1f} mm" if step_m else ""
    return _scanned(wheels, stations, note, rng)


def _scanned(
    wheels: Sequence[Wheel], stations: Sequence[Station], note: str, rng: np.random.Generator
) -> Scene:
    """All stations' scans, a part each, with strays, turned and shifted as one."""
    pieces = [wheel.place(piece) for wheel in wheels for piece in wheel.pieces]
    pieces += _car() + _workshop(wheels, stations, rng)
    share = rng.uniform(0.0005, 0.005)
    scans = [_scan(station, pieces, rng) for station in stations]
    clouds = [_with_strays(points, share, rng) for points, _ in scans]
    met = np.concatenate([met for _, met in scans])
    starts = np.cumsum([0, *(len(wheel.pieces) for wheel in wheels[:-1])])
    R, shift = rotation(rng), 10.0 ** rng.uniform(0.0, 4.0) * rng.uniform(-1.0, 1.0, 3)
    faces = tuple(
        TrueFace(
            wheel.name,
            R @ wheel.centre_m + shift,
            R @ wheel.R[:, 2],
            wheel.hardship,
            int(np.count_nonzero(met == start)),
        )
        for wheel, start in zip(wheels, starts, strict=True)
    )
    ends = np.cumsum([0, *(len(cloud) for cloud in clouds)]).tolist()
    places = tuple(R @ station.place_m + shift for station in stations)
    points = np.concatenate(clouds) @ R.T + shift
    return Scene(points, tuple(pairwise(ends)), faces, note, places)


def _wheel(axle: int, side: int, step_m: float, rng: np.random.Generator) -> Wheel:
    """Of the left side (0) or the right (1); the plate stands before its rim, rivals beside it."""
    out = 1.0 - 2.0 * side
    toe, camber = np.radians(rng.normal(0.0, [1.0, 1.5]))
    yaw = np.array([[np.cos(toe), -np.sin(toe), 0], [np.sin(toe), np.cos(toe), 0], [0, 0, 1]])
    lean = np.array(
        [[1, 0, 0], [0, np.cos(camber), -np.sin(camber)], [0, np.sin(camber), np.cos(camber)]]
    )
    upright = np.array([[-out, 0.0, 0.0], [0.0, 0.0, out], [0.0, 1.0, 0.0]])
    hardship = str(rng.choice(HARDSHIPS))
    return Wheel(
        name="FR"[axle == 0] + "LR"[side],
        R=yaw @ lean @ upright,
        centre_m=np.array([AXLES_M[axle], out * FACE_M, HEIGHT_M]) + rng.normal(0, 0.01, 3),
        hardship=hardship,
        pieces=wheel_pieces(hardship, rng, 1.5 * step_m),
    )


def wheel_pieces(
    hardship: str, rng: np.random.Generator, least_m: float = 0.0
) -> tuple[Piece, ...]:
    """A plate of RADIUS_M, its face first, on a wheel; in the target's axes, v up.

    least_m: of a step between plate and rim, so that the ranges can show it.
    """
    depths = {"rim": rng.uniform(0.02, 0.06), "step": rng.uniform(max(0.004, least_m), 0.012)}
    depth = depths.get(hardship, 0.045)
    thick = min(depth, rng.uniform(0.006, 0.015))
    rim = Sheet((0, 0, -depth), outer=rng.uniform(0.165, 0.205), spokes=5)
    if hardship in ("rim", "step"):
        lean = np.radians(rng.normal(0.0, 0.2, 2))
        rim = replace(rim, spokes=0, normal=(lean[0], lean[1], 1.0))
    pieces: list[Piece] = [Sheet((0, 0, 0), outer=RADIUS_M), Wall(RADIUS_M, thick), rim]
    pieces += [Sheet((0, 0, -0.07), outer=0.215), Cone(0.215, 0.31, 0.065, 0.03)]
    if hardship == "panel":
        pieces.append(_panel(rng))
    if hardship == "plate":
        pieces += _other_plate(rng)
    return tuple(pieces)


def _panel(rng: np.random.Generator) -> Sheet:
    """A door larger than the target, nearly in its plane."""
    half = (rng.uniform(0.2, 0.4), rng.uniform(0.15, 0.3))
    u = rng.choice([-1.0, 1.0]) * (0.33 + half[0])
    lean = np.radians(rng.uniform(-2.0, 2.0, 2))
    place = (u, rng.uniform(-0.05, 0.2), rng.uniform(-0.015, 0.015))
    return Sheet(place, normal=(lean[0], lean[1], 1.0), half=half)


def _other_plate(rng: np.random.Generator) -> list[Piece]:
    """A disc of another size beside the wheel."""
    ratio = rng.uniform(0.55, 0.8) if rng.random() < 0.5 else rng.uniform(1.25, 1.6)
    radius = ratio * RADIUS_M
    u = rng.choice([-1.0, 1.0]) * (0.33 + radius)
    lean = np.radians(rng.uniform(-15.0, 15.0, 2))
    place = (u, rng.uniform(-0.05, 0.25), rng.uniform(-0.06, 0.0))
    return [Sheet(place, normal=(lean[0], lean[1], 1.0), outer=radius)]


def _places(
    side: str, wheels: Sequence[Wheel], rng: np.random.Generator
) -> list[tuple[Array, list[Wheel]]]:
    """Where the scanner stands for the two wheels (rear, front) of a side."""
    out = np.sign(wheels[0].centre_m[1])
    if side == "shared":
        place = [1.35 + rng.uniform(-0.4, 0.4), out * (FACE_M + rng.uniform(2.2, 3.5))]
        return [(np.array([*place, rng.uniform(0.4, 1.6)]), list(wheels))]
    places = []
    for wheel, ahead in zip(wheels, (-1.0, 1.0), strict=True):
        if side == "oblique":
            incidence, turn = np.radians([rng.uniform(66.0, 70.0), rng.uniform(-5.0, 10.0)])
        else:
            incidence, turn = np.radians([rng.uniform(8.0, 40.0), rng.uniform(-20.0, 200.0)])
        distance = rng.uniform(1.8, 3.2)
        aside = distance * np.sin(incidence)
        run = np.array([ahead * aside * np.cos(turn), out * distance * np.cos(incidence), 0.0])
        run[2] = np.clip(aside * np.sin(turn), -0.15, 1.6)
        places.append((wheel.centre_m + run, [wheel]))
    return places


def _windows(
    place: Array, wheels: Sequence[Wheel], sparse: bool, rng: np.random.Generator
) -> tuple[Window, ...]:
    """All around at a coarse step; and fine about each wheel, unless sparse."""
    middle = np.array([1.35, 0.0, 0.5])
    coarse = Window(middle, (0.95, 0.6), rng.uniform(1.8e-3, 2.4e-3) if sparse else 4e-3)
    fine = []
    for wheel in () if sparse else wheels:
        distance = float(np.linalg.norm(wheel.centre_m - place))
        half = rng.uniform(0.35, 0.6) / distance
        fine.append(Window(wheel.centre_m, (half, half), rng.uniform(0.002, 0.0035) / distance))
    return (coarse, *fine)


def _hidden(wheel: Wheel, stations: Sequence[Station], rng: np.random.Generator) -> Wheel:
    """The wheel, with a stand before it whose shadow from its station hides up to half of it."""
    if wheel.hardship != "hidden":
        return wheel
    place = next(station.place_m for station in stations if wheel.name in station.wheels)
    stand = hiding_strip((place - wheel.centre_m) @ wheel.R, rng)
    return replace(wheel, pieces=(*wheel.pieces, stand))


def hiding_strip(station_target_m: Array, rng: np.random.Generator) -> Sheet:
    """A strip parallel to the face, 40 to 100 mm before it, over 20 to 50 % of its width."""
    width = 2.0 * RADIUS_M * rng.uniform(0.2, 0.45)
    across = rng.uniform(-1.0, 1.0) * (RADIUS_M - width / 2.0)
    turn = rng.uniform(0.0, np.pi)
    axis = np.array([np.cos(turn), np.sin(turn), 0.0])
    nearer = min(rng.uniform(0.04, 0.1) / station_target_m[2], 0.5)
    middle = (1.0 - nearer) * across * axis + nearer * station_target_m
    return Sheet(tuple(middle), across=tuple(axis), half=((1.0 - nearer) * width / 2.0, 0.5))


def hard_wheel(number: int) -> Scene:
    """One wheel's scan: a target amid rivals; or none; or two alike, of which none is the one."""
    rng = np.random.default_rng([number, 78])
    hardship = str(rng.choice([*HARDSHIPS, "oblique", "thin", "steps", "none", "twin"]))
    pieces = wheel_pieces(hardship, rng)
    incidence = rng.uniform(66.0, 70.0) if hardship == "oblique" else rng.uniform(8.0, 45.0)
    wide = 0.8 if hardship == "thin" else rng.uniform(0.3, 0.6)
    setup = Setup(
        thickness_m=pieces[1].thickness,
        background_m=rng.uniform(0.1, 0.15),
        background_tilt_deg=rng.uniform(0.0, 5.0),
        extra=(*pieces[2:], Sheet((0.0, -0.33, 0.0), normal=(0, 1, 0), half=(2.0, 2.0))),
        distance_m=rng.uniform(1.8, 3.2),
        incidence_deg=incidence,
        azimuth_deg=rng.uniform(0.0, 180.0),
        spacing_m=0.004 if hardship == "thin" else rng.uniform(0.002, 0.0035),
        half_width_m=wide,
        noise_m=0.0002 if hardship == "steps" else rng.uniform(0.0003, 0.001),
        pairs=PAIRS,
    )
    if hardship == "none":
        setup = setup.but(radius_m=0.001, extra=(*setup.extra, *_other_plate(rng), _panel(rng)))
    if hardship == "hidden":
        lean, turn = np.radians([setup.incidence_deg, setup.azimuth_deg])
        aside = np.sin(lean) * np.array([np.cos(turn), np.sin(turn), 0.0])
        station = setup.distance_m * (aside + np.cos(lean) * UP)
        setup = setup.but(extra=(*setup.extra, hiding_strip(station, rng)))
    if hardship == "twin":
        beside = (rng.choice([-1.0, 1.0]) * rng.uniform(0.45, 0.6), rng.uniform(-0.1, 0.1), 0.0)
        twin = Sheet((*beside[:2], rng.uniform(-0.05, 0.0)), outer=RADIUS_M)
        setup = setup.but(extra=(*setup.extra, twin), half_width_m=0.8)
    cloud = make(setup, rng)
    points = cloud.points_m
    if hardship == "steps":
        points = _in_steps(points, cloud.viewpoint_m, rng.uniform(0.001, 0.005))
    points = _with_strays(points, rng.uniform(0.0005, 0.005), rng)
    face = TrueFace("wheel", cloud.centre_m, cloud.normal, hardship, len(cloud.face_m))
    faces = () if hardship in ("none", "twin") else (face,)
    note = f"{hardship}, {incidence:.0f} degrees"
    return Scene(points, ((0, len(points)),), faces, note, (cloud.viewpoint_m,))


def _in_steps(points_m: Array, viewpoint_m: Array, step_m: float) -> Array:
    """The points with their ranges rounded to whole steps: flat terraces, as some scanners make."""
    offset = points_m - viewpoint_m
    range_m = np.linalg.norm(offset, axis=1, keepdims=True)
    return viewpoint_m + offset * (step_m * np.round(range_m / step_m) / range_m)


@dataclass(frozen=True)
class VehicleCloud:
    """points_m (N, 3); on_face (N,); the face's true centre (3,) and unit normal."""

    points_m: Array
    on_face: Array
    centre_m: Array
    normal: Array


def face_cloud(
    count: int, number: int = 0, share: float = 0.35, noise_m: float = 8e-4
) -> VehicleCloud:
    """`count` points drawn evenly over a target's face (`share` of them), a tyre, a body panel, a
    rim, the floor and strays (1 %), in any order, with noise across each surface.

    The rest is shared out as it would look: the panel and the tyre hold less than the face.
    """
    rng = np.random.default_rng([number, 79])
    R, shift = rotation(rng), rng.uniform(-10.0, 10.0, 3)
    points, on_face = np.empty((count, 3)), np.empty(count, dtype=bool)
    shares = np.array([share, *((0.99 - share) * np.array([0.1, 0.3, 0.35, 0.25])), 0.01])
    for start in range(0, count, 1_000_000):
        rows = slice(start, min(start + 1_000_000, count))
        sizes = rng.multinomial(rows.stop - start, shares)
        local = np.concatenate(
            [draw(int(n), rng) for draw, n in zip(_SURFACES, sizes, strict=True)]
        )
        local += rng.normal(0.0, noise_m, local.shape)
        order = rng.permutation(len(local))
        points[rows] = local[order] @ R.T + shift
        on_face[rows] = order < sizes[0]
    return VehicleCloud(points, on_face, shift, R[:, 2])


def _ring(inner: float, outer: float, depth: float, count: int, rng: np.random.Generator) -> Array:
    reach = np.sqrt(rng.uniform(inner**2, outer**2, count))
    turn = rng.uniform(0.0, 2.0 * np.pi, count)
    return np.column_stack([reach * np.cos(turn), reach * np.sin(turn), np.full(count, -depth)])


def _tyre(count: int, rng: np.random.Generator) -> Array:
    points = _ring(0.215, 0.31, 0.065, count, rng)
    reach = np.hypot(points[:, 0], points[:, 1])
    points[:, 2] -= 0.03 * (reach - 0.215) / 0.095
    return points


def _body(count: int, rng: np.random.Generator) -> Array:
    points = np.column_stack([rng.uniform(-0.6, 0.6, count), rng.uniform(0.33, 0.85, count)])
    return np.column_stack([points, -0.06 - 0.12 * (points[:, 1] - 0.33)])


def _floor(count: int, rng: np.random.Generator) -> Array:
    points = rng.uniform([-0.7, 0.0, -0.1], [0.7, 0.0, 1.0], (count, 3))
    points[:, 1] = -0.31
    return points


_SURFACES = (
    lambda count, rng: _ring(0.0, RADIUS_M, 0.0, count, rng),
    lambda count, rng: _ring(0.13, 0.2, 0.045, count, rng),
    _tyre,
    _body,
    _floor,
    lambda count, rng: rng.uniform([-0.7, -0.31, -0.2], [0.7, 0.85, 1.0], (count, 3)),
)


def _car() -> list[Placed]:
    """Body and cabin, within the wheels' faces."""
    body = Placed(Box((2.2, 0.74, 0.35)), np.eye(3), np.array([1.35, 0.0, 0.62]), 2.4)
    cabin = Placed(Ellipsoid((1.5, 0.7, 0.6)), np.eye(3), np.array([1.2, 0.0, 0.9]), 1.6)
    return [body, cabin]


def _workshop(
    wheels: Sequence[Wheel], stations: Sequence[Station], rng: np.random.Generator
) -> list[Placed]:
    """Floor, walls, a lift's posts, persons; what would stand in a station's view is left out."""
    floor = Placed(Sheet((0, 0, 0), half=(9.0, 9.0)), np.eye(3), np.zeros(3))
    walls = []
    for normal, along in (((1.0, 0, 0), (0, 1.0, 0)), ((0, 1.0, 0), (1.0, 0, 0))):
        for sign in (-1.0, 1.0):
            place = np.array([1.35, 0.0, 1.5]) + sign * rng.uniform(5.5, 8.0) * np.array(normal)
            walls.append(Placed(Sheet((0, 0, 0), normal, along, half=(8.0, 1.5)), np.eye(3), place))
    loose = []
    for sign in (-1.0, 1.0):
        post = np.array([1.35 + rng.uniform(-0.2, 0.2), sign * rng.uniform(1.6, 1.9), 1.3])
        loose.append([Placed(Box((0.15, 0.12, 1.3)), np.eye(3), post, 1.35)])
    for _ in range(rng.integers(0, 5)):
        turn, away = rng.uniform(0.0, 2.0 * np.pi), rng.uniform(1.5, 3.0)
        foot = np.array([1.35 + 1.6 * away * np.cos(turn), away * np.sin(turn), 0.0])
        loose.append(_person(foot, rng))
    clear = [part for parts in loose for part in parts if not _in_view(parts, wheels, stations)]
    return [floor, *walls, *clear]


def _person(foot: Array, rng: np.random.Generator) -> list[Placed]:
    tall = rng.uniform(0.9, 1.1)
    sizes = (((0.16, 0.16, 0.45), 0.45), ((0.27, 0.17, 0.4), 1.15), ((0.1, 0.12, 0.14), 1.65))
    return [
        Placed(Ellipsoid(half), np.eye(3), foot + tall * height * UP, max(half))
        for half, height in sizes
    ]


def _in_view(parts: Sequence[Placed], wheels: Sequence[Wheel], stations: Sequence[Station]) -> bool:
    """Whether any part stands between a station and a target it is there for, or on a station."""
    turn = np.linspace(0.0, 2.0 * np.pi, 24, endpoint=False)
    edge = 1.1 * RADIUS_M * np.column_stack([np.cos(turn), np.sin(turn), np.zeros(24)])
    for station in stations:
        for wheel in wheels:
            if wheel.name in station.wheels:
                run = wheel.centre_m + edge @ wheel.R.T - station.place_m
                place = np.broadcast_to(station.place_m, run.shape)
                if any((part.meet(place, run) < 1.0).any() for part in parts):
                    return True
        if any(np.linalg.norm((part.shift_m - station.place_m)[:2]) < 0.5 for part in parts):
            return True
    return False


def _scan(
    station: Station, pieces: Sequence[Placed], rng: np.random.Generator
) -> tuple[Array, Array]:
    """Points (N, 3), and the piece (N,) on which the whole beam lay, or -1."""
    points, mets = [], []
    for window in station.windows:
        ray, shape = window.rays(station.place_m, rng)
        range_m, met = _trace(pieces, station.place_m, np.zeros(3), ray)
        edge = np.flatnonzero(_near_change(met.reshape(shape)))
        range_m[edge], pure = _mixed(pieces, station.place_m, ray[edge], rng)
        met[edge[~pure]] = -1
        range_m += rng.normal(0.0, station.noise_m, len(range_m))
        if station.step_m:
            range_m = station.step_m * np.round(range_m / station.step_m)
        keep = range_m < 12.0
        points.append(station.place_m + range_m[keep, None] * ray[keep])
        mets.append(met[keep])
    return np.concatenate(points), np.concatenate(mets)


def _trace(
    pieces: Sequence[Placed], station_m: Array, aside_m: Array, ray: Array
) -> tuple[Array, Array]:
    """Range (N,), inf for nothing, and the piece met; rays start aside_m (N, 3) of the station."""
    range_m, met = np.full(len(ray), np.inf), np.full(len(ray), -1)
    origin = np.broadcast_to(station_m + aside_m, ray.shape)
    for index, piece in enumerate(pieces):
        rows = piece.rows(station_m, ray)
        run = piece.meet(origin[rows], ray[rows])
        nearer = run < range_m[rows]
        range_m[rows[nearer]], met[rows[nearer]] = run[nearer], index
    return range_m, met


def _near_change(met: Array) -> Array:
    """Beams (H * W,) of a grid next to one that meets another piece."""
    change = np.zeros(met.shape, dtype=bool)
    for a, b in (
        ((slice(1, None),), (slice(-1),)),
        ((slice(None), slice(1, None)), (slice(None), slice(-1))),
    ):
        differs = met[a] != met[b]
        change[a] |= differs
        change[b] |= differs
    return change.ravel()


def _mixed(
    pieces: Sequence[Placed], station_m: Array, ray: Array, rng: np.random.Generator
) -> tuple[Array, Array]:
    """Mean range over the spot, inf where less than half returns; and who met one piece only."""
    turn = rng.uniform(0.0, 2.0 * np.pi, len(ray))
    first = np.cross(ray, _unit(np.array([0.36, 0.48, 0.8])))
    first /= np.linalg.norm(first, axis=1, keepdims=True)
    second = np.cross(ray, first)
    ranges, mets = [], []
    for index in range(PAIRS):
        place = SPOT_M * np.sqrt((index + 0.5) / PAIRS)
        angle = turn + index * np.pi * (3.0 - np.sqrt(5.0))
        aside = place * (np.cos(angle)[:, None] * first + np.sin(angle)[:, None] * second)
        for start in (aside, -aside):
            range_m, met = _trace(pieces, station_m, start, ray)
            ranges.append(range_m)
            mets.append(met)
    all_m, met = np.array(ranges), np.array(mets)
    hit = np.isfinite(all_m)
    count = hit.sum(axis=0)
    mean = np.where(hit, all_m, 0.0).sum(axis=0) / np.maximum(count, 1)
    return np.where(count >= PAIRS, mean, np.inf), np.all(met == met[0], axis=0)


def _with_strays(points_m: Array, share: float, rng: np.random.Generator) -> Array:
    """The points, and after them strays anywhere within their bounds."""
    low, high = points_m.min(axis=0), points_m.max(axis=0)
    strays = rng.uniform(low, high, (round(share * len(points_m)), 3))
    return np.concatenate([points_m, strays])


def _reach(piece: Piece) -> float:
    """Radius of a ball about the target's centre that holds the piece."""
    if isinstance(piece, Sheet):
        size = piece.outer if piece.half is None else float(np.hypot(*piece.half))
        return float(np.linalg.norm(piece.point)) + size
    if isinstance(piece, Cone):
        return float(np.hypot(piece.outer, piece.depth + piece.fall))
    return float(np.hypot(piece.radius, 0.05))


def _unit(vector: Array) -> Array:
    return vector / np.linalg.norm(vector)
