"""Tables of field tests: their rows, checked, and averaged by target or pair of points.

Separators are commas, or semicolons or tabs, with which decimal commas are read too.
"""

from __future__ import annotations

import csv
import io
import math
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from ..errors import InputError, fact_of, remedy_of
from ..system import frozen
from ..vectors import Array

FACES = ("target", "face", "azimuth_deg", "elevation_deg", "range_m")
LENGTHS = ("pair", "measured_m", "reference_m", "u_m", "range_1_m", "range_2_m")
DELIMITERS = (",", ";", "\t")
MAX_BYTES = 4 << 20
ROUNDED_M = 0.01  # error of the difference of ranges that are given to the centimetre
MOST_M = 1000.0  # the farthest point of a test
LEVEL_DEG = 85.0  # elevation beyond which azimuths show nothing
MOST_APART_DEG = 0.5  # of two faces; more is another target
MOST_APART_M = 0.05  # of ranges of one target or point; more is another one
REFERENCE_APART_M = 0.001  # of references of one pair; more is another length
LEAST_SPAN_DEG = 5.0  # of elevations: below, trunnion and index look like collimation and offset
TURN_DEG, TURN_GON = 361.0, 400.0  # a degree more, for the errors of a target at a whole turn


@frozen
class FaceTest:
    """Targets in both faces (N): half the differences of azimuth and elevation, in arcsec.

    labels: target and lines of each. azimuth_rad, elevation_rad, range_m: means of both faces.
    """

    labels: tuple[str, ...]
    across: Array
    up: Array
    azimuth_rad: Array
    elevation_rad: Array
    range_m: Array


@frozen
class LengthTest:
    """Pairs of points (N): measured lengths, references with their u, and ranges, in metres.

    labels: pair and lines of each. u_m: with the scatter of the repeats.
    """

    labels: tuple[str, ...]
    measured_m: Array
    reference_m: Array
    u_m: Array
    near_m: Array
    far_m: Array


@frozen
class _Row:
    """Numbers of one line of a table."""

    line: int
    numbers: tuple[float, ...]


def read_test(path: Path) -> FaceTest | LengthTest:
    """Read a table of a field test, by its heading.

    Raises InputError, one line that names file and line.
    """
    heading, rows = _read(path)
    return _faces(rows, path) if heading == FACES else _lengths(rows, path)


def _faces(rows: list[tuple[int, list[str]]], path: Path) -> FaceTest:
    """Return half the differences of both faces, target by target."""
    readings: dict[str, dict[str, list[_Row]]] = {}
    for line, (target, face, *texts) in rows:
        where = f"{path}: line {line}"
        if face not in ("1", "2"):
            raise InputError(f"{where}: face is {face!r}: give 1 or 2")
        numbers = _numbers(texts, FACES[2:], where)
        _, e, r = numbers
        if abs(e) > LEVEL_DEG or r <= 0.0:
            raise InputError(
                f"{where}: an elevation within {LEVEL_DEG:.0f} degrees and a range above 0 are "
                f"needed, got {e:g} and {r:g}"
            )
        _check_metres(r, where)
        readings.setdefault(target, {}).setdefault(face, []).append(_Row(line, numbers))
    _check_degrees(
        [row for faces in readings.values() for of in faces.values() for row in of], path
    )
    labels, half, at = [], [], []
    for target, faces in readings.items():
        apart, middle = _of_target(target, faces, path)
        labels.append(f"target {target!r} ({_lines([*faces['1'], *faces['2']])})")
        half.append(apart / 2.0 * 3600.0)
        at.append(middle)
    _check_targets(labels, np.array(half), np.array(at), path)
    across, up = np.array(half).T
    a, e, r = np.array(at).T
    return FaceTest(tuple(labels), across, up, np.radians(a), np.radians(e), r)


