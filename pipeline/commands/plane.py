"""`wheelplane plane`: the planes of a single point cloud."""

from __future__ import annotations

import json
import math
from collections.abc import Iterator, Sequence
from pathlib import Path

import click

from ..diagnostics import check_cloud, check_poses, float32_fact, float32_step, length
from ..errors import InputError, NotMeasuredError
from ..plane import CloudPlane, find_planes, plane_of_all
from ..readers import MESH_SUFFIXES, Scan, read_scan
from ..report.format.digits import rounded
from ..report.format.layout import aligned
from ..units import LENGTH_UNITS
from .shared.capture_options import read_options, reading_options
from .shared.progress import Reading

NOTED_STEP_M = 0.5e-3
COARSE = 1.4  # distance of levels over the rms across a plane, above which they draw it


@click.command()
@click.argument("file", type=click.Path(path_type=Path))
@click.option(
    "--max-planes",
    type=click.IntRange(min=1),
    default=5,
    show_default=True,
    help="Number of planes to find, at most.",
)
@click.option(
    "--length-unit",
    type=click.Choice(LENGTH_UNITS),
    default="m",
    show_default=True,
    help="Length unit of the coordinates.",
)
@reading_options
@click.option("--all-points", is_flag=True, help="Fit one plane to all points, leaving none out.")
@click.option(
    "--sample",
    type=click.IntRange(1, 10**8),
    metavar="N",
    help="Number of points to sample on a mesh (.stl, .obj, .off, .glb, .3mf), instead of its "
    "vertices.",
)
@click.option(
    "--seed",
    type=click.IntRange(min=0),
    default=0,
    show_default=True,
    help="Seed of the random search.",
)
@click.option("--json", "as_json", is_flag=True, help="Print the planes as JSON and nothing else.")
def plane(
    file: Path,
    max_planes: int,
    length_unit: str,
    columns: str | None,
    pitch: str | None,
    all_points: bool,
    sample: int | None,
    seed: int,
    as_json: bool,
) -> int:
    """Find the planes of the point cloud FILE, largest first.

    The distance within which points belong to a plane is estimated from the points themselves.
    """
    reading = read_options(columns, pitch)
    with Reading(str(file)) as progress:
        scan = read_scan(file, length_unit, options=reading, sample=sample, progress=progress)
    check_poses(scan.parts, str(file))
    check_cloud(scan.points_m, length_unit, str(file))
    try:
        if all_points:
            planes: tuple[CloudPlane, ...] = (plane_of_all(scan.points_m),)
        else:
            planes = find_planes(scan.points_m, max_planes, seed)
    except NotMeasuredError as error:
        raise InputError(f"{file}: {error}: {_advice(file, scan, length_unit, sample)}") from error
    except InputError as error:
        raise InputError(f"{file}: {error}: use a scan with more points") from error
    notes = [*_notes(scan, length_unit), *_coarse(planes)]
    if as_json:
        tree = {
            "planes": [_tree(found) for found in planes],
            "points_total": len(scan.points_m),
            "missing_returns": scan.invalid_points,
            "notes": notes,
        }
        click.echo(json.dumps(tree, indent=1))
        return 0
    dropped = f" ({scan.invalid_points} invalid points dropped)" if scan.invalid_points else ""
    click.echo(f"{file}: {len(scan.points_m)} points{dropped}")
    for note in notes:
        click.echo(f"note: {note}")
    click.echo("a x + b y + c z + d = 0, unit normal")
    rows: list[tuple[str, ...]] = [("a", "b", "c", "d / m", "rms / mm", "points", "extents / m")]
    for found in planes:
        extents = f"{found.extents_m[0]:.4f} x {found.extents_m[1]:.4f}"
        normal = (rounded(x, -8) for x in found.normal)
        offset, rms = rounded(found.offset_m, -6), f"{found.rms_m * 1e3:.4f}"
        rows.append((*normal, offset, rms, str(found.points), extents))
    click.echo(aligned(rows, left=0))
    return 0


def _advice(file: Path, scan: Scan, length_unit: str, sample: int | None) -> str:
    """Return what to do where no plane was found."""
    notes = _notes(scan, length_unit)
    if notes:
        return f"{notes[0]}; export it as double, or with an offset"
    if sample is None and file.suffix.lower() in MESH_SUFFIXES:
        return f"it is a mesh of {len(scan.points_m)} vertices: add --sample 100000"
    return "check the file, or its --length-unit"


def _notes(scan: Scan, length_unit: str) -> list[str]:
    step, position = float32_step(scan.points_m, length_unit)
    return [float32_fact(step, position)] if step >= NOTED_STEP_M else []


def _coarse(planes: Sequence[CloudPlane]) -> Iterator[str]:
    """Yield a note for each plane whose points lie on so few levels that its tilt is uncertain.

    Rounding moves a point by half a level at most, and the slope of a face of side a by 1.5 levels
    over a.
    """
    for number, found in enumerate(planes, start=1):
        if found.level_m > COARSE * found.rms_m:
            off_deg = math.degrees(1.5 * found.level_m / max(found.extents_m[1], found.level_m))
            yield (
                f"the coordinates across plane {number} lie {length(found.level_m)} apart, "
                f"coarse against its rms: its normal is uncertain by up to {off_deg:.2g}°"
            )


def _tree(found: CloudPlane) -> dict[str, object]:
    return {
        "normal": found.normal.tolist(),
        "offset_m": found.offset_m,
        "centroid_m": found.centroid_m.tolist(),
        "rms_m": found.rms_m,
        "points": found.points,
        "extents_m": list(found.extents_m),
        "step_m": found.level_m,
    }
