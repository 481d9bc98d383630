"""The certificate of a calibration as a document: ISO/IEC 17025:2017, 7.8.2, 7.8.4 and 7.8.6."""

from __future__ import annotations

import hashlib
from collections.abc import Sequence

from ... import __version__
from ...calibration import Calibration, Certificate, QuantityResult
from ..format.language import Translations
from ..format.notes import notes_in
from ..format.writer import Table, Writer
from ..tables.calibration import (
    adjustments_table,
    anova_table,
    as_found,
    budget_table,
    declared,
    gauge_rr_table,
    points_table,
    reasons,
    shown_lines,
    title,
)
from ..tables.certificate import (
    STANDS_ELSEWHERE,
    amended,
    conditions_lines,
    day,
    days,
    lacking,
    overdue_lines,
    signers,
    standards_table,
    statements,
)
from ..tables.conformity import SIGNS, decided, doubted
from .document import Document, Part, Section
from .provenance import Pairs
from .results import Headline


def certificate_document(made: Certificate, writer: Writer, record: str) -> Document:
    """Return the certificate; record: the JSON of its calibration."""
    words, found = writer.words, made.calibration
    kind = words("certificate.amended" if made.stated.replaces else "certificate.title")
    number = made.stated.number or words("certificate.no_number")
    running = words("certificate.running")
    return Document(
        title=kind,
        record=record,
        head=_head(made, number, writer),
        headline=_headline(found, words),
        results=[
            Section("results", words("certificate.results"), _results(found, writer)),
            Section("conditions", words("certificate.conditions"), _conditions(made, writer)),
            Section(
                "statements",
                words("certificate.statements"),
                [text for key, text in statements(made, words) if key not in STANDS_ELSEWHERE],
            ),
        ],
        annexes=[
            Section("budgets", words("section.uncertainty"), _annex(found, writer)),
            _origin(found, record, words),
        ],
        notes=notes_in(found.notes, words),
        number=number,
        running=f"{words('certificate.draft')}: {running}" if made.draft else running,
        ending=words("certificate.end"),
        draft=lacking(made, words),
        names=signers(made),
    )


def _head(made: Certificate, number: str, writer: Writer) -> Pairs:
    words, stated, item = writer.words, made.stated, made.calibration.item
    customer = ", ".join([stated.customer, *_lines(stated.customer_address)])
    laboratory = made.laboratory
    contact = ", ".join(text for text in (laboratory.email, laboratory.phone) if text)
    pairs = [
        ("number", number),
        ("replaces", amended(made, words)),
        ("code", laboratory.code),
        ("contact", contact),
        ("customer", customer.strip(", ") or writer.none),
        ("item", words("certificate.machine", maker=item.maker, model=item.model)),
        ("serial", item.serial),
        ("software", item.software),
        ("condition", stated.condition),
        ("method", stated.method or writer.none),
        ("place", made.place or writer.none),
        ("received", day(stated.received, writer)),
        ("performed", days(made, writer)),
        ("issued", day(stated.issued, writer)),
    ]
    return [(words(f"certificate.{key}"), text) for key, text in pairs if text]


def _lines(text: str) -> list[str]:
    return [line.strip() for line in text.strip().splitlines()]


def _headline(found: Calibration, words: Translations) -> Headline | None:
    decision = found.decision
    if decision is None:
        return None
    key = decision.replace(" ", "_")
    left = any(result.state == "as left" for result in found.final)
    state = words(f"calibration.{'left' if left else 'found'}").capitalize()
    says = (
        words(f"certificate.{key}_says", state=state),
        *as_found(found, words),
        *doubted(found.doubts, words),
    )
    return Headline(decision.replace(" ", "-"), SIGNS[decision], decided(decision, words), says)


def _results(found: Calibration, writer: Writer) -> list[Part]:
    words = writer.words
    parts: list[Part] = [words("calibration.signs")]
    for result in found.results:
        parts += [points_table(result, writer), f"{declared(result, writer)}."]
        parts += ["; ".join(why) + "."] if (why := reasons(result, writer)) else []
        parts.append(_sentences([*shown_lines(result, writer), *result.notes]))
    if found.adjustments:
        parts.append(adjustments_table(found, writer))
    return [*parts, words("calibration.columns")]


def _sentences(lines: Sequence[str]) -> str:
    return " ".join(line if line.endswith(".") else f"{line}." for line in lines)


def _conditions(made: Certificate, writer: Writer) -> list[Part]:
    lines = conditions_lines(made, writer.words)
    parts: list[Part] = [_sentences(lines)] if lines else []
    if made.standards:
        parts.append(standards_table(made, writer))
    return [*parts, *overdue_lines(made, writer.words)]


def _annex(found: Calibration, writer: Writer) -> list[Part]:
    parts: list[Part] = []
    for result in found.results:
        parts += [
            title(result, writer.words),
            budget_table(result, writer),
            *_study(result, writer),
        ]
    return parts


def _study(result: QuantityResult, writer: Writer) -> list[Table]:
    study = result.gauge_rr
    if study is None:
        return []
    return [anova_table(study, result, writer), gauge_rr_table(study, result, writer)]


def _origin(found: Calibration, record: str, words: Translations) -> Section:
    """Return the digests of the files that the certificate comes from."""
    several = len({one.provenance.source for one in found.references}) > 1
    measured = dict.fromkeys(
        (f"{one.provenance.source}: {name}" if several else name, digest)
        for one in found.references
        for name, digest in one.provenance.inputs.items()
    )
    own = hashlib.sha256(record.encode(errors="backslashreplace")).hexdigest()
    inputs = [
        *measured,
        (found.readings.source, found.readings.sha256),
        ("calibration.json", own),
    ]
    rows = [[name, digest.removeprefix("sha256:")] for name, digest in inputs]
    files = Table((words("origin.file"), words("origin.digest")), rows, 2, words("origin.inputs"))
    dates = [
        words("calibration.from", source=one.provenance.source,
              date=one.provenance.date or words("front.undated"))
        for one in found.references
    ]  # fmt: skip
    program = f"{words('origin.program')}: {words('origin.version', version=__version__)}."
    return Section("origin", words("section.origin"), [program, f"{'; '.join(dates)}.", files])