def _of_target(target: str, faces: dict[str, list[_Row]], path: Path) -> tuple[Array, Array]:
    """Return azimuth and elevation of face 1 less face 2, and the mean of both with the range."""
    if len(faces) < 2:
        raise InputError(
            f"{path}: target {target!r} has face {next(iter(faces))} alone: measure it in both"
        )
    one, two = (np.array([row.numbers for row in faces[face]]) for face in ("1", "2"))
    start = one[0, 0]
    for reading in (one, two):  # azimuths near the first, whatever turn they were given in
        reading[:, 0] = start + (reading[:, 0] - start + 180.0) % 360.0 - 180.0
    for face, reading in (("1", one), ("2", two)):
        if _across(np.ptp(reading, axis=0), one[0, 1]) > MOST_APART_DEG:
            raise InputError(
                f"{path}: {_lines(faces[face])}: rows of target {target!r} in face {face} lie up "
                f"to {np.ptp(reading[:, :2], axis=0).max():.3g} degrees apart: give each target a "
                "name of its own"
            )
    apart = one.mean(axis=0) - two.mean(axis=0)
    if _across(apart, one[0, 1]) > MOST_APART_DEG:
        raise InputError(
            f"{path}: both faces of target {target!r} are {abs(apart[0]):.3g} degrees of "
            f"azimuth and {abs(apart[1]):.3g} of elevation apart: give azimuth and elevation "
            "of face 2 as the scanner exports them, in the sense of face 1"
        )
    ranges = np.concatenate([one, two])[:, 2]
    if np.ptp(ranges) > MOST_APART_M:
        raise InputError(
            f"{path}: {_lines([*faces['1'], *faces['2']])}: the ranges of target {target!r} are "
            f"{ranges.min():g} to {ranges.max():g} m, but a target has one in both faces: check "
            "them, and that both are in metres"
        )
    return apart[:2], (one.mean(axis=0) + two.mean(axis=0)) / 2.0


def _across(apart: Array, elevation_deg: float) -> float:
    """Return the larger of the differences of azimuth, across the beam, and of elevation."""
    return max(abs(float(apart[0])) * math.cos(math.radians(elevation_deg)), abs(float(apart[1])))


def _check_degrees(rows: Sequence[_Row], path: Path) -> None:
    """Raise InputError for angles that are evidently in radians or in gon."""
    a, e, _ = np.array([row.numbers for row in rows]).T
    if np.abs(a).max() <= 2.0 * math.pi and np.abs(e).max() <= math.pi / 2.0:
        raise InputError(
            f"{path}: {_lines(rows)}: all azimuths lie within 6.3 and all elevations within 1.6, "
            "as radians do: give degrees"
        )
    farthest = int(np.argmax(a))
    if a.min() >= 0.0 and TURN_DEG < a[farthest] <= TURN_GON:
        raise InputError(
            f"{path}: line {rows[farthest].line}: an azimuth of {a[farthest]:g} is over a turn of "
            "360 degrees, but not over one of 400 gon: give degrees, of 0 to 360 (0.9 of gon)"
        )


def _check_targets(labels: Sequence[str], half: Array, at: Array, path: Path) -> None:
    """Raise InputError for faces that are copies, and for targets of one elevation."""
    copies = np.flatnonzero(~half.any(axis=1))
    if 2 * len(copies) > len(labels):
        raise InputError(
            f"{path}: face 2 has the very angles of face 1 on {len(copies)} of {len(labels)} "
            f"targets, such as {labels[copies[0]]}: give what was measured in face 2"
        )
    lowest, highest = at[:, 1].min(), at[:, 1].max()
    if highest - lowest < LEAST_SPAN_DEG:
        raise InputError(
            f"{path}: all targets lie at elevations of {lowest:.4g} to {highest:.4g} degrees, "
            f"which shows no errors by elevation: measure some {LEAST_SPAN_DEG:g} degrees or more "
            "higher or lower"
        )


def _lengths(rows: list[tuple[int, list[str]]], path: Path) -> LengthTest:
    """Return the lengths of pairs of points, averaged over the rows of one pair.

    The uncertainty of its reference is common to them.
    """
    pairs: dict[str, list[_Row]] = {}
    for line, (pair, *texts) in rows:
        where = f"{path}: line {line}"
        numbers = _numbers(texts, LENGTHS[1:], where)
        if min(numbers) <= 0.0:
            raise InputError(f"{where}: lengths, ranges and u_m must be above 0")
        _, length, _, one, two = numbers
        _check_metres(max(length, one, two), where)
        room = ROUNDED_M + 1e-3 * length
        if not abs(one - two) - room <= length <= one + two + room:
            raise InputError(
                f"{where}: a length of {length:g} m cannot lie between points at ranges of "
                f"{one:g} and {two:g} m: check them"
            )
        pairs.setdefault(pair, []).append(_Row(line, numbers))
    for pair, repeated in pairs.items():
        _check_repeats(pair, repeated, path)
    repeats = [np.array([row.numbers for row in repeated]) for repeated in pairs.values()]
    more = sum(len(one) - 1 for one in repeats)
    within = sum(float(np.sum((one[:, 0] - one[:, 0].mean()) ** 2)) for one in repeats)
    scatter = within / more if more else 0.0
    means = np.array([one.mean(axis=0) for one in repeats])
    measured, length, u, near, far = means.T
    u = np.sqrt(u**2 + scatter / np.array([len(one) for one in repeats]))
    labels = tuple(f"pair {pair!r} ({_lines(of)})" for pair, of in pairs.items())
    return LengthTest(labels, measured, length, u, near, far)


