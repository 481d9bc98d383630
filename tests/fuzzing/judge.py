"""What a reader must do with any file: give a reading that holds together, or one clear line."""

from __future__ import annotations

import gzip
import io
import re
import struct
from pathlib import Path

import numpy as np

from tests.fuzzing.e57 import HELD, PAGE
from tests.fuzzing.mutations import Mutant
from tests.fuzzing.samples import capture_files, heights, scans
from wheelplane.batch.catalogue.rows import DAMAGED, read_record
from wheelplane.capture.open_capture import open_capture
from wheelplane.diagnostics.findings import findings
from wheelplane.diagnostics.scan_summary import summarise_scan
from wheelplane.errors import InputError, WheelplaneError
from wheelplane.five_point.file import read_five_point
from wheelplane.readers import ReadOptions, Scan, read_scan

LARGE_BYTES = 1 << 20
LONGEST_LINE, LONGEST_LIST = 600, 2000  # of one fact; of all the mistakes in a capture.toml


class BrokenLawError(Exception):
    """A law that a reading or a refusal does not keep."""


def judge(mutant: Mutant, folder: Path) -> str:
    """Read the mutant as the program would; 'read' or 'refused'.

    Raises BrokenLawError, or whatever else the program lets escape.
    """
    path = folder / mutant.sample.file
    path.write_bytes(mutant.data)
    try:
        DOORS[mutant.sample.door](path, mutant)
    except WheelplaneError as error:
        _check_line(str(error), mutant.sample.file)
        return "refused"
    finally:
        path.unlink()
    return "read"


def _scan(path: Path, mutant: Mutant) -> None:
    given = dict(mutant.sample.given)
    unit, options = given.pop("length_unit", "m"), ReadOptions(**given)
    try:
        scan = read_scan(path, unit, options=options)
    except WheelplaneError:
        _inspect(path, unit, options, 0, 0)
        raise
    _check_scan(scan)
    _inspect(path, unit, options, len(scan.points_m), scan.invalid_points)
    declared = count_declared(mutant)
    seen = len(scan.points_m) + scan.invalid_points
    if declared is not None and declared != seen:
        raise BrokenLawError(f"silent loss: {declared} points declared, {seen} accounted for")


def _inspect(path: Path, unit: str, options: ReadOptions, points: int, missing: int) -> None:
    """`inspect` sees what is read, and refuses what is refused, or sees no points there."""
    try:
        survey = summarise_scan(path, unit, options=options)
        findings(survey)
    except WheelplaneError as error:
        _check_line(str(error), path.name)
        if points:
            raise BrokenLawError(f"inspect refuses what is read: {error}") from error
        return
    if survey.points != points or (points and survey.invalid_points != missing):
        raise BrokenLawError(f"inspect sees {survey.points} points, {points} are read")


def _capture(path: Path, mutant: Mutant) -> None:
    with open_capture(path) as capture:
        for entry in capture.entries:
            _check_scan(read_scan(entry.path, capture.length_unit, f"{path}: {entry.file}"))


def _capture_toml(path: Path, mutant: Mutant) -> None:
    for name, data in capture_files(scans()).items():
        if name != path.name:
            (path.parent / name).write_bytes(data)
    with open_capture(path.parent) as capture:
        for entry in capture.entries:
            read_scan(entry.path, capture.length_unit, f"{path}: {entry.file}")


def _five_point(path: Path, mutant: Mutant) -> None:
    blocks = read_five_point(path).blocks_m
    if not (blocks.shape[1:] == (5, 3) and np.isfinite(blocks).all()):
        raise BrokenLawError(f"five-point blocks of shape {blocks.shape}, or not finite")


def _result(path: Path, mutant: Mutant) -> None:
    """A result that is no result is a row of the catalogue, which says why."""
    record = read_record("k", path.read_bytes())
    counts = [record.capture.points_total, *(wheel.points_on_target for wheel in record.wheels)]
    if not all(count is None or 0 <= count < 2**63 for count in counts):
        raise BrokenLawError(f"a catalogue cannot hold one of {counts}")
    if record.capture.status == DAMAGED:
        raise InputError(f"{path.name}: {record.capture.reason}")


DOORS = {
    "scan": _scan,
    "capture": _capture,
    "capture.toml": _capture_toml,
    "five-point": _five_point,
    "result": _result,
}


def _check_scan(scan: Scan) -> None:
    points = scan.points_m
    if points.ndim != 2 or points.shape[1] != 3 or not len(points) or points.dtype != np.float64:
        raise BrokenLawError(f"points of shape {points.shape} and type {points.dtype}")
    if not np.isfinite(points).all():
        raise BrokenLawError("points that are not finite")
    if scan.intensity is not None and len(scan.intensity) != len(points):
        raise BrokenLawError(f"{len(scan.intensity)} intensities of {len(points)} points")


