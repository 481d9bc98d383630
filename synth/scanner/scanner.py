"""A terrestrial laser scanner: beams on an angular grid, each with a footprint and its errors.

Station coordinates have the axes of the site and the origin in the scanner.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache

import numpy as np
import numpy.typing as npt

from ..arrays import Array, Array32, Mask
from ..errors import SynthError
from ..parameters.parameters import Beam, Calibration, Grid, Station
from ..parameters.recipe import Recipe
from ..scene.scene import Scene
from ..vehicle.vehicle import Vehicle, Wheel
from .echoes import Echoes
from .noise import by_surfaces, gaussian_field
from .raycast import RayCaster
from .spot import spot_echoes
from .systematic import EXACT, LIGHT, biased, measured_angles, measured_range_m

NEAREST_STRAY_M = 0.5
TRIES = 1000
MOST_BEAMS = 20_000_000
DARKEST = 0.01  # albedo below which the noise grows no more


@dataclass(frozen=True)
class Stand:
    """Position of the scanner for one wheel, position_vehicle_m (3,)."""

    position_vehicle_m: Array
    distance_m: float
    incidence_rad: float


@dataclass(frozen=True)
class Scan:
    """One scan: points_station_m (N, 3), intensity (N,), and the target of each point.

    target (N,): number of the target on whose face the whole spot lies, else -1. beams: number of
    beams emitted. Strays are among the points and on no target.
    """

    points_station_m: Array
    intensity: Array32
    target: npt.NDArray[np.int64]
    beams: int

    @property
    def on_front(self) -> Mask:
        """Mask (N,) of the points on a measured face."""
        return self.target >= 0

    def with_returns(self, other: Scan) -> Scan:
        """Return the points of both, which are other returns of the same beams."""
        return Scan(
            np.concatenate([self.points_station_m, other.points_station_m]),
            np.concatenate([self.intensity, other.intensity]),
            np.concatenate([self.target, other.target]),
            self.beams,
        )


@dataclass(frozen=True)
class SharedNoise:
    """Range noise that beams share: correlated, of unit variance, and of lines; (N,) or empty."""

    correlated: Array
    of_line_m: Array


def draw_stand(vehicle: Vehicle, wheel: Wheel, recipe: Recipe, rng: np.random.Generator) -> Stand:
    """Draw a position in any direction round the target's axis, within the allowed heights."""
    station = recipe.draw("station", Station, rng)
    incidence = np.radians(station.incidence_deg)
    axes = wheel.T_vehicle_target[:3, :3]
    for turn in rng.uniform(0, 2 * np.pi, TRIES):
        toward = axes @ [
            np.sin(incidence) * np.cos(turn),
            np.sin(incidence) * np.sin(turn),
            np.cos(incidence),
        ]
        position = wheel.centre_vehicle_m + station.distance_m * toward
        if station.height_min_m <= position[2] - vehicle.floor_m <= station.height_max_m:
            return Stand(position, station.distance_m, float(incidence))
    raise SynthError(
        f"{recipe.source}: no position {station.distance_m:.2f} m from target {wheel.name} at "
        f"{station.incidence_deg:.1f} degrees is {station.height_min_m} to {station.height_max_m} "
        "m above the floor; widen station.height_min_m and station.height_max_m"
    )


