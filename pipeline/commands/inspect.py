"""`wheelplane inspect`: what is in a scan file or a capture."""

from __future__ import annotations

import json
from pathlib import Path

import click
import numpy as np

from ..capture import ScanEntry, open_entries
from ..diagnostics import ScanSummary, findings, length, spacing_m, summarise_scan
from ..errors import WheelplaneError
from ..files import ARCHIVE_SUFFIXES
from ..report.format.layout import aligned
from ..units import LENGTH_UNITS
from .progress import Reading

SHOWN_SCANS = 8


@click.command()
@click.argument("file", type=click.Path(path_type=Path))
@click.option(
    "--length-unit",
    type=click.Choice(LENGTH_UNITS),
    help="Of the coordinates; else what capture.toml says, or m.",
)
@click.option("--json", "as_json", is_flag=True, help="Print the same as JSON and nothing else.")
def inspect(file: Path, length_unit: str | None, as_json: bool) -> int:
    """Say what is in FILE: a scan, or a capture as a folder, zip or tar.

    Every point passes by once; none but a sample is kept in memory.
    """
    if not file.is_dir() and not (file.is_file() and _is_capture(file)):
        return _show(str(file), _look(file, length_unit or "m", str(file)), as_json)
    with open_entries(file) as (unit, entries):
        unit = length_unit or unit
        looked = [(entry, _look(entry.path, unit, f"{file}: {entry.file}")) for entry in entries]
    first, survey = looked[0]
    if first.role == "vehicle":
        return _show(f"{file}: {first.file}", survey, as_json)
    tree = {
        "capture": str(file),
        "length_unit": unit,
        "entries": [
            {"name": entry.name, "role": entry.role, "wheel": entry.wheel, **_tree(entry.file, s)}
            for entry, s in looked
        ],
    }
    click.echo(json.dumps(tree, indent=1) if as_json else _capture_text(file, unit, looked))
    return 0


def _show(name: str, survey: ScanSummary, as_json: bool) -> int:
    """Print what one file holds."""
    click.echo(json.dumps(_tree(name, survey), indent=1) if as_json else _text(name, survey))
    return 0


def _is_capture(file: Path) -> bool:
    """Whether an archive holds a capture rather than one scan."""
    if not file.name.lower().endswith(ARCHIVE_SUFFIXES):
        return False
    try:
        with open_entries(file):
            return True
    except WheelplaneError:
        return False


def _look(path: Path, unit: str, name: str) -> ScanSummary:
    with Reading(name) as progress:
        return summarise_scan(path, unit, name, progress)


def _tree(name: str, survey: ScanSummary) -> dict[str, object]:
    there = survey.points > 0
    return {
        "file": name,
        "format": survey.format,
        "file_bytes": survey.file_bytes,
        "length_unit": survey.length_unit,
        "points": survey.points,
        "missing_returns": survey.invalid_points,
        "low_m": survey.low_m.tolist() if there else None,
        "high_m": survey.high_m.tolist() if there else None,
        "spacing_m": spacing_m(survey),
        "intensity": list(survey.intensity) if survey.intensity else None,
        "raster": list(survey.raster) if survey.raster else None,
        "scans": [
            {
                "name": scan.name,
                "points": scan.points,
                "missing_returns": scan.invalid_points,
                "T_file_scan": None if scan.T_file_scan is None else scan.T_file_scan.tolist(),
            }
            for scan in survey.scans
        ],
        "odd": findings(survey),
    }


def _text(name: str, survey: ScanSummary) -> str:
    rows = [("points", f"{survey.points} ({survey.invalid_points} missing returns besides)")]
    if survey.points:
        corners = zip("xyz", survey.low_m, survey.high_m, strict=True)
        rows += [(axis, f"{a:.4f} to {b:.4f} m ({length(b - a)})") for axis, a, b in corners]
    spacing = spacing_m(survey)
    if spacing is not None:
        rows.append(("spacing", f"about {length(spacing)}"))
    none = "none"
    low_high = survey.intensity
    rows.append(("intensity", f"{low_high[0]:g} to {low_high[1]:g}" if low_high else none))
    raster = survey.raster
    rows.append(("raster", f"{raster[0]} rows x {raster[1]} columns" if raster else none))
    rows.append(("scans", _scans(survey)))
    parts = [f"{name}: {_kind(survey)}", aligned(rows, left=2)]
    parts += [f"  odd: {text}" for text in findings(survey)]
    return "\n".join(parts)


def _kind(survey: ScanSummary) -> str:
    return (
        f"{survey.format.upper()}, {survey.file_bytes} bytes, "
        f"coordinates taken as {survey.length_unit}"
    )


def _scans(survey: ScanSummary) -> str:
    """One line a scan: its name, its points, where its scanner stood."""
    if not survey.scans:
        return "one, its pose not told"
    lines = [f"{len(survey.scans)}"]
    for scan in survey.scans[:SHOWN_SCANS]:
        T = scan.T_file_scan
        place = "pose not told"
        if T is not None:
            turned = "turned" if not np.array_equal(T[:3, :3], np.eye(3)) else "not turned"
            place = f"scanner at {' '.join(f'{x:.4f}' for x in T[:3, 3])} m, {turned}"
        lines.append(f"    {scan.name}: {scan.points} points, {place}")
    if len(survey.scans) > SHOWN_SCANS:
        lines.append(f"    and {len(survey.scans) - SHOWN_SCANS} more (--json lists all)")
    return "\n".join(lines)


def _capture_text(file: Path, unit: str, looked: list[tuple[ScanEntry, ScanSummary]]) -> str:
    table: list[tuple[str, ...]] = [
        ("name", "role", "file", "format", "points", "missing", "size / m", "spacing / mm")
    ]
    odd = []
    for entry, survey in looked:
        sides = (survey.high_m - survey.low_m).tolist() if survey.points else []
        spacing = spacing_m(survey)
        table.append(
            (
                entry.name,
                entry.role,
                entry.file,
                survey.format.upper(),
                str(survey.points),
                str(survey.invalid_points),
                " x ".join(f"{side:.3f}" for side in sides) or "-",
                f"{spacing * 1e3:.2f}" if spacing is not None else "-",
            )
        )
        odd += [f"  odd: {entry.name}: {text}" for text in findings(survey)]
    head = f"{file}: a capture of {len(looked)} scans, coordinates taken as {unit}"
    return "\n".join([head, aligned(table, left=4), *odd])
