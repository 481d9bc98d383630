"""The forms of a calibration certificate."""

from __future__ import annotations

from ..calibration import Certificate
from .dcc.certificate import dcc_bytes
from .format.report_options import ReportOptions
from .format.writer import MINUS, Writer
from .html.certificate import certificate_document
from .write import ReportFiles, document_files

FORMS = ("certificate.html", "certificate.pdf", "certificate.xml")


def certificate_files(
    made: Certificate, record: str, options: ReportOptions, wanted: ReportFiles, dcc: bool = False
) -> dict[str, bytes]:
    """Return the wanted forms of a certificate by file name; record: calibration.json.

    Raises InputError for the digital form of a draft, MissingDependencyError.
    """
    writer = Writer(options.words, options.view, minus=MINUS)
    document = certificate_document(made, writer, record)
    files = document_files("certificate", document, options, wanted)
    if dcc:
        files["certificate.xml"] = dcc_bytes(made, options.words.language)
    return files
