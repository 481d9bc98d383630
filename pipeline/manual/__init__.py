"""User manual: Markdown chapters and SVG drawings, built into pages that need no network."""

from .build import pages

__all__ = ["pages"]
