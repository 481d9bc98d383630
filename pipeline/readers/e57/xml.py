"""Parser of the XML of an E57 file, within limits of depth and size, without entities."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field
from xml.parsers import expat  # refuses what expands before it does

from ..faults import fault
from ..source import Source, shown

NAMESPACE = "http://www.astm.org/COMMIT/E57/2010-e57-v1.0 "
MAX_DEPTH = 64
MAX_ELEMENTS = 400_000


@dataclass
class Element:
    """An XML element; its name is without the namespace where that is the standard's own."""

    name: str
    attributes: dict[str, str]
    pieces: list[str] = field(default_factory=list)
    children: list[Element] = field(default_factory=list)

    @property
    def text(self) -> str:
        """Text of the element, without that of its children."""
        return "".join(self.pieces)

    def find(self, *names: str) -> Element | None:
        """Return the first descendant by a path of names."""
        if not names:
            return self
        child = next((child for child in self.children if child.name == names[0]), None)
        return child and child.find(*names[1:])

    def each(self, *names: str) -> Iterator[Element]:
        """Iterate over the children of the descendant by a path of names."""
        found = self.find(*names)
        return iter(found.children if found else ())


class _RefusedError(Exception):
    """XML that expat would accept and this reader refuses."""


def parse_xml(text: bytes, source: Source) -> Element:
    """Return the root element.

    Raises InputError for invalid XML, for a document type or an entity, and for more depth or
    elements than any scan file has.
    """
    root = Element("", {})
    open_elements, count = [root], 0

    def start(name: str, attributes: dict[str, str]) -> None:
        nonlocal count
        count += 1
        if len(open_elements) > MAX_DEPTH:
            raise _RefusedError(f"nests deeper than {MAX_DEPTH} elements")
        if count > MAX_ELEMENTS:
            raise _RefusedError(f"has more than {MAX_ELEMENTS} elements")
        element = Element(name.removeprefix(NAMESPACE), attributes)
        open_elements[-1].children.append(element)
        open_elements.append(element)

    def end(_name: str) -> None:
        open_elements.pop()

    def data(piece: str) -> None:
        open_elements[-1].pieces.append(piece)

    def doctype(*_declared: object) -> None:
        raise _RefusedError("declares a document type")

    parser = expat.ParserCreate("utf-8", namespace_separator=" ")
    parser.buffer_text = True
    parser.StartElementHandler, parser.EndElementHandler = start, end
    parser.CharacterDataHandler = data
    parser.StartDoctypeDeclHandler = parser.EntityDeclHandler = doctype
    try:
        parser.Parse(text, True)
    except _RefusedError as reason:
        raise fault(source, f"its XML {reason}") from None
    except expat.ExpatError as error:
        raise fault(source, f"its XML cannot be read ({shown(str(error))})") from None
    return root.children[0]
