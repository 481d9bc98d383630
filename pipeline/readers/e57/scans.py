"""Scans of an E57 file as its XML declares them: fields, number of points, pose.

Format: ASTM E2807-11, 8.4.3 (data3D), 8.4.4 (points), 5.3 and table 9 (fields and their packing).
"""

from __future__ import annotations

import math

import numpy as np

from ...errors import InputError
from ...system import frozen
from ..faults import fault
from ..source import RawPart, Source, shown
from .xml import Element

CARTESIAN = ("cartesianX", "cartesianY", "cartesianZ")
SPHERICAL = ("sphericalRange", "sphericalAzimuth", "sphericalElevation")
FLOAT, STRING = "Float", "String"
INTEGERS = ("Integer", "ScaledInteger")
UNIT = 1e-6  # single precision, and then some
INT64 = range(-(2**63), 2**63)


@frozen
class Field:
    """A field of every point; bits: what a point takes in the file, 0 for a constant."""

    name: str
    kind: str
    bits: int


@frozen
class E57Scan:
    """One scan: `points_at` is the physical offset of its binary section."""

    index: int
    part: RawPart
    rows: int
    points_at: int
    fields: tuple[Field, ...]

    def has(self, *names: str) -> bool:
        """Return whether the scan has all these fields, as numbers."""
        return set(names) <= {field.name for field in self.fields if field.kind != STRING}


def find_scans(root: Element, source: Source) -> tuple[E57Scan, ...]:
    """Return the scans, including those without points.

    Raises InputError when there is none, or when one does not declare its points.
    """
    if root.name != "e57Root":
        raise fault(source, f"its XML begins with {shown(root.name)}, not with e57Root")
    scans = tuple(_scan(i, scan, source) for i, scan in enumerate(root.each("data3D")))
    if not scans:
        images = len(list(root.each("images2D")))
        raise fault(source, f"it holds no scan ({images} images)", "export the points too")
    return scans


def _scan(index: int, scan: Element, source: Source) -> E57Scan:
    name = _name(scan, index)
    points = scan.find("points")
    try:
        if points is None or points.attributes.get("type") != "CompressedVector":
            raise ValueError("it has no points")
        rows = _integer(points, "recordCount", None)
        points_at = _integer(points, "fileOffset", 0)
        fields = tuple(_field(element) for element in points.each("prototype"))
        if rows < 0:
            raise ValueError(f"it declares {rows} points")
        part = _part(name, scan.find("pose"))
        found = E57Scan(index, part, rows, points_at, fields)
        if rows and not (found.has(*CARTESIAN) or found.has(*SPHERICAL)):
            raise ValueError("its points have neither x, y, z nor range, azimuth, elevation")
    except ValueError as error:
        raise _bad_scan(source, name, error) from None
    return found


def _bad_scan(source: Source, name: str, error: ValueError) -> InputError:
    return fault(source, f"its scan {shown(name)}: {error}")


def _name(scan: Element, index: int) -> str:
    for tag in ("name", "guid"):
        element = scan.find(tag)
        words = " ".join(element.text.split()) if element else ""
        if words.isprintable() and words:
            return words
    return f"scan {index + 1}"


def _integer(element: Element, attribute: str, default: int | None) -> int:
    text = element.attributes.get(attribute)
    if text is None and default is not None:
        return default
    try:
        value = int(text or "")
    except ValueError:
        raise ValueError(f"{attribute} is {shown(text or '')}, not an integer") from None
    if value not in INT64:
        raise ValueError(f"{attribute} is {value}, beyond 64 bits")
    return value


def _field(element: Element) -> Field:
    """Return a field and its packing: floats whole, integers in the bits their range needs."""
    kind = element.attributes.get("type", "")
    if kind == FLOAT:
        single = element.attributes.get("precision", "double") == "single"
        return Field(element.name, kind, 32 if single else 64)
    if kind in INTEGERS:
        low = _integer(element, "minimum", INT64.start)
        high = _integer(element, "maximum", INT64.stop - 1)
        if high < low:
            raise ValueError(f"its field {shown(element.name)} lies between {low} and {high}")
        return Field(element.name, kind, (high - low).bit_length())
    if kind == STRING:
        return Field(element.name, kind, 8)  # at least the byte of its length
    raise ValueError(f"its field {shown(element.name)} is of the type {shown(kind)}")


def _part(name: str, pose: Element | None) -> RawPart:
    """Return the scan with its pose, from a unit quaternion and a translation.

    A missing translation is zero; a missing rotation, or the quaternion 0 0 0 0, is the identity:
    until 2022 libE57Format and pye57 wrote it by default, and CloudCompare reads it so. Other
    quaternions are normalised.
    """
    if pose is None:
        return RawPart(name)
    T = np.eye(4)
    T[:3, 3] = [_float(pose, "translation", axis) for axis in "xyz"]
    quaternion = [_float(pose, "rotation", part) for part in "wxyz"]
    norm = math.hypot(*quaternion)
    note = ""
    if pose.find("rotation") is None:
        note = "its pose has no rotation: taken as the identity"
    elif norm == 0.0:
        note = "the quaternion of its pose is 0 0 0 0: taken as the identity"
    else:
        T[:3, :3] = _rotation(*(part / norm for part in quaternion))
        if abs(norm - 1.0) > UNIT:
            note = f"the quaternion of its pose has the length {norm:.6g}: it was normalised"
    return RawPart(name, T, note)


def _rotation(w: float, x: float, y: float, z: float) -> list[list[float]]:
    return [
        [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
        [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
        [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
    ]


def _float(pose: Element, *path: str) -> float:
    element = pose.find(*path)
    text = element.text.strip() if element else ""
    try:
        return float(text or "0")
    except ValueError:
        raise ValueError(f"{path[-1]} of its {path[0]} is {shown(text)}, not a number") from None
