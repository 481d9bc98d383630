"""Reader of the paper's input: a text file of five points per plane, checked strictly."""

from __future__ import annotations

import math
import os
import re
from collections.abc import Callable, Sequence
from pathlib import Path

import numpy as np

from ..diagnostics import WHEELS_APART_M, length, vehicle_unit
from ..errors import Doubt, InputError, Wording, remedy_of
from ..files import sha256
from ..system import frozen, stage
from ..units import LENGTH_UNITS, AngleUnit, Azimuth, Coordinates, LengthUnit, to_metres
from ..vectors import Array
from ..vehicle import MAX_COORDINATE_M, REFERENCE_WHEELS, build_reference_frame
from .fit_block import fit_block

FULL_TURN = {"deg": 360.0, "gon": 400.0, "rad": 2 * math.pi}
COLUMNS = {"cartesian": "x y z", "spherical": "range azimuth zenith"}
ORDER = ", ".join(REFERENCE_WHEELS)
MAX_FILE_BYTES = 16 * 2**20
UPSIDE_DOWN = (
    "The frame's up points against z of the file (up . z = {z}): if z is up there, the blocks are "
    "not in the order {names}, and toe and camber are wrong."
)
CLOCKWISE = (
    "Azimuth is taken clockwise from y: with blocks in the order {names}, this sense leaves the "
    "vehicle upright."
)
COUNTERCLOCKWISE = (
    "Azimuth is taken counterclockwise from x: with blocks in the order {names}, this sense leaves "
    "the vehicle upright."
)
# cos 60 degrees: no ramp tilts a vehicle so far.
MIN_UPRIGHT_COSINE = 0.5

_NUMBER = re.compile(r"[+-]?(\d+(\.\d*)?|\.\d+)([eEdD][+-]?\d+)?", re.ASCII)  # D: Fortran
_DECIMAL_COMMA = re.compile(r"[+-]?\d+(,\d+)?([eEdD][+-]?\d+)?", re.ASCII)
_SEPARATOR = re.compile(r"[ \t]*,[ \t]*|[ \t]+")


@frozen
class FivePointFile:
    """The blocks of one file: RR, RL, FR, FL, then the trials.

    blocks_m: (M, 5, 3) in file coordinates, metres. source: the file, as the user named it.
    notes: assumptions and warnings of the reader, one sentence each. order: number of each block
    in the file, from 0; empty where all are in their order.
    """

    blocks_m: Array
    source: str
    sha256: str
    notes: tuple[str, ...]
    order: tuple[int, ...] = ()

    def first_line(self, index: int) -> int:
        """Return the line of the first point of block `index`."""
        return 5 * (self.order[index] if self.order else index) + 1


@stage("read")
def read_five_point(
    path: str | Path,
    *,
    name: str | None = None,
    length_unit: LengthUnit = "m",
    coordinates: Coordinates = "cartesian",
    angle_unit: AngleUnit | None = None,
    azimuth: Azimuth = "auto",
    arrange: Callable[[int], Sequence[int]] | None = None,
) -> FivePointFile:
    """Read rows x y z, or range azimuth zenith of a total station, five rows per plane.

    name: the file in messages. azimuth: its sense in spherical rows, clockwise from y or
    counterclockwise from x; "auto" takes the one that leaves the vehicle upright.
    arrange: maps the number of blocks to the indices of the wanted ones (from 0), RR, RL, FR, FL
    first; None for all in their order.
    Raises InputError, one line that names file and line, unless all rows are three finite numbers,
    in four or more blocks of five, each a plane, the first four a frame.
    Source: the paper, section 1, point 1, and section 2.
    """
    if not isinstance(path, (str, os.PathLike)):
        kind = type(path).__name__
        raise InputError(f"a {kind} is no five-point file: give its path")
    source = name or str(path)
    _check_options(source, length_unit, coordinates, angle_unit, azimuth)
    rows = _parse(_read_text(Path(path), source), COLUMNS[coordinates], source)
    _check_count(len(rows), source)
    if angle_unit is None:
        to_metres(rows, length_unit)
        points_m = rows
    else:
        to_metres(rows[:, 0], length_unit)
        points_m = _clockwise(rows, angle_unit, source)
    _check_size(points_m, source)
    digest = sha256(Path(path))
    count = len(points_m) // 5
    order = tuple(range(count) if arrange is None else arrange(count))
    blocks_m = points_m.reshape(-1, 5, 3)[list(order)]
    _check_vehicle(blocks_m[:4], length_unit, source)
    up_z = _up_z(blocks_m, order, source)
    if angle_unit is None:
        return FivePointFile(blocks_m, source, digest, _note_if_upside_down(up_z), order)
    sense = _upright_sense(up_z, azimuth, order, source)
    if sense == "counterclockwise":
        blocks_m = np.ascontiguousarray(blocks_m[..., [1, 0, 2]])
    return FivePointFile(blocks_m, source, digest, _note_of_sense(sense, azimuth), order)


