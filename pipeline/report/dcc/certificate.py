"""A certificate as a Digital Calibration Certificate (DCC 3.3.0)."""

from __future__ import annotations

from ...calibration import Certificate
from ...errors import InputError
from ..format.language import LANGUAGES, load_translations
from ..tables.certificate import lacking
from .administrative import administrative_data
from .results import measurement_results
from .xml import element, to_bytes

VERSION = "3.3.0"
SCHEMA = f"https://ptb.de/dcc https://ptb.de/dcc/v{VERSION}/dcc.xsd"


def dcc_bytes(made: Certificate, language: str) -> bytes:
    """Return the XML; same certificate, same bytes. Raises InputError for a draft.

    language: the one that decides; texts of the program stand in all of them.
    """
    why = lacking(made, load_translations("en"))
    if not why and not made.laboratory.country:
        why = ["the country of the laboratory is missing (laboratory: country)"]
    if why:
        more = f", and {len(why) - 1} more" if len(why) > 1 else ""
        raise InputError(f"--dcc of a draft: {why[0]}{more}: complete it, or leave out --dcc")
    root = element(
        "dcc:digitalCalibrationCertificate",
        administrative_data(made, language, LANGUAGES),
        measurement_results(made),
        schemaVersion=VERSION,
        xsi__schemaLocation=SCHEMA,
    )
    return to_bytes(root)
