"""Builder of the manual's pages from chapters, drawings and a template."""

from __future__ import annotations

import json
from pathlib import Path

from .. import __version__
from ..system import frozen
from .markdown import Rendered, page_of, render

HERE = Path(__file__).parent
PIECES = ("manual.css", "search.js", "icon.svg")


@frozen
class Chapter:
    """One page of the manual: path, title and content."""

    page: str
    title: str
    content: Rendered


def pages() -> dict[str, bytes]:
    """Return all files of the manual by path, `index.html` first; the same bytes every time.

    The files refer only to each other. They need no network, no inline script and no inline style,
    and work from a folder and at any address.
    """
    chapters = [_chapter(path) for path in chapter_files()]
    files = {chapter.page: _page(chapter, chapters) for chapter in chapters}
    files |= {name: (HERE / "pieces" / name).read_bytes() for name in PIECES}
    files["search-index.js"] = _index(chapters)
    return files | {path.name: path.read_bytes() for path in pictures()}


def chapter_files() -> list[Path]:
    """Return the chapters in the order of their numbers."""
    return sorted(HERE.glob("[0-9][0-9]-*.md"))


def pictures() -> list[Path]:
    """Return the pictures that the pages load as separate files."""
    return sorted(HERE.glob("*.png"))


def _chapter(path: Path) -> Chapter:
    content = render(path.read_text(encoding="utf-8"), _drawing)
    return Chapter(page_of(path.name), content.sections[0].title, content)


def _drawing(source: str) -> str:
    """Return a drawing as inline SVG."""
    return (HERE / source).read_text(encoding="utf-8").strip()


def _page(chapter: Chapter, chapters: list[Chapter]) -> bytes:
    from jinja2 import Environment, FileSystemLoader, StrictUndefined

    loader = FileSystemLoader(HERE / "pieces")
    environment = Environment(
        loader=loader, autoescape=True, undefined=StrictUndefined, trim_blocks=True,
        lstrip_blocks=True, keep_trailing_newline=True,
    )  # fmt: skip
    number = chapters.index(chapter)
    text = environment.get_template("page.html").render(
        version=__version__,
        chapter=chapter,
        chapters=chapters,
        parts=[section for section in chapter.content.sections if section.level == 2],
        before=chapters[number - 1] if number else None,
        after=chapters[number + 1] if number + 1 < len(chapters) else None,
    )
    return text.encode()


def _index(chapters: list[Chapter]) -> bytes:
    """Return the search index: one row (page, anchor, chapter, title, text) per section."""
    rows = [
        [chapter.page, section.anchor, chapter.title, section.title, section.text]
        for chapter in chapters
        for section in chapter.content.sections
    ]
    text = json.dumps(rows, ensure_ascii=False, separators=(",", ":"))
    return f"window.wheelplaneManual = {text};\n".encode()
