"""A calibration as plain text."""

from __future__ import annotations

from ...calibration import Calibration, QuantityResult
from ..format.layout import paragraph
from ..format.view import PAPER, View
from ..format.writer import Table, Writer
from ..tables.calibration import (
    adjustments_table,
    anova_table,
    budget_table,
    declared,
    gauge_rr_table,
    not_read_again,
    points_table,
    reasons,
    rule_words,
    shown_lines,
)
from ..tables.conformity import decided, doubted
from .plain import plain_writer


def calibration_text(found: Calibration, view: View = PAPER) -> str:
    """Return item, verdict, notes, and of each quantity points, budget and characteristics."""
    writer = plain_writer(view)
    words, item = writer.words, found.item
    parts = [
        words("calibration.item", maker=item.maker, model=item.model, serial=item.serial,
              software=item.software),
        *(words("calibration.from", source=one.provenance.source,
                date=one.provenance.date or words("front.undated"))
          for one in found.references),
        words("calibration.readings_of", source=found.readings.source,
              count=len(found.readings.rows)),
    ]  # fmt: skip
    if found.decision is not None:
        verdict = decided(found.decision, words).upper()
        before = found.decision_as_found
        if before is not None:
            was = decided(before, words).upper()
            verdict = words("calibration.verdict_left", left=verdict, found=was)
        parts += ["", words("calibration.verdict", verdict=verdict)]
        parts += map(paragraph, not_read_again(found, words))
    parts += [paragraph(rule_words(found, words)), paragraph(words("calibration.signs"))]
    parts += [paragraph(words("calibration.warning", text=text)) for text in found.warnings]
    parts += map(paragraph, doubted(found.doubts, words))
    parts += [paragraph(note) for note in found.notes if note not in found.doubts]
    for result in found.results:
        parts += ["", *_quantity(result, writer)]
    if found.adjustments:
        parts += ["", *_whole(adjustments_table(found, writer))]
    parts += ["", paragraph(words("calibration.columns"))]
    text = "\n".join(parts) + "\n"
    return text.encode(errors="backslashreplace").decode()


def _quantity(result: QuantityResult, writer: Writer) -> list[str]:
    lines = [
        *_whole(points_table(result, writer)),
        f"  {declared(result, writer)}",
        *(f"  {line}" for line in reasons(result, writer)),
        *(f"  {line}" for line in shown_lines(result, writer)),
        *(f"  {line}" for line in result.notes),
        *_whole(budget_table(result, writer)),
    ]
    if result.gauge_rr is not None:
        lines += _whole(anova_table(result.gauge_rr, result, writer))
        lines += _whole(gauge_rr_table(result.gauge_rr, result, writer))
    return lines


def _whole(table: Table) -> list[str]:
    return [table.caption, table.text()]
