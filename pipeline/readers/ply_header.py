"""The header of a PLY file.

Format: Greg Turk, The PLY Polygon File Format, 1994, http://paulbourke.net/dataformats/ply/
"""

from __future__ import annotations

from dataclasses import dataclass, field

from pipeline.errors import InputError
from pipeline.readers.faults import fault, too_many
from pipeline.readers.raw import Source, shown

_SCALARS = {
    **{"char": "i1", "short": "i2", "int": "i4", "float": "f4", "double": "f8"},
    **{"uchar": "u1", "ushort": "u2", "uint": "u4", "float32": "f4", "float64": "f8"},
    **{"int8": "i1", "int16": "i2", "int32": "i4", "int64": "i8"},
    **{"uint8": "u1", "uint16": "u2", "uint32": "u4", "uint64": "u8"},
}
_ORDERS = {"ascii": "", "binary_little_endian": "<", "binary_big_endian": ">"}
_LONGEST_LINE = 1 << 16
_MOST_LINES = 5000


@dataclass(frozen=True)
class PlyProperty:
    """form: numpy scalar type without byte order; count_form: that of a list's length, or None."""

    name: str
    form: str
    count_form: str | None = None

    @property
    def size(self) -> int:
        """Bytes of one value."""
        return int(self.form[1])


@dataclass(frozen=True)
class PlyElement:
    """`count` records of the same properties."""

    name: str
    count: int
    properties: list[PlyProperty] = field(default_factory=list)

    @property
    def has_list(self) -> bool:
        """Whether its records differ in length."""
        return any(prop.count_form for prop in self.properties)

    @property
    def itemsize(self) -> int:
        """Bytes of a binary record without lists."""
        return sum(prop.size for prop in self.properties)


@dataclass(frozen=True)
class PlyHeader:
    """order: "<" or ">", "" for ascii; lines: of the header, end_header included."""

    order: str
    before: list[PlyElement]
    vertex: PlyElement
    after: list[PlyElement]
    lines: int


def read_header(source: Source) -> PlyHeader:
    """Read up to and including the end_header line."""
    order: str | None = None
    elements: list[PlyElement] = []
    number = 1
    if source.stream.readline(_LONGEST_LINE).strip() != b"ply":
        raise fault(source, "line 1 is not 'ply'")
    while (words := _next_words(source, number + 1)) != ["end_header"]:
        number += 1
        if number > _MOST_LINES:
            raise too_many(source, _MOST_LINES, "lines in its header")
        match words:
            case ["comment" | "obj_info", *_] | []:
                pass
            case ["format", name, "1.0"] if name in _ORDERS and order is None:
                order = _ORDERS[name]
            case ["element", name, count]:
                if any(name == element.name for element in elements):
                    raise fault(source, f"line {number} declares the element {name} again")
                elements.append(PlyElement(name, _count(count, name, source)))
            case ["property", *declaration] if elements:
                _add_property(elements[-1], declaration, number, source)
            case _:
                raise _strange(number, " ".join(words), source)
    if order is None:
        raise fault(source, "the PLY header has no format line")
    return _split(order, elements, number + 1, source)


def _split(order: str, elements: list[PlyElement], lines: int, source: Source) -> PlyHeader:
    at = next((i for i, element in enumerate(elements) if element.name == "vertex"), None)
    if at is None:
        mend = "export a point cloud"
        raise fault(source, "the PLY header declares no vertex element", mend)
    return PlyHeader(order, elements[:at], elements[at], elements[at + 1 :], lines)


def _next_words(source: Source, number: int) -> list[str]:
    raw = source.stream.readline(_LONGEST_LINE)
    if not raw.endswith(b"\n"):
        if len(raw) == _LONGEST_LINE:
            raise _strange(number, raw.decode("latin-1"), source)
        raise fault(source, "the PLY header has no whole end_header line", "copy the file again")
    return raw.decode("latin-1").split()


def _add_property(element: PlyElement, declaration: list[str], number: int, source: Source) -> None:
    match declaration:
        case ["list", count_type, value_type, name]:
            types = [value_type, count_type]
        case [value_type, name]:
            types = [value_type]
        case _:
            raise _strange(number, " ".join(["property", *declaration]), source)
    for kind in types:
        if kind not in _SCALARS:
            raise fault(source, f"line {number} has the unknown type {shown(kind)}")
    if any(name == prop.name for prop in element.properties):
        raise fault(source, f"line {number} declares the property {name} of {element.name} again")
    forms = [_SCALARS[kind] for kind in types]
    if len(forms) == 2 and forms[1][0] == "f":
        raise fault(source, f"line {number} counts a list with the type {shown(types[1])}")
    element.properties.append(PlyProperty(name, *forms))


def _count(text: str, name: str, source: Source) -> int:
    if not (text.isascii() and text.isdigit() and len(text) <= 18):
        raise fault(source, f"the header declares {shown(text)} of {name}, which is not a count")
    return int(text)


def _strange(number: int, line: str, source: Source) -> InputError:
    return fault(source, f"line {number} is not of a PLY header: {shown(line)}")
