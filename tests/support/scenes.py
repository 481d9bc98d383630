"""Plates before a scanner, in closed form: clouds whose centre and normal are set, for fast tests.

Target frame: the face is the disc w = 0 about the origin, w towards the scanner; v is up where a
floor is wanted. The scanner stands `distance_m` away at the given incidence, sees an angular grid,
and each beam is a bundle of parallel rays, in opposite pairs,
whose ranges are averaged. The cloud is then turned and
shifted as a rigid body.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from wheelplane_synth.scanner.noise import gaussian_field
from wheelplane_synth.scene.form import Form, draw_form
from wheelplane_synth.scene.obstacle import draw_band

Array = np.ndarray
GOLDEN = np.pi * (3.0 - np.sqrt(5.0))


@dataclass(frozen=True)
class Sheet:
    """A flat piece: a ring about `point` (sectors of it, if spokes > 0), or a rectangle.

    normal and across are its axes in the target frame; half: half widths along `across` and along
    normal x across. inner, outer: radii. echo: how strongly it shines back.
    """

    point: tuple[float, float, float]
    normal: tuple[float, float, float] = (0.0, 0.0, 1.0)
    across: tuple[float, float, float] = (1.0, 0.0, 0.0)
    half: tuple[float, float] | None = None
    inner: float = 0.0
    outer: float = np.inf
    spokes: int = 0
    echo: float = 1.0

    def meet(self, origin: Array, ray: Array) -> Array:
        n, a = np.array(self.normal, float), np.array(self.across, float)
        n /= np.linalg.norm(n)
        a = a - (a @ n) * n
        a /= np.linalg.norm(a)
        b = np.cross(n, a)
        with np.errstate(divide="ignore", invalid="ignore"):
            run = ((np.array(self.point) - origin) @ n) / (ray @ n)
        local = origin + run[:, None] * ray - np.array(self.point)
        s, t = local @ a, local @ b
        if self.half is not None:
            inside = (np.abs(s) <= self.half[0]) & (np.abs(t) <= self.half[1])
        else:
            square = s * s + t * t
            inside = (square >= self.inner**2) & (square <= self.outer**2)
            if self.spokes:
                inside &= np.cos(self.spokes * np.arctan2(t, s)) > 0.0
        return np.where(inside & (run > 0.0), run, np.inf)


@dataclass(frozen=True)
class Wall:
    """The plate's side: the cylinder of `radius` from w = -top down to w = -thickness."""

    radius: float
    thickness: float
    echo: float = 1.0
    top: float = 0.0

    def meet(self, origin: Array, ray: Array) -> Array:
        square = np.sum(ray[:, :2] ** 2, axis=1)
        along = np.sum(origin[:, :2] * ray[:, :2], axis=1)
        rest = np.sum(origin[:, :2] ** 2, axis=1) - self.radius**2
        with np.errstate(divide="ignore", invalid="ignore"):
            run = (-along - np.sqrt(along**2 - square * rest)) / square
        w = origin[:, 2] + run * ray[:, 2]
        return np.where((run > 0.0) & (w <= -self.top) & (w >= -self.thickness), run, np.inf)


@dataclass(frozen=True)
class Cone:
    """A sidewall or a chamfer: from radius `inner` at `depth` to `outer` at `depth + fall`."""

    inner: float
    outer: float
    depth: float
    fall: float
    echo: float = 1.0

    def meet(self, origin: Array, ray: Array) -> Array:
        slope = (self.outer - self.inner) / self.fall
        start = self.inner - slope * (origin[:, 2] + self.depth)
        grow = -slope * ray[:, 2]
        a = np.sum(ray[:, :2] ** 2, axis=1) - grow**2
        b = np.sum(origin[:, :2] * ray[:, :2], axis=1) - start * grow
        c = np.sum(origin[:, :2] ** 2, axis=1) - start**2
        best = np.full(len(ray), np.inf)
        with np.errstate(divide="ignore", invalid="ignore"):
            root = np.sqrt(b * b - a * c)
            for run in ((-b - root) / a, (-b + root) / a):
                reach = start + run * grow
                good = (run > 0.0) & (reach >= self.inner) & (reach <= self.outer)
                best = np.where(good & (run < best), run, best)
        return best


