"""Renderer of Markdown to HTML with anchors on headings, file captions and inline drawings."""

from __future__ import annotations

import re
import unicodedata
from collections.abc import Callable, Sequence
from html import escape
from typing import Any

from ..system import frozen

SECTIONS = ("h1", "h2", "h3")


@frozen
class ManualSection:
    """A heading of a chapter and the plain text below it, for the search."""

    level: int
    anchor: str
    title: str
    text: str


@frozen
class Rendered:
    """A chapter as HTML, and its sections in order; the first is its title."""

    html: str
    sections: tuple[ManualSection, ...]


def render(text: str, drawing: Callable[[str], str]) -> Rendered:
    """Render Markdown (CommonMark and tables, no HTML) as HTML.

    A link to `NN-name.md` becomes a link to `name.html`. An image `drawings/NAME.svg` is replaced
    by `drawing` of its path. The text after a fence's language is the caption of the block: the
    name of a file.
    """
    from markdown_it import MarkdownIt
    from markdown_it.renderer import RendererHTML

    class Renderer(RendererHTML):
        """Rules that differ from the default renderer's."""

        def fence(self, tokens: Sequence[Any], i: int, options: Any, env: Any) -> str:
            return _block(tokens[i].info, tokens[i].content)

        def table_open(self, tokens: Sequence[Any], i: int, options: Any, env: Any) -> str:
            return '<div class="wide" role="group" aria-label="table" tabindex="0"><table>\n'

        def table_close(self, tokens: Sequence[Any], i: int, options: Any, env: Any) -> str:
            return "</table></div>\n"

        def image(self, tokens: Sequence[Any], i: int, options: Any, env: Any) -> str:
            source, caption = str(tokens[i].attrs["src"]), escape(tokens[i].content)
            if not source.endswith(".svg"):
                return f'<img src="{escape(source)}" alt="{caption}">'
            return f'<span class="drawing">{drawing(source)}<span>{caption}</span></span>'

    parser = MarkdownIt("commonmark", {"html": False}, renderer_cls=Renderer).enable("table")
    tokens = parser.parse(text)
    _link(tokens)
    sections = _anchor(tokens)
    return Rendered(parser.renderer.render(tokens, parser.options, {}), sections)


def slug(title: str) -> str:
    """Return the anchor of a heading: its letters and digits, joined by hyphens."""
    plain = unicodedata.normalize("NFKD", title).encode("ascii", "ignore").decode().lower()
    return re.sub(r"[^a-z0-9]+", "-", plain).strip("-")


def page_of(file: str) -> str:
    """Return the page of a chapter's file: `targets.html` for `03-targets.md`."""
    return re.sub(r"^\d+-", "", file.removesuffix(".md")) + ".html"


def _block(info: str, content: str) -> str:
    language, _, caption = info.strip().partition(" ")
    titled = f"<figcaption>{escape(caption)}</figcaption>" if caption else ""
    code = f'<code class="{escape(language or "text")}">{escape(content)}</code>'
    return f'<figure>{titled}<pre tabindex="0">{code}</pre></figure>\n'


def _link(tokens: Sequence[Any]) -> None:
    """Replace chapter files by their pages in all links."""
    for token in tokens:
        for child in token.children or ():
            target = str(child.attrs.get("href", ""))
            file, mark, anchor = target.partition("#")
            if child.type == "link_open" and file.endswith(".md") and "/" not in file:
                child.attrs["href"] = page_of(file) + mark + anchor


def _anchor(tokens: Sequence[Any]) -> tuple[ManualSection, ...]:
    """Set the anchor of every heading, each once; return the sections that they begin."""
    sections: list[ManualSection] = []
    seen: set[str] = set()
    words: list[str] = []

    def close() -> None:
        if sections:
            last = sections[-1]
            sections[-1] = ManualSection(last.level, last.anchor, last.title, " ".join(words))
        words.clear()

    for i, token in enumerate(tokens):
        if token.type == "heading_open" and token.tag in SECTIONS:
            close()
            title = _plain(tokens[i + 1])
            anchor = slug(title)
            assert anchor not in seen, f"two headings {title!r} in a chapter: name them apart"
            seen.add(anchor)
            token.attrs["id"] = anchor
            sections.append(ManualSection(SECTIONS.index(token.tag) + 1, anchor, title, ""))
        elif token.type == "inline" and tokens[i - 1].type != "heading_open":
            words.append(_plain(token))
        elif token.type == "fence":
            words.append(" ".join(token.content.split()))
    close()
    return tuple(sections)


def _plain(inline: Any) -> str:
    kinds = ("text", "code_inline", "image")
    return "".join(
        child.content if child.type in kinds else " " * (child.type == "softbreak")
        for child in inline.children
    )
