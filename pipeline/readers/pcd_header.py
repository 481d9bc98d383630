"""The header of a PCD file, versions .5 to 0.7.

Format: https://pointclouds.org/documentation/tutorials/pcd_file_format.html
"""

from __future__ import annotations

from dataclasses import dataclass

from pipeline.readers.faults import fault
from pipeline.readers.raw import Layout, Source, find_layout, shown

_KEYS = (
    *("VERSION", "FIELDS", "COLUMNS", "SIZE", "TYPE", "COUNT"),
    *("WIDTH", "HEIGHT", "VIEWPOINT", "POINTS", "DATA"),
)
_TYPES = {"F": (4, 8), "I": (1, 2, 4, 8), "U": (1, 2, 4, 8)}
_ENCODINGS = ("ascii", "binary", "binary_compressed")
_LONGEST_LINE = 1 << 16


@dataclass(frozen=True)
class PcdField:
    """One field: `count` values of a numpy scalar type."""

    name: str
    form: str
    size: int
    count: int


@dataclass(frozen=True)
class PcdHeader:
    """points: declared; lines: of the header; layout: indices into `fields`."""

    fields: tuple[PcdField, ...]
    points: int
    encoding: str
    lines: int
    layout: Layout


def read_header(source: Source) -> PcdHeader:
    """Read up to and including the DATA line."""
    entries, lines = _read_entries(source)
    fields = _fields(entries, source)
    try:
        layout = find_layout([field.name for field in fields])
    except ValueError as error:
        raise fault(source, str(error)) from None
    used = [*layout.xyz] + ([] if layout.intensity is None else [layout.intensity])
    for field in (fields[index] for index in used):
        if field.count != 1:
            raise fault(source, f"the field {field.name} has {field.count} values a point")
    encoding = " ".join(entries["DATA"])
    if encoding not in _ENCODINGS:
        raise fault(source, f"the encoding {shown(encoding)} is none of {', '.join(_ENCODINGS)}")
    return PcdHeader(fields, _points(entries, source), encoding, lines, layout)


def _read_entries(source: Source) -> tuple[dict[str, list[str]], int]:
    entries: dict[str, list[str]] = {}
    lines = 0
    while "DATA" not in entries:
        raw = source.stream.readline(_LONGEST_LINE)
        lines += 1
        if not raw.endswith(b"\n"):
            raise fault(source, "the PCD header has no whole DATA line", "copy the file again")
        key, *values = raw.decode("latin-1").partition("#")[0].split() or [""]
        if not key:
            continue
        if key not in _KEYS:
            raise fault(source, f"line {lines} is not of a PCD header: {shown(raw)}")
        if key in entries:
            raise fault(source, f"line {lines} repeats the header entry {key}")
        entries[key] = values
    return entries, lines


def _fields(entries: dict[str, list[str]], source: Source) -> tuple[PcdField, ...]:
    names = entries.get("FIELDS", entries.get("COLUMNS", []))
    sizes = entries.get("SIZE", ["4"] * len(names))
    types = entries.get("TYPE", ["F"] * len(names))
    counts = entries.get("COUNT", ["1"] * len(names))
    for key, values in (("SIZE", sizes), ("TYPE", types), ("COUNT", counts)):
        if len(values) != len(names):
            fact = f"the PCD header has {len(names)} FIELDS, but {len(values)} values of {key}"
            raise fault(source, fact)
    real = [name for name in names if name != "_"]
    if len(set(real)) != len(real):
        raise fault(source, f"a field is there twice: {shown(' '.join(names))}")
    return tuple(
        _field(name, size, kind, count, source)
        for name, size, kind, count in zip(names, sizes, types, counts, strict=True)
    )


def _field(name: str, size: str, kind: str, count: str, source: Source) -> PcdField:
    width = _whole(size, f"the SIZE of {name}", source)
    if width not in _TYPES.get(kind, ()):
        raise fault(source, f"the field {name} has the unknown type {shown(kind)} of {size} bytes")
    return PcdField(name, f"<{kind.lower()}{width}", width, _whole(count, "a COUNT", source))


def _points(entries: dict[str, list[str]], source: Source) -> int:
    """POINTS, or WIDTH x HEIGHT, or both when they agree."""
    found = {
        key: _whole(" ".join(entries[key]), key, source)
        for key in ("WIDTH", "HEIGHT", "POINTS")
        if key in entries
    }
    area = found["WIDTH"] * found.get("HEIGHT", 1) if "WIDTH" in found else None
    points = found.get("POINTS", area)
    if points is None:
        raise fault(source, "the PCD header has neither POINTS nor WIDTH")
    if area is not None and area != points:
        fact = f"{found['WIDTH']} x {found.get('HEIGHT', 1)} is not the declared {points} points"
        raise fault(source, fact)
    return points


def _whole(text: str, what: str, source: Source) -> int:
    if not (text.isascii() and text.isdigit() and len(text) <= 18):
        raise fault(source, f"{what} in the PCD header is {shown(text)}, not a whole number")
    return int(text)