def _check_options(
    source: str, length_unit: str, coordinates: str, angle_unit: str | None, azimuth: str
) -> None:
    for option, value, known in (
        ("--length-unit", length_unit, LENGTH_UNITS),
        ("--coordinates", coordinates, tuple(COLUMNS)),
        ("--angle-unit", angle_unit or "deg", tuple(FULL_TURN)),
        ("--azimuth", azimuth, ("auto", "clockwise", "counterclockwise")),
    ):
        if value not in known:
            raise InputError(f"{source}: {option} is {value!r}: give one of {', '.join(known)}")
    if coordinates == "spherical" and angle_unit is None:
        raise InputError(
            f"{source}: the unit of the angles is not known: give --angle-unit deg, gon or rad"
        )
    if coordinates == "cartesian" and (angle_unit is not None or azimuth != "auto"):
        raise InputError(
            f"{source}: cartesian rows have no angles: leave out --angle-unit and --azimuth, "
            "or give --coordinates spherical"
        )


def _read_text(path: Path, source: str) -> str:
    if path.is_dir():
        raise InputError(f"{source}: is a folder: name the text file of points")
    try:
        with path.open("rb") as stream:
            data = stream.read(MAX_FILE_BYTES + 1)
    except FileNotFoundError:
        raise InputError(f"{source}: no such file: check the path") from None
    except (OSError, ValueError) as error:
        reason = getattr(error, "strerror", None) or str(error)
        raise InputError(f"{source}: cannot be read ({reason}): {remedy_of(error)}") from None
    if len(data) > MAX_FILE_BYTES:
        raise InputError(
            f"{source}: is larger than {MAX_FILE_BYTES} bytes, so no file of five points per "
            "plane: measure a cloud with `wheelplane measure`"
        )
    action = "save the points as plain text (UTF-8), x y z per row"
    if b"\0" in data:
        line = data.count(b"\n", 0, data.index(b"\0")) + 1
        raise InputError(f"{source}: line {line}: a zero byte, so not plain text: {action}")
    try:
        text = data.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        line = data.count(b"\n", 0, error.start) + 1
        byte = data[error.start]
        raise InputError(
            f"{source}: line {line}: byte 0x{byte:02x} is not UTF-8 text: {action}"
        ) from None
    return text.replace("\r\n", "\n").replace("\r", "\n").rstrip(" \t\n")


def _parse(text: str, columns: str, source: str) -> Array:
    if not text:
        raise InputError(
            f"{source}: is empty: give five rows {columns} per plane, four planes or more"
        )
    rows = []
    for line, row in enumerate(text.split("\n"), start=1):
        try:
            rows.append(_parse_row(row.strip(" \t"), columns))
        except InputError as error:
            raise InputError(f"{source}: line {line}: {error}") from None
    return np.array(rows)


def _parse_row(row: str, columns: str) -> list[float]:
    if not row:
        raise InputError("a blank line between rows: remove it")
    fields = _fields(row.replace("\N{MINUS SIGN}", "-"))
    for field in fields:
        if not field:
            mark = "semicolon" if ";" in row else "comma"
            raise InputError(f"nothing before or after a {mark}: write one {mark} between numbers")
        if field.lower().lstrip("+-") in ("nan", "inf", "infinity"):
            raise InputError(f"{field} where a finite number is needed: measure the point again")
        if not _NUMBER.fullmatch(field):
            shown = repr(field if len(field) <= 20 else field[:17] + "...")
            raise InputError(
                f"{shown} is not a number: write {columns} only, separated by commas or spaces, "
                "without header, comment or unit"
            )
    if len(fields) != 3:
        action = "complete the row" if len(fields) < 3 else f"keep {columns}, with decimal points"
        plural = "" if len(fields) == 1 else "s"
        fact = f"{len(fields)} number{plural} where 3 are needed ({columns})"
        raise InputError(f"{fact}: {action}")
    values = [float(field.replace("D", "E").replace("d", "e")) for field in fields]
    if not all(map(math.isfinite, values)):
        raise InputError("a number beyond 1.8e308: measure the point again")
    return values


def _fields(row: str) -> list[str]:
    """Split a row into its fields, with decimal points.

    Commas are decimal between semicolons, and between blanks where three fields have any that are
    more than three otherwise.
    """
    if ";" in row:
        return [field.strip(" \t").replace(",", ".") for field in row.split(";")]
    fields, words = _SEPARATOR.split(row), row.split()
    if len(fields) > len(words) == 3 and all(map(_DECIMAL_COMMA.fullmatch, words)):
        return [word.replace(",", ".") for word in words]
    return fields


def _check_count(rows: int, source: str) -> None:
    blocks, rest = divmod(rows, 5)
    if rest:
        raise InputError(
            f"{source}: line {rows - rest + 1}: the last block has {rest} of its 5 rows "
            f"({rows} rows in all): complete or remove it"
        )
    if blocks < 4:
        raise InputError(
            f"{source}: line {rows}: ends after {blocks} of the 4 blocks that make the frame: "
            f"give five rows for each of {ORDER}"
        )


def _check_size(points_m: Array, source: str) -> None:
    beyond = np.flatnonzero(np.abs(points_m).max(axis=1) > MAX_COORDINATE_M)
    if beyond.size:
        largest_m = np.abs(points_m[beyond[0]]).max()
        raise InputError(
            f"{source}: line {beyond[0] + 1}: a coordinate of {largest_m:.3g} m is beyond "
            f"{MAX_COORDINATE_M:g} m: check the row and --length-unit"
        )


