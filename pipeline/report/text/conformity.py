"""Verdicts as plain text."""

from __future__ import annotations

from ...measurement import Conformity
from ..format.layout import paragraph
from ..format.view import PAPER, View
from ..tables.conformity import (
    decided,
    doubted,
    joint,
    limits_table,
    notes,
    quantity,
    reason,
    rule,
    subject,
)
from .plain import plain_writer


def conformity_text(conformity: Conformity, view: View = PAPER) -> str:
    """Return the verdict, the rule, a row a quantity, and why what is undecided is so."""
    writer = plain_writer(view)
    words = writer.words
    title = " ".join(conformity.tolerance.title.split())
    verdict = decided(conformity.decision, words).upper()
    return "\n".join(
        [
            f"Verdict: {verdict}" + (f" ({title})" if title else ""),
            *doubted(conformity.doubts, words),
            paragraph(rule(conformity, words)),
            limits_table(conformity, writer).text(),
            *(
                f"  {subject(v, writer)} {quantity(v.quantity, writer)}: {reason(v, writer)}"
                for v in conformity.verdicts
                if v.reason and not v.quantity.doubts
            ),
            joint(conformity, writer),
            paragraph(notes(conformity, writer)),
        ]
    )
