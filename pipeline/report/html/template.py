"""Pages from templates; jinja2 stays behind this file."""

from __future__ import annotations

from pathlib import Path
from typing import Any

HERE = Path(__file__).parent
PLAIN = "\n\u00a0"  # a new line, and the space between digits


def render(name: str, page: dict[str, Any]) -> str:
    """Return the page that a template makes of these values; unknown ones are errors."""
    from jinja2 import Environment, FileSystemLoader, StrictUndefined
    from markupsafe import Markup

    def finalize(value: Any) -> Any:
        return (
            printable(value) if isinstance(value, str) and not isinstance(value, Markup) else value
        )

    # `include` brings script and style, which hold no text of a user's
    made = Environment(
        loader=FileSystemLoader(HERE / "templates"),
        autoescape=True,
        trim_blocks=True,
        lstrip_blocks=True,
        finalize=finalize,
        undefined=StrictUndefined,
    )
    made.filters["longest"] = lambda text: max(map(len, text.split()), default=0)
    return made.get_template(name).render(page)


def printable(text: str) -> str:
    """Escape control characters and those that change the direction of reading."""
    return "".join(c if c.isprintable() or c in PLAIN else repr(c)[1:-1] for c in text)