def _check_line(line: str, file: str) -> None:
    if len(line.splitlines()) != 1 or not line.isprintable():
        raise BrokenLawError(f"not one plain line: {line!r}")
    if file not in line:
        raise BrokenLawError(f"does not name the file: {line!r}")
    if len(line) > (LONGEST_LIST if file == "capture.toml" else LONGEST_LINE):
        raise BrokenLawError(f"{len(line)} characters long: {line!r}")
    if "fit into memory" in line:
        raise BrokenLawError(f"room was made for a small file's lie: {line!r}")


def count_declared(mutant: Mutant) -> int | None:
    """Points that the file's own header declares, by a look of our own; None where none is sure."""
    suffix, data = Path(mutant.sample.file).suffix, mutant.data
    if len(mutant.data) > LARGE_BYTES:  # a look line by line would take longer than the reading
        return None
    if "pitch" in mutant.sample.given or mutant.sample.name in heights():
        return None
    if suffix == ".gz" and mutant.sample.name.startswith("inner:"):
        data, suffix = gzip.decompress(data), Path(mutant.sample.file).suffixes[-2]
    try:
        return LOOKS[suffix](data) if suffix in LOOKS else None
    except (ValueError, struct.error, IndexError):
        return None


def _ply(data: bytes) -> int | None:
    head = data.partition(b"end_header")[0]
    found = re.findall(rb"element[ \t]+vertex[ \t]+(\d+)", head)
    return int(found[0]) if len(found) == 1 else None


def _pcd(data: bytes) -> int | None:
    head = re.split(rb"(?m)^DATA ", data)[0]
    found = re.findall(rb"(?m)^POINTS[ \t]+(\d+)", head)
    return int(found[0]) if len(found) == 1 else None


def _npy(data: bytes) -> int | None:
    stream = io.BytesIO(data)
    form = np.lib.format
    one = form.read_magic(stream)[0] == 1
    head = (form.read_array_header_1_0 if one else form.read_array_header_2_0)(stream)
    shape, dtype = head[0], head[2]
    return int(np.prod(shape if dtype.names else shape[:-1], dtype=np.int64))


def _las(data: bytes) -> int | None:
    legacy = struct.unpack_from("<I", data, 107)[0]
    return int(struct.unpack_from("<Q", data, 247)[0]) if data[25] >= 4 else int(legacy)


def _e57(data: bytes) -> int | None:
    held = b"".join(data[k : k + HELD] for k in range(0, len(data), PAGE))
    xml = held[held.find(b"<?xml") :]
    counts = re.findall(rb'recordCount="(\d+)"', xml.partition(b"<images2D")[0])
    return sum(map(int, counts)) if counts else None


NUMBER_OR_NONE = re.compile(r"[-+]?(\d[\d.]*|\.\d+|nan|inf)(e[-+]?\d+)?|n/?a|1\.", re.IGNORECASE)


def _text(data: bytes) -> int | None:
    """Lines of two numbers or more, but for `key: value`; a number alone above them is a count."""
    if re.search(rb"pitch|cellsize|^Info", data, re.IGNORECASE):
        return None  # heights
    utf_16 = data.startswith((b"\xff\xfe", b"\xfe\xff"))
    text = data.decode("utf-16" if utf_16 else "utf-8-sig", "replace")
    count = rows = 0
    for line in re.split(r"\r\n|\r|\n", text):
        content = re.split(r"(?<!1\.)#|//", line)[0].replace('"', "")
        words = [word for word in re.split(r"[\s,;]+", content) if word]
        numbers = sum(NUMBER_OR_NONE.match(word) is not None for word in words)
        if len(words) == 1 and words[0].isdigit() and not rows:
            count = count or int(words[0])
        elif numbers > 1 and not re.match(r"[^\W\d][^,;\t]*[:=]", content.strip()):
            rows += 1
    return count or rows


def _pts(data: bytes) -> int | None:
    """The sum of the numbers that stand alone in a line."""
    if re.search(rb"[#/,;x]", data):
        return _text(data)
    rows = [line.split() for line in data.decode("latin-1").splitlines()]
    counts = [int(row[0]) for row in rows if len(row) == 1 and row[0].isdigit()]
    return sum(counts) if counts else None


def _ptx(data: bytes) -> int | None:
    """Columns times rows of every block, each followed by 8 lines and its points."""
    lines = [line.split() for line in data.decode("latin-1").splitlines() if line.strip()]
    at = total = 0
    while at + 1 < len(lines):
        if len(lines[at]) != 1 or not (lines[at][0] + lines[at + 1][0]).isdigit():
            return None
        count = int(lines[at][0]) * int(lines[at + 1][0])
        total, at = total + count, at + 10 + count
    return total


LOOKS = {
    ".ply": _ply,
    ".pcd": _pcd,
    ".npy": _npy,
    ".las": _las,
    ".laz": _las,
    ".e57": _e57,
    ".xyz": _text,
    ".asc": _text,
    ".csv": _text,
    ".txt": _text,
    ".pts": _pts,
    ".ptx": _ptx,
}