@dataclass(frozen=True)
class FoundTarget:
    """The plate's face: the disc w = 0 of `radius`, with the heights of its form.

    The form is microns high over decimetres, so the ray meets it where it meets w = 0.
    """

    radius: float
    form: Form
    echo: float = 1.0

    def meet(self, origin: Array, ray: Array) -> Array:
        run = Sheet((0, 0, 0), outer=self.radius).meet(origin, ray)
        foot = (origin + np.where(np.isfinite(run), run, 0.0)[:, None] * ray)[:, :2]
        return run + self.form.height_m(foot) / ray[:, 2]


@dataclass(frozen=True)
class HoledFace:
    """A flat face w = 0, `whole`, with round holes, rows (u, v, radius)."""

    whole: Sheet
    holes: tuple[tuple[float, float, float], ...]
    echo: float = 1.0

    def meet(self, origin: Array, ray: Array) -> Array:
        run = self.whole.meet(origin, ray)
        foot = origin + np.where(np.isfinite(run), run, 0.0)[:, None] * ray
        for u, v, radius in self.holes:
            through = np.hypot(foot[:, 0] - u, foot[:, 1] - v) < radius
            run = np.where(through, np.inf, run)
        return run


@dataclass(frozen=True)
class HoleWall:
    """The side of a hole: the cylinder about (u, v), seen from within, down to -thickness."""

    middle: tuple[float, float]
    radius: float
    thickness: float
    echo: float = 1.0

    def meet(self, origin: Array, ray: Array) -> Array:
        start = origin[:, :2] - np.array(self.middle)
        square = np.sum(ray[:, :2] ** 2, axis=1)
        along = np.sum(start * ray[:, :2], axis=1)
        rest = np.sum(start**2, axis=1) - self.radius**2
        with np.errstate(divide="ignore", invalid="ignore"):
            run = (-along + np.sqrt(along**2 - square * rest)) / square
        w = origin[:, 2] + run * ray[:, 2]
        return np.where((run > 0.0) & (w <= 0.0) & (w >= -self.thickness), run, np.inf)


Piece = Sheet | Wall | Cone | FoundTarget | HoledFace | HoleWall


@dataclass(frozen=True)
class Setup:
    """What stands where and how it is scanned; lengths in metres, angles in degrees.

    background_m: depth of a plane behind the face, None for none; background_tilt_deg: its tilt.
    noise_m: along the range. spot_m: radius of the bundle, spot_aspect: its length over its width,
    of the same area. filtered: beams whose rays differ by
    more than 2 mm return nothing. extra: pieces besides the plate and the background.
    keep: which beams return, by where they meet w = 0, in (u, v); None for all.
    correlated_m, length_m: noise along the range besides, of correlation exp(-d^2 / (2 length^2))
    across the beams at the plate's distance. flatness_m: of the face. hidden: share of the face
    behind a strip, `strip_m` before it. half_m: half widths of a rectangular plate, instead of
    radius_m. chamfer_m: of a disc's rim; rounded: of that radius. ambiguity_m: of a phase-shift
    scanner, whose phases add as vectors; 0: the ranges' mean. holes: rows (u, v, radius).
    printed: brightness of the face at places (u, v), which gives the cloud intensities, of relative
    noise intensity_noise, and weighs the ranges.
    """

    radius_m: float = 0.125
    thickness_m: float = 0.01
    background_m: float | None = 0.08
    background_tilt_deg: float = 4.0
    background_echo: float = 1.0
    extra: tuple[Piece, ...] = ()
    distance_m: float = 2.5
    incidence_deg: float = 15.0
    azimuth_deg: float = 30.0
    spacing_m: float = 0.0012
    half_width_m: float = 0.2
    aside_m: tuple[float, float] = (0.0, 0.0)
    noise_m: float = 0.0008
    pointing_m: float = 0.0
    spot_m: float = 0.0015
    spot_aspect: float = 1.0
    filtered: bool = False
    dropout: float = 0.0
    keep: Callable[[Array, Array], Array] | None = None
    shift_m: tuple[float, float, float] = (3.0, -7.0, 1.5)
    turned: bool = True
    pairs: int = 16
    correlated_m: float = 0.0
    length_m: float = 0.0
    flatness_m: float = 0.0
    hidden: float = 0.0
    strip_m: float = 0.15
    half_m: tuple[float, float] | None = None
    chamfer_m: float = 0.0
    rounded: bool = False
    ambiguity_m: float = 0.0
    holes: tuple[tuple[float, float, float], ...] = ()
    printed: Callable[[Array, Array], Array] | None = None
    intensity_noise: float = 0.03

    def but(self, **changes: object) -> Setup:
        return replace(self, **changes)