def _clockwise(polar: Array, angle_unit: str, source: str) -> Array:
    """Convert rows range (m), azimuth, zenith to x y z, azimuth counted clockwise from y."""
    turn = FULL_TURN[angle_unit]
    for line, (range_m, azimuth, zenith) in enumerate(polar, start=1):
        fault = None
        if not range_m > 0:
            fault = f"range {range_m:g} m is not positive: write {COLUMNS['spherical']}"
        elif abs(azimuth) > turn * 1.00001:  # 6.2832 is written for a whole turn
            fault = (
                f"azimuth {azimuth:g} is over a turn of {turn:g} {angle_unit}: check --angle-unit"
            )
        elif not 0 <= zenith <= turn / 2:
            fault = (
                f"zenith {zenith:g} is outside 0 to {turn / 2:g} {angle_unit}: "
                "reduce to face I, and check --angle-unit"
            )
        if fault:
            raise InputError(f"{source}: line {line}: {fault}")
    range_m, azimuth_rad, zenith_rad = (polar * [1, 2 * math.pi / turn, 2 * math.pi / turn]).T
    level_m = range_m * np.sin(zenith_rad)
    return np.column_stack(
        [
            level_m * np.sin(azimuth_rad),
            level_m * np.cos(azimuth_rad),
            range_m * np.cos(zenith_rad),
        ]
    )


def _check_vehicle(blocks_m: Array, unit: str, source: str) -> None:
    """Raise InputError for reference blocks (4, 5, 3) as far apart as on no vehicle: a wrong unit.

    By medians, so that one wrong point of a block is not taken for a wrong unit.
    """
    middles_m = np.median(blocks_m, axis=1)
    apart_m = np.linalg.norm(middles_m[:, None] - middles_m, axis=-1)
    size_m = float(apart_m.max())
    smallest, largest = WHEELS_APART_M
    if size_m > 0.0 and not smallest <= size_m <= largest:
        other = vehicle_unit([apart_m[0, 1], apart_m[2, 3]], [apart_m[0, 2], apart_m[1, 3]], unit)
        fix = f"convert the file to one of {', '.join(LENGTH_UNITS)}: in none is it a vehicle's"
        if other:
            fix = f"in {other} they are a vehicle's: give --length-unit {other}"
        raise InputError(
            f"{source}: the wheel centres lie up to {length(size_m)} apart in {unit}, a vehicle's "
            f"{smallest:g} to {largest:g} m: {fix}"
        )


def _up_z(blocks_m: Array, order: Sequence[int], source: str) -> float:
    """Return up . z of the vehicle. Raises InputError for blocks without plane or frame."""
    centres = []
    for block, points_m in zip((index + 1 for index in order), blocks_m, strict=True):
        try:
            centres.append(fit_block(points_m).centre_m)
        except InputError as error:
            lines = f"lines {5 * block - 4}-{5 * block}"
            raise InputError(f"{source}: {lines}: block {block}: {error}") from None
    try:
        return float(build_reference_frame(centres[:4]).up[2])
    except InputError as error:
        raise InputError(f"{source}: {_lines_of_the_frame(order)}: {error}") from None


def _lines_of_the_frame(order: Sequence[int]) -> str:
    """Return the lines of the first four blocks of an order, as in messages."""
    blocks = sorted(order[:4])
    if blocks[3] - blocks[0] == 3:
        return f"lines {5 * blocks[0] + 1}-{5 * blocks[3] + 5}"
    return "lines " + ", ".join(f"{5 * block + 1}-{5 * block + 5}" for block in blocks)


def _note_if_upside_down(up_z: float) -> tuple[str, ...]:
    if up_z > -MIN_UPRIGHT_COSINE:
        return ()
    return (Doubt(UPSIDE_DOWN, z=f"{up_z:.3f}", names=ORDER),)


def _upright_sense(up_z: float, azimuth: str, order: Sequence[int], source: str) -> str:
    """Return the sense of azimuth that leaves the vehicle upright; up_z is for clockwise.

    The two senses are mirror images in x = y, and up, a cross product, changes sign with them.
    """
    if abs(up_z) < MIN_UPRIGHT_COSINE:
        raise InputError(
            f"{source}: {_lines_of_the_frame(order)}: the vehicle lies on its side (up . z = "
            f"{up_z:.3f}) with either sense of azimuth: check the order {ORDER} and --angle-unit"
        )
    sense = "clockwise" if up_z > 0 else "counterclockwise"
    if azimuth not in ("auto", sense):
        raise InputError(
            f"{source}: --azimuth {azimuth} turns the vehicle upside down: "
            f"give --azimuth {sense}, or check the order {ORDER}"
        )
    return sense


def _note_of_sense(sense: str, azimuth: str) -> tuple[str, ...]:
    if azimuth != "auto":
        return ()
    return (Wording(CLOCKWISE if sense == "clockwise" else COUNTERCLOCKWISE, names=ORDER),)
