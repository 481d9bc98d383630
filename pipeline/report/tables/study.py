"""A comparison of two methods over many captures: verdicts, agreement, coverage."""

from __future__ import annotations

import math

from ...measurement import Estimate
from ...validation import EACH, Agreement, ComparisonStudy, Limit, Row, nees, scores
from ..format.digits import decimal
from ..format.language import Translations
from ..format.writer import Column, Table, Writer
from .comparison import CLASSES, agreed, degrees

MOST_NOTES = 5
SETTLED_RAD = math.radians(0.1)  # a bias of this size is settled, where no other is named


def captures_table(study: ComparisonStudy, writer: Writer) -> Table:
    """Return the joint test of each capture."""
    words = writer.words
    rows = [_capture(row, writer) for row in study.rows]
    verdicts = (row.found.verdict if row.found else "" for row in study.rows)
    columns = (words("study.capture"), words("study.wheels"), words("study.chi_square"),
               words("study.of"), "p", words("comparison.verdict"))  # fmt: skip
    classes = [CLASSES.get(verdict, "undecided") for verdict in verdicts]
    return writer.table(columns, rows, 1, words("study.captures"), classes)


def _capture(row: Row, writer: Writer) -> list[str]:
    words, one = writer.words, row.found
    if one is None:
        return [row.name, *[writer.none] * 4, words("study.not_compared")]
    test = one.joint
    return [
        row.name,
        str(len(one.names)),
        words.number(f"{test.chi_square:.1f}"),
        str(test.count),
        words.number(f"{test.probability:.3g}"),
        agreed(one.verdict, words),
    ]


def verdict_lines(study: ComparisonStudy, words: Translations) -> list[str]:
    """Return the two tests, whether so few captures suffice, and which are in doubt."""
    count, probability = len(study.found), study.bias_probability
    units = study.agreements[0].units if study.agreements else count
    key = "bias_needs" if units == count else "bias_needs_vehicles"
    bias = words(f"study.{key}", units=units)
    if probability is not None:
        bias = words.number(f"p = {probability:.3g}")
    p = words.number(f"{study.chance_of_disagreeing:.3g}")
    lines = [
        words("study.tests", level=words.number(f"{1 - EACH:.2%}")),
        words("study.bias_test", bias=bias),
        words("study.alone", disagreeing=study.disagreeing, count=count, p=p),
    ]
    if study.to_detect_rad is not None and study.detectable_rad > study.to_detect_rad:
        lines.append(words("study.bias_unseen", size=degrees(study.to_detect_rad, words)))
    if study.in_doubt:
        lines.append(words("study.in_doubt", names=", ".join(study.in_doubt)))
    return lines


def agreement_table(one: Agreement, writer: Writer) -> Table:
    """Return bias and limits of agreement with their confidence limits."""
    words = writer.words
    rows = [
        [words(f"study.{name}"), *_limit(limit, writer)]
        for name, limit in (("bias", one.bias), ("lower", one.lower), ("upper", one.upper))
    ]
    caption = words(
        "study.agreement",
        kind=writer.quantity(one.kind).capitalize(),
        count=len(one.first),
        subjects=one.subjects,
        units=one.units,
    )
    columns = (Column("", quiet=True), words("vehicle.value"), words("study.limits"), "")
    return writer.table(columns, rows, 1, caption)


def agreement_lines(one: Agreement, size_rad: float, writer: Writer) -> list[str]:
    """Return what scatters, what would be seen, and the fitted line."""
    words = writer.words
    total, between, within = (writer.size(x, "rad") for x in (one.total, one.between, one.within))
    lines = [
        words("study.deviations", total=total, between=between, within=within),
        words(
            "study.visible_vehicles" if one.by_vehicle else "study.visible",
            size=degrees(one.detectable, words),
            other=degrees(size_rad, words),
            count=one.units_for(size_rad),
        ),
    ]
    return [*lines, _line(one, writer)] if one.line is not None else lines


def _line(one: Agreement, writer: Writer) -> str:
    line, words, known = one.line, writer.words, writer.view.known
    assert line is not None
    intercept = Estimate(line.intercept, line.u_intercept)
    slope = Estimate(line.slope, line.u_slope)
    return words(
        "study.line",
        intercept=writer.number(intercept.value, "rad", intercept.expanded),
        u_intercept=writer.size(intercept.u, "rad"),
        slope=words.number(decimal(slope.value, known(slope.expanded), 5, "")),
        u_slope=words.number(decimal(slope.u, known(slope.u), 5, "")),
        chi_square=words.number(f"{line.chi_square:.1f}"),
        dof=line.dof,
        p=words.number(f"{line.probability:.3g}"),
    )


def _limit(limit: Limit, writer: Writer) -> list[str]:
    """Write a value and its confidence limits to the place of half their distance."""
    half = (limit.high - limit.low) / 2.0
    return [writer.number(x, "rad", half) for x in (limit.value, limit.low, limit.high)]


def scores_table(study: ComparisonStudy, writer: Writer) -> Table:
    """Return errors over all captures, and whether the stated uncertainties hold."""
    words, rows = writer.words, []
    for score in scores(study.found):
        share = score.inside / score.count
        bias = Estimate(score.bias, score.rms / math.sqrt(score.count))
        limits = f"{score.low:.1%} - {score.high:.1%}"
        rows.append([
            writer.quantity(score.kind), str(score.count),
            writer.number(bias.value, "rad", bias.expanded), writer.size(score.rms, "rad"),
            writer.number(score.worst, "rad", score.rms),
            words.number(f"{share:.1%}"), words.number(limits),
        ])  # fmt: skip
    columns = (Column("", quiet=True), words("study.angles"), words("study.bias"),
               words("study.rms"), words("study.worst"), words("study.inside"),
               words("study.inside_limits"))  # fmt: skip
    return writer.table(columns, rows, 1, words("study.scores"))


def nees_line(study: ComparisonStudy, words: Translations) -> str:
    """Return the mean normalised squared error, and what it means."""
    whole = nees(study.found)
    mean, low, high = (words.number(f"{x:.3f}") for x in (whole.mean, whole.low, whole.high))
    means = words(f"study.nees_{whole.position}")
    return words("study.nees", mean=mean, low=low, high=high, means=means)


def shared_notes(study: ComparisonStudy, words: Translations) -> list[str]:
    """Return notes of the captures, each text once; where there are many, how many more."""
    notes = list(dict.fromkeys(note for one in study.found for note in one.notes))
    more = len(notes) - MOST_NOTES
    return notes[:MOST_NOTES] + ([words("study.more_notes", more=more)] if more > 0 else [])


def not_compared(study: ComparisonStudy, words: Translations) -> list[str]:
    """Return what could not be compared, and why: whole captures, and wheels of them."""
    lines = [
        words("comparison.not_compared", name=row.name, reason=row.reason)
        for row in study.rows
        if row.found is None
    ]
    for row in study.rows:
        for name, reason in row.found.missing if row.found else ():
            text = words("comparison.not_compared", name=f"{row.name}: {name}", reason=reason)
            lines.append(text)
    return lines