def _check_repeats(pair: str, rows: Sequence[_Row], path: Path) -> None:
    """Raise InputError for rows of one pair that are not repeats of one length."""
    _, length, _, *ranges = np.ptp([row.numbers for row in rows], axis=0)
    if length > REFERENCE_APART_M or max(ranges) > MOST_APART_M:
        name, apart = (
            ("references", length) if length > REFERENCE_APART_M else ("ranges", max(ranges))
        )
        raise InputError(
            f"{path}: {_lines(rows)}: the {name} of pair {pair!r} differ by {apart:.3g} m, but "
            "rows of one pair are repeats from one place: give each length a name of its own"
        )


def _check_metres(length_m: float, where: str) -> None:
    """Raise InputError for a length or range as long as in no test."""
    if length_m > MOST_M:
        raise InputError(
            f"{where}: {length_m:g} m is farther than a test's points lie: lengths and ranges are "
            "in metres"
        )


def _lines(rows: Sequence[_Row]) -> str:
    """Return the lines of rows: the first and the last where there are more than two."""
    numbers = sorted(row.line for row in rows)
    if len(numbers) == 1:
        return f"line {numbers[0]}"
    return f"lines {numbers[0]} {'and' if len(numbers) == 2 else 'to'} {numbers[-1]}"


def _read(path: Path) -> tuple[tuple[str, ...], list[tuple[int, list[str]]]]:
    """Return the heading of a file, one of two, and its rows with their lines."""
    try:
        with path.open(encoding="utf-8-sig") as file:
            text = file.read(MAX_BYTES + 1)
    except OSError as error:
        raise InputError(f"{path}: cannot be read: {error.strerror}: {remedy_of(error)}") from error
    except UnicodeDecodeError as error:
        raise InputError(f"{path}: not UTF-8 text ({fact_of(error)}): save it as UTF-8") from error
    if len(text) > MAX_BYTES:
        raise InputError(f"{path}: it is longer than {MAX_BYTES >> 20} MB: shorten it")
    delimiter = _delimiter(text)
    try:
        table = [
            (number, [_pointed(cell.strip(), delimiter) for cell in row])
            for number, row in enumerate(
                csv.reader(io.StringIO(text), delimiter=delimiter, strict=True), start=1
            )
            if any(cell.strip() for cell in row) and not row[0].lstrip().startswith("#")
        ]
    except csv.Error as error:
        raise InputError(f"{path}: not a CSV file ({error}): save it anew") from error
    heading = tuple(cell.casefold() for cell in table[0][1]) if table else ()
    if heading not in (FACES, LENGTHS):
        raise InputError(
            f"{path}: its first line is no heading of a field test: it must be "
            f"{','.join(FACES)} or {','.join(LENGTHS)}"
        )
    for number, row in table[1:]:
        if len(row) != len(heading):
            raise InputError(
                f"{path}: line {number}: {len(row)} cells, {len(heading)} needed: "
                f"{', '.join(heading)}"
            )
    if len(table) < 2:
        raise InputError(f"{path}: no rows below its heading: add the measurements")
    return heading, table[1:]


def _delimiter(text: str) -> str:
    """Return what separates the cells of the heading."""
    lines = (line.strip() for line in text.splitlines())
    heading = next((line for line in lines if line and not line.startswith("#")), "")
    return max(DELIMITERS, key=heading.count)


def _pointed(cell: str, delimiter: str) -> str:
    """Return a cell with a decimal point, where it may have a decimal comma."""
    return cell if delimiter == "," else cell.replace(",", ".")


def _numbers(texts: Sequence[str], names: Sequence[str], where: str) -> tuple[float, ...]:
    return tuple(_number(text, name, where) for text, name in zip(texts, names, strict=True))


def _number(text: str, name: str, where: str) -> float:
    try:
        value = float(text)
    except ValueError:
        value = math.nan
    if not abs(value) < 1e6:
        raise InputError(f"{where}: {name} is {text[:40]!r}: a number is needed")
    return value
