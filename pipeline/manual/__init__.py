"""The user manual: chapters in Markdown, drawings in SVG, made into pages that need no network."""

from .build import pages

__all__ = ["pages"]