def scan(
    scene: Scene,
    centre_station_m: Array,
    grid: Grid,
    beam: Beam,
    rng: np.random.Generator,
    calibration: Calibration = EXACT,
) -> Scan:
    """Scan the window round the target's centre (3,).

    The beam's direction is jittered about the nominal one, which is the one reported, with the
    errors of the instrument's calibration.
    """
    step = grid.spacing_m / float(np.linalg.norm(centre_station_m))
    azimuth, elevation = _window(centre_station_m, grid, step, rng)
    jitter = rng.normal(0.0, 1.0, (2, *elevation.shape)) * beam.angle_sigma_urad * 1e-6
    true = directions(azimuth + jitter[0] / np.cos(elevation), elevation + jitter[1])
    caster = RayCaster(scene.vertices_m, scene.faces)

    @cache
    def shared() -> SharedNoise:
        return shared_noise(elevation, grid, beam, rng)

    def reported(echoes: Echoes) -> Scan:
        range_m = echoes.range_m.reshape(elevation.shape)
        angles = measured_angles(azimuth, elevation, range_m, calibration)
        noise_m = rng.normal(0.0, 1.0, elevation.size)
        noise_m = range_noise(noise_m, shared(), echoes, beam)
        if scene.optics is not None:
            echoes, noise_m = by_surfaces(echoes, noise_m, scene.optics, rng)
        nominal = directions(*angles).reshape(-1, 3)
        return report(echoes, nominal, noise_m, beam, rng, calibration, shape=elevation.shape)

    if beam.return_mode != "two":
        return reported(spot_echoes(scene, caster, true, step, beam))
    first, last = (
        spot_echoes(scene, caster, true, step, beam.model_copy(update={"return_mode": mode}))
        for mode in ("first", "last")
    )
    last.range_m[last.range_m == first.range_m] = np.nan  # a beam of one return
    return reported(first).with_returns(reported(last))


def directions(azimuth_rad: Array, elevation_rad: Array) -> Array:
    """Return unit vectors (..., 3) of azimuth about z from x, and elevation above the horizon."""
    level = np.cos(elevation_rad)
    return np.stack(
        [level * np.cos(azimuth_rad), level * np.sin(azimuth_rad), np.sin(elevation_rad)], axis=-1
    )


def range_sigma_m(sigma_m: float, echoes: Echoes, beam: Beam) -> Array:
    """Return the standard deviation (N,) of the ranges; sigma_m of a light surface seen squarely.

    sigma / max(cos(incidence), 0.2): the power that returns falls with the cosine
    (Soudarissanane et al., ISPRS J. Photogramm. 66 (2011) 389-399). Across a plane that is
    sigma_m itself at any incidence up to 78 degrees. Times (0.8 / albedo) to the power of
    beam.noise_by_brightness, as of intensity in Wujanz et al., ISPRS J. Photogramm. 125 (2017) 146.
    """
    dimness = LIGHT / np.maximum(echoes.reflectance, DARKEST)
    return sigma_m / np.maximum(echoes.cosine, 0.2) * dimness**beam.noise_by_brightness


def _window(
    centre_m: Array, grid: Grid, step_rad: float, rng: np.random.Generator
) -> tuple[Array, Array]:
    """Return azimuth and elevation, both (H, W), of a window of the grid, its phase drawn."""
    x, y, z = centre_m
    level_m = np.hypot(x, y)
    half = grid.half_width_m
    rows = int(np.arctan2(half, np.linalg.norm(centre_m)) / step_rad)
    columns = int(np.arctan2(half, level_m) / step_rad)
    if 4 * rows * columns > MOST_BEAMS:
        raise SynthError(
            f"grid: spacing_m {grid.spacing_m} and half_width_m {half} make "
            f"{4e-6 * rows * columns:.0f} million beams, more than {MOST_BEAMS / 1e6:.0f}; "
            "increase the spacing or narrow the window"
        )
    phase = rng.uniform(-0.5, 0.5, 2)
    azimuth = np.arctan2(y, x) + (np.arange(-columns, columns + 1) + phase[0]) * step_rad
    elevation = np.arctan2(z, level_m) + (np.arange(-rows, rows + 1) + phase[1]) * step_rad
    wide, high = np.meshgrid(azimuth, elevation)
    return wide, high


