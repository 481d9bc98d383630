"""The whole story: from scans, or from five points a wheel, to angles with their uncertainty."""

from __future__ import annotations

from collections.abc import Callable

from pipeline.align import align
from pipeline.capture import Capture
from pipeline.config import Config, DiscTarget
from pipeline.face_map import face_map
from pipeline.fit_plane import fit_plane
from pipeline.five_point_file import FivePointFile
from pipeline.locate_centre import locate_centre
from pipeline.measurement import Evidence, Measurement, Provenance
from pipeline.observe import observe_block, observe_entry, pooled_noise
from pipeline.readers import Scan
from pipeline.segment import Patch, find_target


def measure_scan(scan: Scan, target: DiscTarget, config: Config) -> Evidence:
    """Plane and centre of the one target that a scan shows. Raises NotMeasuredError."""
    return fit_target(
        find_target(scan.points_m, target, config.segment, config.seed), target, config
    )


def fit_target(patch: Patch, target: DiscTarget, config: Config) -> Evidence:
    """Plane and centre of the target in `patch`. Raises NotMeasuredError."""
    plane = fit_plane(patch, target.radius_m, config.plane)
    fitted = locate_centre(patch, plane, target, config.centre)
    return Evidence(fitted, plane, face_map(patch, plane, fitted, target.radius_m))


def measure_capture(
    capture: Capture, config: Config, progress: Callable[[str], None] = lambda _: None
) -> Measurement:
    """Toe, camber and the vehicle's quantities of a capture of laser scans.

    Raises InputError for a scan that cannot be read and for a reference wheel whose target cannot
    be measured; a trial that cannot be measured stays in the result with its status.
    """
    observations = [
        observe_entry(entry, capture, config, fit_target, progress) for entry in capture.entries
    ]
    return align(observations, Provenance.of_capture(capture, config, observations))


def measure_five_point(file: FivePointFile) -> Measurement:
    """The same from the paper's five points a plane, by total least squares."""
    noise = pooled_noise(file.blocks_m)
    observations = [observe_block(file, index, noise) for index in range(len(file.blocks_m))]
    return align(observations, Provenance.of_five_point(file, observations), file.notes)
