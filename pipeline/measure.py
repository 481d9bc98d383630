"""The whole story: from scans, or from five points a wheel, to angles with their uncertainty."""

from __future__ import annotations

from collections.abc import Callable

from pipeline.align import align
from pipeline.capture import Capture
from pipeline.config import Config
from pipeline.face_map import face_map
from pipeline.fit_plane import fit_plane
from pipeline.five_point_file import FivePointFile
from pipeline.locate_centre import locate_centre
from pipeline.measurement import Evidence, Measurement, Provenance
from pipeline.observe import observe_block, pooled_noise
from pipeline.observe_capture import observe_capture
from pipeline.patch import Patch
from pipeline.point_causes import Station
from pipeline.readers import Scan
from pipeline.segment import find_target
from pipeline.stated_causes import add_stated_causes, noisy
from pipeline.targets import Target


def measure_scan(scan: Scan, target: Target, config: Config) -> Evidence:
    """Plane and centre of the one target that a scan shows. Raises NotMeasuredError."""
    patch = find_target(scan.points_m, target, config.segment, config.seed, scan.intensity)
    return fit_target(patch, target, config)


def fit_target(patch: Patch, target: Target, config: Config) -> Evidence:
    """Plane and centre of the target in `patch`. Raises NotMeasuredError."""
    plane = fit_plane(patch, target, config.plane)
    fitted = locate_centre(patch, plane, target, config.centre)
    fitted = add_stated_causes(fitted, plane, target, config.instrument)
    seen = face_map(patch, plane, fitted, target, config.plane.edge_margin_m)
    return Evidence(fitted, plane, seen)


def measure_capture(
    capture: Capture,
    config: Config,
    progress: Callable[[str], None] = lambda _: None,
    fit: Callable[[Patch, Target, Config], Evidence] = fit_target,
) -> Measurement:
    """Toe, camber and the vehicle's quantities of a capture: scans of its wheels, or one of all.

    fit: fits the target that a scan shows; one that also looks at its points may stand in.

    Raises InputError for a scan that cannot be read, for wheels that cannot be told apart, and for
    a reference wheel whose target cannot be measured; a trial that cannot be measured stays in the
    result with its status.
    """
    observations, naming = observe_capture(capture, config, fit, progress)
    made = Provenance.of_capture(capture, config, observations, naming)
    return align(observations, made, [*made.said, *noisy(observations, config.instrument)])


def measure_five_point(file: FivePointFile, station: Station | None = None) -> Measurement:
    """The same from the paper's five points a plane, by total least squares.

    station: whose own uncertainty counts; without it, the scatter of the points alone.
    """
    noise = pooled_noise(file.blocks_m, station)
    blocks = range(len(file.blocks_m))
    observations = [observe_block(file, index, noise, station) for index in blocks]
    return align(observations, Provenance.of_five_point(file, observations, station), file.notes)
