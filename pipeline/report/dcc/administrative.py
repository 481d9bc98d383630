"""Administrative data of a digital certificate: identification, item, laboratory, statements."""

from __future__ import annotations

from collections.abc import Sequence

from ... import __version__
from ...calibration import Calibration, Certificate
from ..format.language import load_translations
from ..tables.certificate import statements
from .conformity import overall
from .texts import both, own, term
from .xml import Element, element, optional


def administrative_data(made: Certificate, language: str, languages: Sequence[str]) -> Element:
    """Return the first ring of the certificate."""
    return element(
        "dcc:administrativeData",
        _software(),
        _core_data(made, language, languages),
        _items(made.calibration),
        _laboratory(made),
        _persons(made),
        element(
            "dcc:customer",
            own("dcc:name", made.stated.customer),
            _location(made.stated.customer_address),
        ),
        _statements(made),
    )


def _software() -> Element:
    one = element(
        "dcc:software",
        own("dcc:name", "wheelplane"),
        element("dcc:release", __version__),
        element("dcc:type", "application"),
    )
    return element("dcc:dccSoftware", one)


def _core_data(made: Certificate, language: str, languages: Sequence[str]) -> Element:
    stated = made.stated
    assert made.performed is not None
    assert stated.received is not None
    assert stated.issued is not None
    first, last = (day.isoformat() for day in made.performed)
    amended = element(
        "dcc:reportAmendedSubstituted",
        element("dcc:typeOfChange", "amended"),
        element("dcc:replacedUniqueIdentifier", stated.replaces),
    )
    return element(
        "dcc:coreData",
        element("dcc:countryCodeISO3166_1", made.laboratory.country),
        *(element("dcc:usedLangCodeISO639_1", code) for code in languages),
        element("dcc:mandatoryLangCodeISO639_1", language),
        element("dcc:uniqueIdentifier", stated.number),
        element("dcc:receiptDate", stated.received.isoformat()),
        element("dcc:beginPerformanceDate", first),
        element("dcc:endPerformanceDate", last),
        element("dcc:performanceLocation", stated.at),
        element("dcc:issueDate", stated.issued.isoformat()),
        amended if stated.replaces else None,
    )


def _items(found: Calibration) -> Element:
    item = found.item
    software = element(
        "dcc:software", own("dcc:name", item.model), element("dcc:release", item.software)
    )
    serial = element(
        "dcc:identification",
        element("dcc:issuer", "manufacturer"),
        element("dcc:value", item.serial),
        term("dcc:name", "certificate.serial"),
        refType="basic_serialNumber",
    )
    name = both(
        "dcc:name",
        lambda words: words("certificate.machine", maker=item.maker, model=item.model),
    )
    one = element(
        "dcc:item",
        name,
        element("dcc:installedSoftwares", software),
        element("dcc:manufacturer", own("dcc:name", item.maker)),
        element("dcc:model", item.model),
        element("dcc:identifications", serial),
    )
    return element("dcc:items", one)


def _laboratory(made: Certificate) -> Element:
    laboratory = made.laboratory
    contact = element(
        "dcc:contact",
        own("dcc:name", laboratory.name),
        optional("dcc:eMail", laboratory.email),
        optional("dcc:phone", laboratory.phone),
        _location(laboratory.address, laboratory.country),
    )
    code = optional("dcc:calibrationLaboratoryCode", laboratory.code)
    return element("dcc:calibrationLaboratory", code, contact)


def _location(address: str, country: str = "") -> Element:
    lines = [element("dcc:content", line) for line in address.strip().splitlines()]
    return element(
        "dcc:location", element("dcc:further", *lines), optional("dcc:countryCode", country)
    )


def _persons(made: Certificate) -> Element:
    people = [
        element(
            "dcc:respPerson",
            element("dcc:person", own("dcc:name", one.name)),
            element("dcc:role", one.role),
            element("dcc:mainSigner", str(place == 0).lower()),
        )
        for place, one in enumerate(made.stated.signature)
    ]
    return element("dcc:respPersons", *people)


def _statements(made: Certificate) -> Element:
    keys = [key for key, _ in statements(made, load_translations("en"))]
    return element("dcc:statements", *(_statement(made, key) for key in keys))


def _statement(made: Certificate, key: str) -> Element:
    return element(
        "dcc:statement",
        optional("dcc:traceable", "true" if key == "traceability" else ""),
        both("dcc:declaration", lambda words: dict(statements(made, words))[key]),
        optional("dcc:conformity", overall(made.calibration) if key == "conformity" else ""),
        refType=f"wheelplane_{key}",
    )
