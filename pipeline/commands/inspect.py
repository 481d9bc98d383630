"""`wheelplane inspect`: contents of a scan file or a capture."""

from __future__ import annotations

import json
from pathlib import Path

import click
import numpy as np

from ..capture import ScanEntry, open_entries
from ..diagnostics import ScanSummary, findings, length, spacing_m, summarise_scan
from ..errors import WheelplaneError
from ..files import ARCHIVE_SUFFIXES
from ..readers import ReadOptions
from ..report.format.digits import rounded
from ..report.format.layout import aligned
from .shared.capture_options import length_unit_option, read_options, reading_options
from .shared.limits import limited
from .shared.progress import Reading

SHOWN_SCANS = 8


@click.command()
@click.argument("file", type=click.Path(path_type=Path))
@length_unit_option
@reading_options
@click.option("--json", "as_json", is_flag=True, help="Print JSON and nothing else.")
@limited
def inspect(
    file: Path, length_unit: str | None, columns: str | None, pitch: str | None, as_json: bool
) -> int:
    """Summarise FILE: a scan, or a capture as a folder, zip or tar.

    Reads every point once and keeps only a sample in memory.
    """
    given = read_options(columns, pitch)
    if not file.is_dir() and not (file.is_file() and _is_capture(file)):
        return _show(str(file), _summary(file, length_unit or "m", str(file), given), as_json)
    with open_entries(file, given) as entries:
        unit = length_unit or entries.length_unit
        summaries = [
            (entry, _summary(entry.path, unit, f"{file}: {entry.file}", entries.reading))
            for entry in entries.scans
        ]
    first, summary = summaries[0]
    if first.role == "vehicle" and len(summaries) == 1:
        return _show(f"{file}: {first.file}", summary, as_json)
    if not as_json:
        click.echo(_capture_text(file, unit, summaries))
        return 0
    tree = {
        "capture": str(file),
        "length_unit": unit,
        "entries": [
            {"name": entry.name, "role": entry.role, "wheel": entry.wheel, **_tree(entry.file, s)}
            for entry, s in summaries
        ],
    }
    click.echo(json.dumps(tree, indent=1))
    return 0


def _show(name: str, summary: ScanSummary, as_json: bool) -> int:
    """Print the summary of one file."""
    click.echo(json.dumps(_tree(name, summary), indent=1) if as_json else _text(name, summary))
    return 0


def _is_capture(file: Path) -> bool:
    """Return whether an archive holds a capture rather than one scan."""
    if not file.name.lower().endswith(ARCHIVE_SUFFIXES):
        return False
    try:
        with open_entries(file):
            return True
    except WheelplaneError:
        return False


def _summary(path: Path, unit: str, name: str, options: ReadOptions) -> ScanSummary:
    with Reading(name) as progress:
        return summarise_scan(path, unit, name, progress, options)


def _tree(name: str, summary: ScanSummary) -> dict[str, object]:
    there = summary.points > 0
    return {
        "file": name,
        "format": summary.format,
        "file_bytes": summary.file_bytes,
        "length_unit": summary.length_unit,
        "points": summary.points,
        "missing_returns": summary.invalid_points,
        "low_m": summary.low_m.tolist() if there else None,
        "high_m": summary.high_m.tolist() if there else None,
        "spacing_m": spacing_m(summary),
        "intensity": list(summary.intensity) if summary.intensity else None,
        "raster": list(summary.raster) if summary.raster else None,
        "scans": [
            {
                "name": scan.name,
                "points": scan.points,
                "missing_returns": scan.invalid_points,
                "T_file_scan": None if scan.T_file_scan is None else scan.T_file_scan.tolist(),
            }
            for scan in summary.scans
        ],
        "odd": findings(summary),
    }


def _text(name: str, summary: ScanSummary) -> str:
    rows = [("points", f"{summary.points} ({summary.invalid_points} invalid points besides)")]
    if summary.points:
        corners = zip("xyz", summary.low_m, summary.high_m, strict=True)
        rows += [
            (axis, f"{_place(a)} to {_place(b)} m ({length(b - a)})") for axis, a, b in corners
        ]
    spacing = spacing_m(summary)
    if spacing is not None:
        rows.append(("spacing", f"about {length(spacing)}"))
    none = "none"
    low_high = summary.intensity
    rows.append(("intensity", f"{low_high[0]:g} to {low_high[1]:g}" if low_high else none))
    raster = summary.raster
    rows.append(("raster", f"{raster[0]} rows x {raster[1]} columns" if raster else none))
    rows.append(("scans", _scans(summary)))
    parts = [f"{name}: {_kind(summary)}", aligned(rows, left=2)]
    parts += [f"  warning: {text}" for text in findings(summary)]
    return "\n".join(parts)


def _place(coordinate_m: float) -> str:
    return rounded(coordinate_m, -4, "")


def _kind(summary: ScanSummary) -> str:
    return (
        f"{summary.format.upper()}, {summary.file_bytes} bytes, "
        f"coordinates taken as {summary.length_unit}"
    )


def _scans(summary: ScanSummary) -> str:
    """Return one line a scan: its name, its points, the position of its scanner."""
    if not summary.scans:
        return "one, without a pose"
    lines = [f"{len(summary.scans)}"]
    for scan in summary.scans[:SHOWN_SCANS]:
        T = scan.T_file_scan
        pose = "no pose"
        if T is not None:
            rotated = "rotated" if not np.array_equal(T[:3, :3], np.eye(3)) else "not rotated"
            pose = f"scanner at {' '.join(map(_place, T[:3, 3]))} m, {rotated}"
        lines.append(f"    {scan.name}: {scan.points} points, {pose}")
    if len(summary.scans) > SHOWN_SCANS:
        lines.append(f"    and {len(summary.scans) - SHOWN_SCANS} more (--json lists all)")
    return "\n".join(lines)


def _capture_text(file: Path, unit: str, summaries: list[tuple[ScanEntry, ScanSummary]]) -> str:
    table: list[tuple[str, ...]] = [
        ("name", "role", "file", "format", "points", "invalid", "size / m", "spacing / mm")
    ]
    odd = []
    for entry, summary in summaries:
        sides = (summary.high_m - summary.low_m).tolist() if summary.points else []
        spacing = spacing_m(summary)
        table.append(
            (
                entry.name,
                entry.role,
                entry.file,
                summary.format.upper(),
                str(summary.points),
                str(summary.invalid_points),
                " x ".join(f"{side:.3f}" for side in sides) or "-",
                f"{spacing * 1e3:.2f}" if spacing is not None else "-",
            )
        )
        odd += [f"  warning: {entry.name}: {text}" for text in findings(summary)]
    head = f"{file}: a capture of {len(summaries)} scans, coordinates taken as {unit}"
    return "\n".join([head, aligned(table, left=4), *odd])
