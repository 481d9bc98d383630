"""XML by lxml: elements to bytes, and files against a schema that lies on this machine."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import field
from pathlib import Path
from typing import Any

from ...errors import InputError, MissingDependencyError
from ...system import frozen

NAMESPACES = {
    "dcc": "https://ptb.de/dcc",
    "si": "https://ptb.de/si",
    "xsi": "http://www.w3.org/2001/XMLSchema-instance",
}


@frozen
class Element:
    """An element, its name with a prefix of NAMESPACES: a text or other elements."""

    name: str
    text: str = ""
    children: tuple[Element, ...] = ()
    attributes: Mapping[str, str] = field(default_factory=dict)


def element(name: str, *content: Element | str | None, **attributes: str) -> Element:
    """Return an element of texts or of elements; None among them is left out.

    White space and what cannot be printed becomes one blank.
    """
    text = " ".join(part for part in content if isinstance(part, str))
    text = " ".join("".join(c if c.isprintable() else " " for c in text).split())
    children = tuple(part for part in content if isinstance(part, Element))
    return Element(name, text, children, attributes)


def optional(name: str, text: str, **attributes: str) -> Element | None:
    """Return an element of a text; None where it is empty."""
    return element(name, text, **attributes) if text else None


def to_bytes(root: Element) -> bytes:
    """Return the document; same element, same bytes. Raises MissingDependencyError."""
    etree = _etree()
    return bytes(
        etree.tostring(
            _node(root, etree), encoding="UTF-8", xml_declaration=True, pretty_print=True
        )
    )


def _node(one: Element, etree: Any) -> Any:
    node = etree.Element(_name(one.name), nsmap=NAMESPACES)
    for key, value in one.attributes.items():
        node.set(_name(key.replace("__", ":")), value)
    node.text = one.text or None
    for child in one.children:
        node.append(_node(child, etree))
    return node


def _name(name: str) -> str:
    prefix, colon, local = name.partition(":")
    return f"{{{NAMESPACES[prefix]}}}{local}" if colon else name


def schema_faults(path: Path, schema: Path) -> list[str]:
    """Return why the file does not fit the schema, each with its line; empty where it does.

    schema: its file, or a folder with `dcc.xsd`. What it imports is looked up by name beside it and
    below; nothing is read from the network. Raises InputError, MissingDependencyError.
    """
    etree = _etree()
    top = schema / "dcc.xsd" if schema.is_dir() else schema
    missing: list[str] = []
    parser = etree.XMLParser(no_network=True, load_dtd=False)
    parser.resolvers.add(_beside(top, missing, etree))
    try:
        law = etree.XMLSchema(_parsed(top, parser, etree))
    except etree.XMLSchemaParseError as error:
        fact = f"it imports {missing[0]}: save that beside it" if missing else f"{error}: check it"
        raise InputError(f"{top}: no usable schema: {fact}") from error
    found = _parsed(path, etree.XMLParser(no_network=True, resolve_entities=False), etree)
    law.validate(found)
    return [f"line {fault.line}: {_short(fault.message)}" for fault in law.error_log]


def _parsed(path: Path, parser: Any, etree: Any) -> Any:
    if not path.is_file():
        raise InputError(f"{path}: no such file: check the path")
    try:
        return etree.parse(str(path), parser)
    except etree.XMLSyntaxError as error:
        raise InputError(f"{path}: no well-formed XML: {error}: check the file") from error


def _beside(top: Path, missing: list[str], etree: Any) -> Any:
    """Return a resolver that finds a schema by its file name beside `top` or below.

    missing: addresses that it does not find are added.
    """
    known = {path.name.casefold(): path for path in sorted(top.parent.rglob("*.xsd"))}

    class Beside(etree.Resolver):  # type: ignore[misc]
        def resolve(self, url: str, _public_id: str, context: Any) -> Any:
            if url == str(top):
                return None  # lxml reads it itself
            path = known.get(url.rpartition("/")[2].casefold())
            if path is None:
                missing.append(url)
                return self.resolve_empty(context)
            return self.resolve_filename(str(path), context)

    return Beside()


def _short(message: str) -> str:
    for prefix, uri in NAMESPACES.items():
        message = message.replace(f"{{{uri}}}", f"{prefix}:")
    return message


def _etree() -> Any:
    try:
        from lxml import etree
    except ImportError as error:
        raise MissingDependencyError(
            "the digital certificate needs lxml: pip install 'wheelplane[dcc]'"
        ) from error
    return etree
