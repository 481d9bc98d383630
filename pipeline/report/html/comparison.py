"""A comparison of two methods as an HTML page: verdict and differences first, then why."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import PurePath

from ...measurement import Provenance
from ...validation import Comparison, ComparisonStudy, Mountings
from ..format.language import Translations
from ..format.notes import notes_in
from ..format.writer import Table, Writer
from ..plots.validation import bland_altman_drawing, differences_drawing, line_drawing
from ..tables.comparison import (
    agreed,
    causes_table,
    differences_table,
    joint_words,
    labels,
    missing_lines,
    shape_table,
    whole_lines,
)
from ..tables.conformity import SIGNS
from ..tables.mounting import mountings_table, not_both, scatter_lines
from ..tables.study import (
    SETTLED_RAD,
    agreement_lines,
    agreement_table,
    captures_table,
    nees_line,
    not_compared,
    scores_table,
    shared_notes,
    verdict_lines,
)
from .document import Document, Part, Section
from .provenance import Pairs
from .results import Headline

KINDS = {"agree": "conform", "disagree": "not conform"}  # decisions, by whose sign and colour


def comparison_document(found: Comparison, writer: Writer, record: str) -> Document:
    """Return the report of one capture."""
    words = writer.words
    planes = joint_words(found.planes.test(found.planes_rad), words)
    shape = joint_words(found.shape_test, words)
    results = Section(
        "results",
        words("section.results"),
        [differences_table(found, writer), words("comparison.signs"),
         *missing_lines(found, words), differences_drawing(found, words)],
    )  # fmt: skip
    why = Section(
        "why",
        words("comparison.why_title"),
        [words("comparison.why"), causes_table(found, writer),
         words("comparison.planes", test=planes), shape_table(found, writer),
         words("comparison.shape_together", test=shape)],
    )  # fmt: skip
    return Document(
        title=words("comparison.title"),
        record=record,
        head=_head(found.source, found, words),
        headline=_headline(found.verdict, whole_lines(found, words), words),
        results=[results],
        annexes=[why, _origin(_inputs(found.origins), words)],
        notes=notes_in(found.notes, words),
    )


def mountings_document(found: Mountings, writer: Writer, record: str) -> Document:
    """Return the report of targets against their wheels."""
    words = writer.words
    results = Section(
        "results",
        words("section.results"),
        [mountings_table(found, writer), words("mounting.signs"), *scatter_lines(found, words),
         *not_both(found, words)],
    )  # fmt: skip
    return Document(
        title=words("mounting.title"),
        record=record,
        head=[(words("comparison.capture"), found.source),
              (words("comparison.difference_is"), words("mounting.value"))],
        headline=None,
        results=[results],
        annexes=[_origin(_inputs(found.origins), words)],
        notes=notes_in(found.notes, words),
    )  # fmt: skip


def study_document(study: ComparisonStudy, writer: Writer, record: str) -> Document:
    """Return the report of many captures."""
    words, found = writer.words, study.found
    first, second = labels(found[0], words)
    results = Section(
        "results",
        words("section.results"),
        [words("study.compared", compared=len(found), total=len(study.rows)),
         *not_compared(study, words), captures_table(study, writer)],
    )  # fmt: skip
    annexes = []
    for one in study.agreements:
        lines = agreement_lines(one, study.to_detect_rad or SETTLED_RAD, writer)
        parts: list[Part] = [
            agreement_table(one, writer), *lines,
            bland_altman_drawing(one, first, second, words),
            line_drawing(one, first, second, words),
        ]  # fmt: skip
        annexes.append(Section(one.kind, writer.quantity(one.kind).capitalize(), parts))
    scored: list[Part] = [scores_table(study, writer), nees_line(study, words)]
    annexes.append(Section("coverage", words("section.uncertainty"), scored))
    inputs = {
        f"{row.name}: {name}": digest
        for row in study.rows
        if row.found is not None
        for name, digest in _inputs(row.found.origins).items()
    }
    return Document(
        title=words("comparison.title"),
        record=record,
        head=_head(study.source, found[0], words),
        headline=_headline(study.verdict, verdict_lines(study, words), words),
        results=[results],
        annexes=[*annexes, _origin(inputs, words)],
        notes=notes_in(shared_notes(study, words), words),
    )


def _head(source: str, found: Comparison, words: Translations) -> Pairs:
    first, second = labels(found, words)
    return [
        (words("comparison.capture"), source),
        (words("comparison.methods"), words("comparison.against", first=first, second=second)),
        (words("comparison.difference_is"), words("comparison.less", first=first, second=second)),
    ]


def _headline(verdict: str, lines: Sequence[str], words: Translations) -> Headline:
    decision = KINDS.get(verdict, "undecided")
    title = agreed(verdict, words)
    shown = title[:1].upper() + title[1:]
    return Headline(decision.replace(" ", "-"), SIGNS[decision], shown, tuple(lines))


def _inputs(origins: Sequence[Provenance]) -> dict[str, str]:
    """Return the digest of each input file by its name, without its capture and folder."""
    return {
        PurePath(name.rpartition(": ")[2]).name: digest
        for origin in origins
        for name, digest in origin.inputs.items()
    }


def _origin(inputs: Mapping[str, str], words: Translations) -> Section:
    rows = [[name, digest.removeprefix("sha256:")] for name, digest in inputs.items()]
    head = (words("origin.file"), words("origin.digest"))
    files = Table(head, rows, 2, words("origin.inputs"))
    return Section("origin", words("section.origin"), [words("origin.only_compared"), files])
