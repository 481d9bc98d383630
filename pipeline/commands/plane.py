"""`wheelplane plane`: the planes of a single point cloud."""

from __future__ import annotations

import json
from pathlib import Path

import click

from pipeline.errors import InputError, NotMeasuredError
from pipeline.planes import CloudPlane, find_planes, plane_of_all
from pipeline.readers import read_scan
from pipeline.report.layout import aligned, number


@click.command()
@click.argument("file", type=click.Path(path_type=Path))
@click.option("--max-planes", type=click.IntRange(min=1), default=5, show_default=True)
@click.option("--length-unit", type=click.Choice(["m", "mm", "in"]), default="m", show_default=True)
@click.option("--all-points", is_flag=True, help="One plane through all points, none left out.")
@click.option("--seed", type=click.IntRange(min=0), default=0, show_default=True)
@click.option("--json", "as_json", is_flag=True, help="Print the planes as JSON and nothing else.")
def plane(
    file: Path, max_planes: int, length_unit: str, all_points: bool, seed: int, as_json: bool
) -> int:
    """Find the planes of the point cloud FILE, largest first.

    How far from a plane a point may lie is found from the points themselves.
    """
    scan = read_scan(file, length_unit)
    try:
        if all_points:
            planes: tuple[CloudPlane, ...] = (plane_of_all(scan.points_m),)
        else:
            planes = find_planes(scan.points_m, max_planes, seed)
    except NotMeasuredError as error:
        raise InputError(f"{file}: {error}: check the file, or its --length-unit") from error
    except InputError as error:
        raise InputError(f"{file}: {error}: scan more") from error
    if as_json:
        tree = {
            "planes": [_tree(found) for found in planes],
            "points_total": len(scan.points_m),
            "missing_returns": scan.missing_returns,
        }
        click.echo(json.dumps(tree, indent=1))
        return 0
    dropped = f" ({scan.missing_returns} missing returns dropped)" if scan.missing_returns else ""
    click.echo(f"{file}: {len(scan.points_m)} points{dropped}")
    click.echo("a x + b y + c z + d = 0, unit normal")
    rows: list[tuple[str, ...]] = [("a", "b", "c", "d / m", "rms / mm", "points", "extents / m")]
    for found in planes:
        extents = f"{found.extents_m[0]:.4f} x {found.extents_m[1]:.4f}"
        normal = (number(x, 8) for x in found.normal)
        offset, rms = number(found.offset_m, 6), f"{found.rms_m * 1e3:.4f}"
        rows.append((*normal, offset, rms, str(found.points), extents))
    click.echo(aligned(rows, left=0))
    return 0


def _tree(found: CloudPlane) -> dict[str, object]:
    return {
        "normal": found.normal.tolist(),
        "offset_m": found.offset_m,
        "centroid_m": found.centroid_m.tolist(),
        "rms_m": found.rms_m,
        "points": found.points,
        "extents_m": list(found.extents_m),
    }
