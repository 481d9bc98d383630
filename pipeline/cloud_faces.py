"""The faces in the cloud of a whole vehicle: read, searched, and the cloud let go."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

from pipeline.axles import Face
from pipeline.capture import Capture
from pipeline.config import Config
from pipeline.errors import InputError, NotMeasuredError
from pipeline.faces import find_faces
from pipeline.kernels import Array
from pipeline.passes import sample
from pipeline.patch import Patch
from pipeline.plausible import check_vehicle_cloud
from pipeline.readers import read_scan
from pipeline.readers.scan import Part
from pipeline.scan_entry import ScanEntry

SAMPLE = 400_000  # points kept of the cloud, by which its floor is found


@dataclass(frozen=True)
class Found:
    """What a cloud showed, its points but a sample let go.

    scans: of each patch, the name of the file's scan that it was taken from; '' of one alone.
    """

    patches: tuple[Patch, ...]
    scans: tuple[str, ...]
    sample_m: Array
    points: int
    missing_returns: int

    @property
    def faces(self) -> tuple[Face, ...]:
        """The patches as the naming of wheels sees them."""
        return tuple(Face(p.origin_m, p.basis[2], p.match) for p in self.patches)


def faces_of_cloud(
    cloud: ScanEntry,
    source: str,
    capture: Capture,
    config: Config,
    progress: Callable[[str], None],
) -> Found:
    """The faces of the target; messages call the file `source`.

    Raises InputError when it is unreadable, or cannot be the cloud of a vehicle.
    """
    progress(f"{cloud.file}: reading")
    scan = read_scan(cloud.path, capture.length_unit, source)
    target, unit = capture.target, capture.length_unit
    check_vehicle_cloud(scan.points_m, 2.0 * target.radius_m, unit, source)
    progress(f"{cloud.file}: searching")
    parts = scan.parts or (Part("", 0, len(scan.points_m), None),)
    rows, stations = [(p.start, p.stop) for p in parts], [p.station_m for p in parts]
    try:
        patches = find_faces(scan.points_m, target, config.segment, scan.intensity, rows, stations)
    except NotMeasuredError as error:
        raise InputError(f"{source}: {error}: check the file, and --target") from error
    return Found(
        patches=patches,
        scans=tuple(parts[patch.part].name if len(parts) > 1 else "" for patch in patches),
        sample_m=sample(scan.points_m, SAMPLE),
        points=len(scan.points_m),
        missing_returns=scan.missing_returns,
    )