@dataclass(frozen=True)
class Cloud:
    """points_m (N, 3), and what is true of them: centre, normal towards the scanner, viewpoint.

    on_face (N,): the whole beam lay on the face. face_m: (M, 3) those points.
    R, shift_m: points = R @ target frame + shift.
    """

    points_m: Array
    centre_m: Array
    normal: Array
    viewpoint_m: Array
    on_face: Array
    R: Array
    shift_m: Array
    setup: Setup = field(repr=False)
    intensity: Array | None = None

    @property
    def face_m(self) -> Array:
        return self.points_m[self.on_face]

    def in_target(self, points_m: Array) -> Array:
        """Points (..., 3) in the target frame."""
        return (points_m - self.shift_m) @ self.R


def rotation(rng: np.random.Generator) -> Array:
    """A uniform proper rotation (3, 3)."""
    Q, upper = np.linalg.qr(rng.normal(size=(3, 3)))
    Q = Q * np.sign(np.diag(upper))
    return Q if np.linalg.det(Q) > 0 else -Q


def make(setup: Setup, seed: int | np.random.Generator = 0, pose: Array | None = None) -> Cloud:
    """Scan `setup`; the seed draws pose, noise, grid phase, drop-outs, form and what is hidden.

    pose: (4, 4) from the target frame to the cloud's, instead of a drawn one.
    """
    rng = np.random.default_rng(seed)
    R = rotation(rng) if setup.turned else np.eye(3)
    shift = np.array(setup.shift_m)
    if pose is not None:
        R, shift = pose[:3, :3], pose[:3, 3]
    scanner = _scanner(setup)
    beams = _grid(setup, scanner, rng)
    local, on_face, intensity = _returns(setup, scanner, beams, rng)
    return Cloud(
        points_m=local @ R.T + shift,
        centre_m=shift,
        normal=R[:, 2],
        viewpoint_m=R @ scanner + shift,
        on_face=on_face,
        R=R,
        shift_m=shift,
        setup=setup,
        intensity=intensity,
    )


def wheel_pieces() -> tuple[Piece, ...]:
    """Spoked rim parallel to the target, tyre, a body panel larger than the target, a floor."""
    return (
        Sheet((0, 0, -0.045), outer=0.2, spokes=5),
        Sheet((0, 0, -0.055), inner=0.19, outer=0.215),
        Cone(0.215, 0.31, 0.05, 0.03),
        Sheet((0.15, 0.62, -0.06), normal=(0.05, 0.12, 1.0), half=(0.6, 0.27)),
        Sheet((0.0, -0.31, 0.3), normal=(0, 1, 0), half=(1.0, 1.0)),
    )


WHEEL = Setup(
    background_m=0.14,
    background_tilt_deg=2.0,
    extra=wheel_pieces(),
    half_width_m=0.36,
    spacing_m=0.003,
    azimuth_deg=60.0,
    pairs=8,
)


def _scanner(setup: Setup) -> Array:
    lean, turn = np.radians([setup.incidence_deg, setup.azimuth_deg])
    aside = np.sin(lean)
    return setup.distance_m * np.array([aside * np.cos(turn), aside * np.sin(turn), np.cos(lean)])


def _grid(setup: Setup, scanner: Array, rng: np.random.Generator) -> tuple[Array, tuple[int, int]]:
    """Unit directions (H * W, 3) of an angular grid about the plate, turned about its axis."""
    aim = np.array([*setup.aside_m, 0.0]) - scanner
    aim /= np.linalg.norm(aim)
    first = np.cross(aim, rng.normal(size=3))
    first /= np.linalg.norm(first)
    second = np.cross(aim, first)
    step = setup.spacing_m / setup.distance_m
    half = round(setup.half_width_m / setup.spacing_m)
    ticks = np.arange(-half, half + 1) * step
    azimuth = ticks + rng.uniform(-0.5, 0.5) * step
    height = ticks + rng.uniform(-0.5, 0.5) * step
    height, azimuth = np.meshgrid(height, azimuth, indexing="ij")
    if setup.pointing_m:
        height = height + rng.normal(0, setup.pointing_m / setup.distance_m, height.shape)
        azimuth = azimuth + rng.normal(0, setup.pointing_m / setup.distance_m, height.shape)
    out, level = np.cos(height) * np.cos(azimuth), np.cos(height) * np.sin(azimuth)
    ray = out[..., None] * aim + level[..., None] * first + np.sin(height)[..., None] * second
    return ray.reshape(-1, 3), out.shape


