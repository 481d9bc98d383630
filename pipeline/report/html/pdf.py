"""The report as PDF, for the file: the same page, printed by WeasyPrint."""

from __future__ import annotations

from typing import Any

from ...errors import MissingDependencyError

VARIANT = "pdf/ua-1"  # tagged, for readers of all kinds: ISO 14289-1


def pdf_report(page: str, identifier: str) -> bytes:
    """Print the HTML page `page`, without 3D view, as tagged PDF; same page, same bytes.

    identifier: that the file carries. Raises MissingDependencyError where WeasyPrint, or Pango
    below it, is not installed.
    """
    try:
        from weasyprint import HTML
    except (ImportError, OSError) as error:
        raise MissingDependencyError(
            "the PDF needs WeasyPrint and the Pango library: pip install 'wheelplane[pdf]', and "
            "libpango-1.0-0 and libpangoft2-1.0-0 by the system's package manager"
        ) from error
    made = HTML(string=page, url_fetcher=_within())
    return bytes(made.write_pdf(pdf_identifier=identifier.encode(), pdf_variant=VARIANT))


def _within() -> Any:
    """Return a fetcher of data URIs alone: nothing is read from the network or the disk."""
    from weasyprint.urls import URLFetcher

    return URLFetcher(allowed_protocols={"data"})
