"""Text of JSON, which a terminal may show."""

from __future__ import annotations

import json


def json_text(tree: object, indent: int | None = 1) -> str:
    """Return plain data as JSON, every sign as it is but those that could control a terminal.

    Beyond those that JSON escapes anyway these are DEL, the C1 controls, whatever else is not
    printable, and the bytes of a path that are not valid text.
    """
    text = json.dumps(tree, indent=indent, ensure_ascii=False, allow_nan=False)
    if text.replace("\n", "").isprintable():
        return text
    signs = (sign for sign in set(text) - {"\n"} if not sign.isprintable())
    return text.translate({ord(sign): _escaped(sign) for sign in signs})


def _escaped(sign: str) -> str:
    return "\\u007f" if sign == "\x7f" else json.dumps(sign)[1:-1]
