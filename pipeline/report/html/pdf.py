"""The report as PDF, for the file: the same page, printed by WeasyPrint."""

from __future__ import annotations

import ctypes.util
import gc
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

from ...errors import MissingDependencyError

VARIANT = "pdf/ua-1"  # tagged, for readers of all kinds: ISO 14289-1
FIND_LIBRARY = ctypes.util.find_library


def pdf_report(page: str, identifier: str) -> bytes:
    """Print the HTML page `page`, without 3D view, as tagged PDF; same page, same bytes.

    identifier: that the file carries. Raises MissingDependencyError where WeasyPrint, or Pango
    below it, is not installed.
    """
    with _without_collector():
        try:
            with _libraries_by_soname():
                from weasyprint import HTML
        except (ImportError, OSError) as error:
            raise MissingDependencyError(
                "the PDF needs WeasyPrint and the Pango library: pip install 'wheelplane[pdf]', "
                "and libpango-1.0-0 and libpangoft2-1.0-0 by the system's package manager"
            ) from error
        made = HTML(string=page, url_fetcher=_within())
        return bytes(made.write_pdf(pdf_identifier=identifier.encode(), pdf_variant=VARIANT))


@contextmanager
def _without_collector() -> Iterator[None]:
    """Hold the garbage collector, which goes through a growing tree of boxes again and again."""
    held = gc.isenabled()
    gc.disable()
    try:
        yield
    finally:
        if held:
            gc.enable()


@contextmanager
def _libraries_by_soname() -> Iterator[None]:
    """Load libraries by their sonames alone, on Linux.

    WeasyPrint tries several names of each library; for one that does not exist, ctypes starts
    ldconfig, a compiler and a linker. The soname is among them, and found by the loader itself.
    """
    if sys.platform == "linux" and "weasyprint" not in sys.modules:
        ctypes.util.find_library = lambda name: None
    try:
        yield
    finally:
        ctypes.util.find_library = FIND_LIBRARY


def _within() -> Any:
    """Return a fetcher of data URIs alone: nothing is read from the network or the disk."""
    from weasyprint.urls import URLFetcher

    return URLFetcher(allowed_protocols={"data"})