def _pieces(setup: Setup, rng: np.random.Generator) -> list[Piece]:
    face: Piece = Sheet((0, 0, 0), outer=setup.radius_m)
    if setup.flatness_m:
        face = FoundTarget(setup.radius_m, draw_form(setup.radius_m, setup.flatness_m, rng))
    pieces: list[Piece] = [face, Wall(setup.radius_m, setup.thickness_m)]
    if setup.chamfer_m:
        radius, chamfer = setup.radius_m, setup.chamfer_m
        turn = np.linspace(0.0, np.pi / 2.0, 9 if setup.rounded else 2)
        out, down = radius - chamfer + chamfer * np.sin(turn), chamfer * (1.0 - np.cos(turn))
        pieces = [
            Sheet((0, 0, 0), outer=radius - chamfer),
            *(Cone(*out[k : k + 2], down[k], down[k + 1] - down[k]) for k in range(len(out) - 1)),
            Wall(radius, setup.thickness_m, top=chamfer),
        ]
    if setup.half_m is not None:
        face = Sheet((0, 0, 0), half=setup.half_m)
        pieces = [face, *_straight_walls(setup.half_m, setup.thickness_m)]
    if setup.holes:
        assert isinstance(face, Sheet)
        pieces[0] = HoledFace(face, setup.holes)
        pieces += [HoleWall((u, v), r, setup.thickness_m) for u, v, r in setup.holes]
    if setup.hidden:
        pieces.append(_strip(setup, rng))
    if setup.background_m is not None:
        tilt = np.radians(setup.background_tilt_deg)
        pieces.append(
            Sheet(
                (0, 0, -setup.background_m),
                normal=(0.6 * np.sin(tilt), -0.8 * np.sin(tilt), np.cos(tilt)),
                echo=setup.background_echo,
            )
        )
    return pieces + list(setup.extra)


def _straight_walls(half: tuple[float, float], thickness: float) -> list[Piece]:
    a, b = half
    deep = -thickness / 2
    return [
        Sheet((a, 0, deep), (1, 0, 0), (0, 1, 0), (b, thickness / 2)),
        Sheet((-a, 0, deep), (1, 0, 0), (0, 1, 0), (b, thickness / 2)),
        Sheet((0, b, deep), (0, 1, 0), (1, 0, 0), (a, thickness / 2)),
        Sheet((0, -b, deep), (0, 1, 0), (1, 0, 0), (a, thickness / 2)),
    ]


def _strip(setup: Setup, rng: np.random.Generator) -> Sheet:
    """A strip parallel to the face whose shadow hides `hidden` of it, anywhere across it."""
    low, high = setup.radius_m * np.array(draw_band(setup.hidden, rng))
    turn = rng.uniform(0.0, 2.0 * np.pi)
    across = np.array([np.cos(turn), np.sin(turn), 0.0])
    scanner = _scanner(setup)
    nearer = setup.strip_m / scanner[2]
    middle = (1.0 - nearer) * (low + high) / 2.0 * across + nearer * scanner
    half = (1.0 - nearer) * (high - low) / 2.0
    return Sheet(tuple(middle), across=tuple(across), half=(half, 1.0))


def _trace(pieces: Sequence[Piece], origin: Array, ray: Array) -> tuple[Array, Array]:
    """Range (N,), inf for nothing, and the index of the piece met (N,), -1 for none."""
    range_m, met = np.full(len(ray), np.inf), np.full(len(ray), -1)
    for index, piece in enumerate(pieces):
        run = piece.meet(origin, ray)
        nearer = run < range_m
        range_m[nearer], met[nearer] = run[nearer], index
    return range_m, met