def shared_noise(elevation: Array, grid: Grid, beam: Beam, rng: np.random.Generator) -> SharedNoise:
    """Draw the range noise that beams of a grid (H, W) share, and all returns of each beam.

    Columns of the grid are closer than its rows by the cosine of the elevation.
    """
    correlated, of_line_m = np.zeros(0), np.zeros(0)
    if beam.correlated_sigma_m > 0.0:
        steps = beam.correlation_length_m / grid.spacing_m
        level = float(np.cos(np.mean(elevation)))
        lengths = (steps, beam.correlation_aspect * steps / level)
        correlated = gaussian_field(elevation.shape, lengths, rng).ravel()
    if beam.line_sigma_m > 0.0:
        lines = elevation.shape[0] if beam.scan_lines == "rows" else elevation.shape[1]
        offset = rng.standard_normal((lines,))
        of_line_m = beam.line_sigma_m * along_lines(offset, elevation, beam)
    return SharedNoise(correlated, of_line_m)


def range_noise(own: Array, shared: SharedNoise, echoes: Echoes, beam: Beam) -> Array:
    """Return the range noise (N,): independent, correlated over a length, and by scan lines.

    own: (N,) independent draws, unit variance.
    """
    noise_m = own * range_sigma_m(beam.range_sigma_m, echoes, beam)
    if len(shared.correlated):
        noise_m += shared.correlated * range_sigma_m(beam.correlated_sigma_m, echoes, beam)
    if len(shared.of_line_m):
        noise_m += shared.of_line_m
    return noise_m


def along_lines(offset: Array, grid: Array, beam: Beam) -> Array:
    """Return for each beam of a grid (H, W), flat, the offset of its scan line."""
    of_line = offset[:, None] if beam.scan_lines == "rows" else offset
    return np.broadcast_to(of_line, grid.shape).ravel()


def at_edges(range_m: Array, step_m: float) -> Mask:
    """Return which of a grid's points (H, W) differ by more than a step from one beside them.

    Of the eight on its rows and columns; those without a range, NaN, do not count.
    """
    high, wide = range_m.shape
    padded = np.pad(range_m, 1, constant_values=np.nan)
    beside = [padded[i : i + high, j : j + wide] for i in range(3) for j in range(3)]
    return np.asarray(np.any([np.abs(one - range_m) > step_m for one in beside], axis=0))


def report(
    echoes: Echoes,
    nominal: Array,
    noise_m: Array,
    beam: Beam,
    rng: np.random.Generator,
    calibration: Calibration = EXACT,
    origins_m: Array | float = 0.0,
    shape: tuple[int, ...] = (),
) -> Scan:
    """Return the scan of beams with unit vectors nominal (N, 3), as the scanner reports it.

    It has range noise, strays, drop-outs and intensity; beams without an echo are left out, and
    those that are filtered. shape: (H, W) of the beams' grid, by which edges are filtered.
    """
    count = len(nominal)
    echoes = biased(echoes, beam)
    true_m = echoes.range_m
    range_m = measured_range_m(true_m, calibration) + noise_m
    stray = rng.random(count) < beam.stray_fraction
    anywhere_m = NEAREST_STRAY_M + rng.random(count) * (1.2 * true_m - NEAREST_STRAY_M)
    range_m = np.where(stray, anywhere_m, range_m)
    kept = (rng.random(count) >= beam.dropout_fraction) & ~np.isnan(true_m)
    power = echoes.reflectance * echoes.cosine / np.maximum(range_m, NEAREST_STRAY_M) ** 2
    kept &= power >= beam.detector_threshold
    if beam.edge_filter_m > 0.0 and shape:
        kept &= ~at_edges(
            np.where(kept, range_m, np.nan).reshape(shape), beam.edge_filter_m
        ).ravel()
    speckle = 1 + beam.intensity_sigma * rng.normal(0.0, 1.0, count)
    intensity = np.maximum(power * speckle, 0.0).astype(np.float32)
    points = (nominal * range_m[:, None] + origins_m)[kept]
    return Scan(points, intensity[kept], np.where(stray, -1, echoes.target)[kept], count)
