"""E57 reader: scans with their poses.

Format: ASTM E2807-11. The file is checked, then libE57Format (pye57) decodes it in a child.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from ..colour import luminance
from ..faults import fault
from ..sandbox.client import find_library, run_child
from ..sandbox.process import Job
from ..source import Block, PointColumn, RawCloud, Source
from .pages import Pages, read_xml
from .scans import CARTESIAN, SPHERICAL, E57Scan, find_scans
from .section import check_sections
from .xml import parse_xml

SLOT_ROWS = 1 << 14
VALUE_BYTES = 8
WORKING_BYTES = 64 << 20  # of libE57Format, for a file with a short XML
BYTES_PER_XML_BYTE = 20
INVALID = {CARTESIAN: "cartesianInvalidState", SPHERICAL: "sphericalInvalidState"}
INTENSITY = "intensity"
COLOUR = ("colorRed", "colorGreen", "colorBlue")
UNKNOWN = {(INTENSITY,): "isIntensityInvalid", COLOUR: "isColorInvalid"}
GRID = ("rowIndex", "columnIndex")
LARGEST_INDEX = 2**31


def read_e57(source: Source) -> RawCloud:
    """Read all scans, in the file's order; points whose state is invalid are dropped.

    Where only some scans have intensity, or rows and columns, the others get NaN, or -1. Colours
    count where no scan has intensity.
    """
    library = find_library("pye57", "E57", "e57", source)
    pages = Pages(source)
    xml = read_xml(pages)
    scans = find_scans(parse_xml(xml, source), source)
    filled = [scan for scan in scans if scan.rows]
    check_sections(pages, filled)
    shade = (INTENSITY,) if any(scan.has(INTENSITY) for scan in filled) else COLOUR
    return RawCloud(
        rows=sum(scan.rows for scan in filled),
        has_intensity=any(scan.has(*shade) for scan in filled),
        blocks=_blocks(scans, shade, library, len(xml), source),
        has_grid=any(scan.has(*GRID) for scan in filled),
        parts=tuple(scan.part for scan in scans),
    )


def _system(scan: E57Scan) -> tuple[str, str, str]:
    return CARTESIAN if scan.has(*CARTESIAN) else SPHERICAL


def _columns(scan: E57Scan, shade: tuple[str, ...]) -> dict[str, str]:
    """Return the fields to decode, and the struct format of each."""
    if not scan.rows:
        return {}
    system = _system(scan)
    columns = dict.fromkeys(system, "d")
    columns |= dict.fromkeys(shade if scan.has(*shade) else (), "d")
    optional = (INVALID[system], UNKNOWN[shade], *GRID)
    return columns | {name: "q" for name in optional if scan.has(name)}


def _blocks(
    scans: tuple[E57Scan, ...], shade: tuple[str, ...], library: str, xml_bytes: int, source: Source
) -> Iterator[Block]:
    columns = [_columns(scan, shade) for scan in scans]
    job = Job(
        task="e57",
        library=library,
        plan={"scans": [list(each.items()) for each in columns]},
        rows=tuple(scan.rows for scan in scans),
        slot_rows=SLOT_ROWS,
        slot_bytes=max(map(len, columns)) * SLOT_ROWS * VALUE_BYTES,
        memory_bytes=WORKING_BYTES + BYTES_PER_XML_BYTE * xml_bytes,
    )
    for filled in run_child(job, source):
        table = {
            name: np.frombuffer(filled.memory, form, filled.rows, i * SLOT_ROWS * VALUE_BYTES)
            for i, (name, form) in enumerate(columns[filled.part].items())
        }
        _check_grid([table[name] for name in GRID if name in table], source)
        yield _block(table, filled.part, _system(scans[filled.part]), shade)


def _check_grid(indices: list[PointColumn], source: Source) -> None:
    for index in indices:
        beyond = index[(index >= LARGEST_INDEX) | (index <= -LARGEST_INDEX)]
        if len(beyond):
            raise fault(source, f"a point lies in row or column {beyond[0]}")


def _block(
    table: dict[str, PointColumn], part: int, system: tuple[str, str, str], shade: tuple[str, ...]
) -> Block:
    first, second, third = (table[name] for name in system)
    invalid = table.get(INVALID[system])
    no_intensity, no_index = (np.broadcast_to(value, len(first)) for value in (np.nan, -1))
    if COLOUR[0] in table:
        intensity = luminance(*(table[name] for name in COLOUR))
    else:
        intensity = table.get(INTENSITY, no_intensity)
    if UNKNOWN[shade] in table:
        intensity = np.where(table[UNKNOWN[shade]] != 0, np.nan, intensity)
    return Block(
        xyz=_to_cartesian(first, second, third) if system == SPHERICAL else (first, second, third),
        intensity=intensity,
        grid=(table.get(GRID[0], no_index), table.get(GRID[1], no_index)),
        invalid=None if invalid is None else invalid != 0,
        part=part,
    )


def _to_cartesian(
    distance: PointColumn, azimuth: PointColumn, elevation: PointColumn
) -> tuple[PointColumn, PointColumn, PointColumn]:
    """Convert to x, y, z: azimuth from x towards y, elevation from the xy plane, rad (8.4.4)."""
    horizontal = distance * np.cos(elevation)
    return horizontal * np.cos(azimuth), horizontal * np.sin(azimuth), distance * np.sin(elevation)
