"""Tables and sentences of a certificate: what it lacks, standards, conditions, statements."""

from __future__ import annotations

import datetime
from collections.abc import Sequence

from ...calibration import Certificate
from ...config import StandardConfig
from ..format.language import Translations
from ..format.writer import Table, Writer
from .calibration import as_found, rule_words

STANDS_ELSEWHERE = {"amended", "condition", "environment", "overdue"}
CONDITIONS = (
    ("temperature_c", "temperature_u_c", "°C"),
    ("humidity_percent", "humidity_u_percent", "%"),
    ("pressure_hpa", "pressure_u_hpa", "hPa"),
)


def lacking(made: Certificate, words: Translations) -> list[str]:
    """Return why a certificate is a draft: what is missing, and readings that are doubted."""
    found = [
        words(
            f"certificate.missing_{one.table}_{one.key}",
            name=one.name,
            entry=f"[{one.table}]" if one.key == "any" else f"[{one.table}] {one.key}",
        )
        for one in made.missing
    ]
    if made.calibration.warnings:
        found.append(words("certificate.doubted", file="calibration.txt"))
    if made.calibration.doubts:
        found.append(words("certificate.in_doubt", file="calibration.txt"))
    return found


def day(date: datetime.date | None, writer: Writer) -> str:
    """Write a date as ISO 8601 has it."""
    return writer.none if date is None else date.isoformat()


def days(made: Certificate, writer: Writer) -> str:
    """Write the day of the calibration, or the first and the last."""
    if made.performed is None:
        return writer.none
    first, last = made.performed
    if first == last:
        return day(first, writer)
    return writer.words("certificate.from_to", low=day(first, writer), high=day(last, writer))


def standards_table(made: Certificate, writer: Writer) -> Table:
    """Return a row for each reference standard and sensor."""
    words = writer.words
    columns = [words(f"certificate.standard_{name}") for name in
               ("name", "serial", "certificate", "issuer", "calibrated", "due")]  # fmt: skip
    rows = [
        [
            _called(one),
            one.serial or writer.none,
            one.certificate or writer.none,
            one.issuer or writer.none,
            day(one.calibrated, writer),
            day(one.due, writer),
        ]
        for one in made.standards
    ]
    late = [one in made.overdue for one in made.standards]
    classes = ["bad" if one else "" for one in late]
    return writer.table(columns, rows, len(columns), words("certificate.standards"), classes)


def _called(one: StandardConfig) -> str:
    return f"{one.description} ({one.name})" if one.description else one.name


def overdue_lines(made: Certificate, words: Translations) -> list[str]:
    """Return in words which standards were used past their due date."""
    return [
        words("certificate.overdue", name=_called(one), due=str(one.due)) for one in made.overdue
    ]


def conditions_lines(made: Certificate, words: Translations) -> list[str]:
    """Return in words the conditions during the calibration, and their sensors."""
    stated = made.environment
    found = []
    for key, of_sensor, unit in CONDITIONS:
        ends, expanded = getattr(stated, key), getattr(stated, of_sensor)
        if ends is not None:
            low, high = (words.number(f"{x:g} {unit}") for x in ends)
            shown = low if low == high else words("certificate.from_to", low=low, high=high)
            if expanded is not None:
                shown += f" (U {words.number(f'{expanded:g} {unit}')})"
            found.append(words(f"certificate.{key}", value=shown))
    return [*found, *_of_sensors(made, words)]


def _of_sensors(made: Certificate, words: Translations) -> list[str]:
    """Return in words what the conditions were measured by, and the laboratory's note on them."""
    stated = made.environment
    names = ", ".join(stated.sensors)
    found = [names and words("certificate.sensors", names=names), stated.note]
    return [text for text in found if text]


def traceability(made: Certificate, words: Translations) -> str:
    """Return the statement of metrological traceability."""
    shown = [words("certificate.traceable")] if made.standards else []
    return " ".join([*shown, *made.laboratory.traceability.split()])


def statements(made: Certificate, words: Translations) -> list[tuple[str, str]]:
    """Return the statements of a certificate by their keys, each in words.

    Those of STANDS_ELSEWHERE have places of their own in the printed form.
    """
    stated, text = made.stated, made.stated.deviations
    condition = f"{words('certificate.condition')}: {stated.condition}"
    environment = "; ".join(_of_sensors(made, words))
    found = [
        ("condition", stated.condition and condition),
        ("environment", environment and f"{words('certificate.conditions')}: {environment}"),
        ("overdue", " ".join(overdue_lines(made, words))),
        ("deviations", text and words("certificate.deviations", text=text)),
        ("uncertainty", words("certificate.uncertainty")),
        ("traceability", traceability(made, words)),
        ("rule", rule_words(made.calibration, words)),
        ("conformity", _conformity(made, words) if made.calibration.rule else ""),
        ("item", words("certificate.only_item")),
        ("copy", words("certificate.copy")),
        ("amended", amended(made, words)),
        ("remarks", stated.remarks),
    ]  # fmt: skip
    return [(key, text) for key, text in found if text]


def _conformity(made: Certificate, words: Translations) -> str:
    return " ".join([words("certificate.conformity"), *as_found(made.calibration, words)])


def amended(made: Certificate, words: Translations) -> str:
    """Return in words which certificate this one replaces, and why; empty for none."""
    if not made.stated.replaces:
        return ""
    return words(
        "certificate.amends", number=made.stated.replaces, reason=made.stated.reason
    ).strip()


def signers(made: Certificate) -> Sequence[str]:
    """Return name and role of those who authorise the certificate."""
    return [f"{one.name}, {one.role}" for one in made.stated.signature]
