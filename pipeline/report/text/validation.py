"""A comparison of two methods, on one capture or on many, as text."""

from __future__ import annotations

from ...validation import Comparison, ComparisonStudy, Mountings
from ..format.layout import paragraph
from ..format.view import PAPER, View
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
from .plain import plain_writer


def validation_text(found: Comparison, view: View = PAPER) -> str:
    """Differences and verdicts, what was seen, and why the methods differ."""
    writer = plain_writer(view)
    words = writer.words
    first, second = labels(found, words)
    verdict, *others = whole_lines(found, words)
    planes = joint_words(found.planes.test(found.planes_rad), words)
    shape = joint_words(found.shape_test, words)
    parts = [
        words("comparison.of", source=found.source, first=first, second=second),
        *found.notes,
        *missing_lines(found, words),
        "",
        differences_table(found, writer).text(),
        "",
        paragraph(words("comparison.signs")),
        "",
        words("comparison.verdict_is", verdict=agreed(found.verdict, words), text=verdict),
        *others,
        "",
        words("comparison.why"),
        causes_table(found, writer).text(),
        f"  {words('comparison.planes', test=planes)}",
        "",
        words("comparison.shape"),
        shape_table(found, writer).text(),
        f"  {words('comparison.shape_together', test=shape)}",
    ]
    return "\n".join(parts) + "\n"


def mountings_text(found: Mountings, view: View = PAPER) -> str:
    """Offsets of each target from its wheel, and what they show together."""
    writer = plain_writer(view)
    words = writer.words
    parts = [
        words("mounting.of", source=found.source),
        *found.notes,
        *not_both(found, words),
        "",
        mountings_table(found, writer).text(),
        "",
        paragraph(words("mounting.signs")),
        *scatter_lines(found, words),
    ]
    return "\n".join(parts) + "\n"


def survey_text(study: ComparisonStudy, view: View = PAPER) -> str:
    """Rows, bias and limits of agreement, the line, and what more captures would settle."""
    writer = plain_writer(view)
    words = writer.words
    first, second = labels(study.found[0], words)
    verdict, bias, alone, *others = verdict_lines(study, words)
    parts = [
        words("comparison.of", source=study.source, first=first, second=second),
        words("study.compared", compared=len(study.found), total=len(study.rows)),
        *shared_notes(study, words),
        *not_compared(study, words),
        "",
        captures_table(study, writer).text(),
        "",
        words("comparison.verdict_is", verdict=agreed(study.verdict, words), text=verdict),
        f"  {bias}",
        f"  {alone}",
        *others,
    ]
    for one in study.agreements:
        table = agreement_table(one, writer)
        lines = agreement_lines(one, study.to_detect_rad or SETTLED_RAD, writer)
        parts += ["", table.caption, table.text(), *(f"  {line}" for line in lines)]
    scores = scores_table(study, writer)
    parts += ["", scores.caption, scores.text(), f"  {nees_line(study, words)}"]
    return "\n".join(parts) + "\n"