def _returns(
    setup: Setup, scanner: Array, grid: tuple[Array, tuple[int, int]], rng: np.random.Generator
) -> tuple[Array, Array, Array | None]:
    """Points in the target frame, which lie on the face with their whole beam, intensities."""
    ray, shape = grid
    pieces = _pieces(setup, rng)
    range_m, met = _trace(pieces, np.broadcast_to(scanner, ray.shape), ray)
    pure, light = np.ones(len(ray), dtype=bool), np.ones(len(ray))
    if setup.spot_m > 0.0:
        longest_m = setup.spot_m * np.sqrt(setup.spot_aspect)
        reach = int(np.ceil(1.05 * longest_m / setup.spacing_m))
        near = _near_change(met.reshape(shape), reach)
        if setup.printed is not None:
            near |= met == 0
        mixed = np.flatnonzero(near)
        mean = _mean_range(setup, pieces, scanner, ray[mixed], rng)
        range_m[mixed], pure[mixed], light[mixed] = mean
    keep = np.isfinite(range_m)
    if setup.filtered:
        keep &= pure
    if setup.dropout:
        keep &= rng.random(len(ray)) >= setup.dropout
    if setup.keep is not None:
        foot = scanner - ray * (scanner[2] / ray[:, 2])[:, None]
        keep &= setup.keep(foot[:, 0], foot[:, 1])
    if setup.noise_m:
        range_m = range_m + rng.normal(0.0, setup.noise_m, len(range_m))
    if setup.correlated_m:
        steps = setup.length_m / setup.spacing_m
        noise = gaussian_field(shape, (steps, steps), rng).ravel()
        range_m = range_m + setup.correlated_m * noise
    intensity = None
    if setup.printed is not None:
        intensity = (light * (1.0 + rng.normal(0.0, setup.intensity_noise, len(light))))[keep]
    return scanner + range_m[keep, None] * ray[keep], (pure & (met == 0))[keep], intensity


def _near_change(met: Array, reach: int) -> Array:
    """Beams (H, W) of a grid within `reach` of another that meets another piece."""
    change = np.zeros(met.shape, dtype=bool)
    change[1:] |= met[1:] != met[:-1]
    change[:, 1:] |= met[:, 1:] != met[:, :-1]
    for _ in range(2):
        padded = np.pad(change, ((reach + 1, reach), (0, 0))).astype(np.int32)
        running = np.cumsum(padded, axis=0)
        change = (running[2 * reach + 1 :] > running[: -2 * reach - 1]).T
    return change.ravel()


def _mean_range(
    setup: Setup, pieces: Sequence[Piece], scanner: Array, ray: Array, rng: np.random.Generator
) -> tuple[Array, Array, Array]:
    """Mean over the bundle, weighted by echo, inf where under half returns; who is pure; light."""
    half = np.arange(setup.pairs)
    count = 2 * setup.pairs
    place = np.tile(setup.spot_m * np.sqrt((half + 0.5) / setup.pairs), 2)
    opposite = np.concatenate([GOLDEN * half, GOLDEN * half + np.pi])  # a plane's mean is exact
    turn = opposite + rng.uniform(0, 2 * np.pi, (len(ray), 1))
    first = np.cross(ray, [0.36, 0.48, 0.8])
    first /= np.linalg.norm(first, axis=1, keepdims=True)
    second = np.cross(ray, first) / np.sqrt(setup.spot_aspect)
    first *= np.sqrt(setup.spot_aspect)
    origin = (
        scanner
        + (place * np.cos(turn))[..., None] * first[:, None, :]
        + (place * np.sin(turn))[..., None] * second[:, None, :]
    )
    many = np.repeat(ray, count, axis=0)
    range_m, met = _trace(pieces, origin.reshape(-1, 3), many)
    brightness = np.ones(range_m.shape)
    if setup.printed is not None:
        foot = (origin.reshape(-1, 3) + range_m[:, None] * many)[met == 0]
        brightness[met == 0] = setup.printed(foot[:, 0], foot[:, 1])
    range_m, met = range_m.reshape(-1, count), met.reshape(-1, count)
    hit = np.isfinite(range_m)
    echo = np.where(hit, np.array([p.echo for p in pieces] + [0.0])[met], 0.0)
    echo *= brightness.reshape(-1, count)
    with np.errstate(invalid="ignore", divide="ignore"):
        mean = np.sum(np.where(hit, range_m, 0.0) * echo, axis=1) / echo.sum(axis=1)
        if setup.ambiguity_m:
            aside = np.where(hit, range_m - mean[:, None], 0.0) * (2j * np.pi / setup.ambiguity_m)
            vector = np.sum(echo * np.exp(aside), axis=1)
            mean = mean + np.angle(vector) * setup.ambiguity_m / (2.0 * np.pi)
    mean[hit.sum(axis=1) * 2 < count] = np.inf
    return mean, np.all(met == met[:, :1], axis=1), echo.mean(axis=1)
