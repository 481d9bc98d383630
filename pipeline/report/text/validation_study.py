"""A comparison of two methods over many captures, as text."""

from __future__ import annotations

import math

from ...measurement import Estimate
from ...validation import EACH, Agreement, ComparisonStudy, Limit, Line, Row, nees, scores
from ..format.digits import decimal
from ..format.layout import aligned
from ..format.view import PAPER, View
from ..format.writer import Writer
from .plain import plain_writer
from .validation import degrees

MOST_NOTES = 5
NEES_MEANS = {
    "within": "within",
    "above": "above, so the stated uncertainties are too small, or the methods differ",
    "below": "below, so the stated uncertainties are too large",
}
SETTLED_RAD = math.radians(0.1)  # a bias of this size is settled, where no other is named


def survey_text(survey: ComparisonStudy, view: View = PAPER) -> str:
    """Rows, bias and limits of agreement, the line, and what more captures would settle."""
    writer = plain_writer(view)
    first, second = (m.label for m in (survey.found[0].first, survey.found[0].second))
    parts = [
        f"{survey.source}: {first} against {second}; difference = {first} less {second}",
        f"{len(survey.found)} of {len(survey.rows)} captures compared.",
        *_shared_notes(survey),
        *_not_compared(survey),
        "",
        _captures(survey),
        "",
        *_verdict(survey),
    ]
    for one in survey.agreements:
        parts += ["", *_agreement(one, survey.to_detect_rad or SETTLED_RAD, writer)]
    parts += ["", scores_text(survey, writer)]
    return "\n".join(parts) + "\n"


def scores_text(survey: ComparisonStudy, writer: Writer) -> str:
    """Errors over all captures, and whether the stated uncertainties hold."""
    rows: list[tuple[str, ...]] = [
        ("", "angles", "bias", "rms", "worst", "inside 95 %", "its 95 % limits")
    ]
    for score in scores(survey.found):
        limits = f"{score.low:.1%} - {score.high:.1%}"
        share = f"{score.inside / score.count:.1%}"
        bias = Estimate(score.bias, score.rms / math.sqrt(score.count))
        rows.append(
            (
                score.kind,
                str(score.count),
                writer.number(bias.value, "rad", bias.expanded),
                writer.size(score.rms, "rad"),
                writer.number(score.worst, "rad", score.rms),
                share,
                limits,
            )
        )
    whole = nees(survey.found)
    title = "All differences, each against its own stated uncertainty"
    return "\n".join(
        [
            title,
            aligned(rows, left=1),
            f"  Mean of d'V^-1 d an angle (NEES): {whole.mean:.3f}; right uncertainties give "
            f"{whole.low:.3f} - {whole.high:.3f} in 95 %: {NEES_MEANS[whole.position]}.",
        ]
    )


def _shared_notes(survey: ComparisonStudy) -> list[str]:
    """Return notes of the captures, each text once; where there are many, how many more."""
    notes = list(dict.fromkeys(note for one in survey.found for note in one.notes))
    more = len(notes) - MOST_NOTES
    return notes[:MOST_NOTES] + ([f"... and {more} more notes in --json."] if more > 0 else [])


def _not_compared(survey: ComparisonStudy) -> list[str]:
    """Return what could not be compared, and why: whole captures, and wheels of them."""
    lines = [f"Not compared: {row.name}: {row.reason}" for row in survey.rows if row.found is None]
    return lines + [
        f"Not compared: {row.name}: {name}: {reason}"
        for row in survey.rows
        if row.found is not None
        for name, reason in row.found.missing
    ]


def _captures(survey: ComparisonStudy) -> str:
    rows: list[tuple[str, ...]] = [("capture", "wheels", "chi-square", "of", "p", "verdict")]
    rows += [_capture(row) for row in survey.rows]
    return aligned(rows, left=1)


def _capture(row: Row) -> tuple[str, ...]:
    one = row.found
    if one is None:
        return (row.name, "-", "-", "-", "-", "not compared")
    test = one.joint
    return (
        row.name,
        str(len(one.names)),
        f"{test.chi_square:.1f}",
        str(test.count),
        f"{test.probability:.3g}",
        one.verdict,
    )


def _verdict(survey: ComparisonStudy) -> list[str]:
    count, probability = len(survey.found), survey.bias_probability
    bias = "needs four captures" if probability is None else f"p = {probability:.3g}"
    lines = [
        f"Verdict: {survey.verdict}. Two tests, each at {1 - EACH:.2%}:",
        f"  bias of toe and camber together (Hotelling's T2 of the captures' means): {bias};",
        f"  captures that disagree alone: {survey.disagreeing} of {count}, 5 % are expected, "
        f"as many or more by p = {survey.chance_of_disagreeing:.3g}.",
    ]
    if survey.to_detect_rad is not None and survey.detectable_rad > survey.to_detect_rad:
        lines.append(
            f"A bias of {degrees(survey.to_detect_rad)} would not be seen by so few captures: "
            "see below."
        )
    return lines


def _agreement(one: Agreement, size_rad: float, writer: Writer) -> list[str]:
    rows: list[tuple[str, ...]] = [
        ("", "value", "95 % limits", ""),
        ("bias", *_limit(one.bias, writer)),
        ("lower limit of agreement", *_limit(one.lower, writer)),
        ("upper limit of agreement", *_limit(one.upper, writer)),
    ]
    size = writer.size
    lines = [
        f"{one.kind.capitalize()}, Bland-Altman: {len(one.first)} differences of {one.subjects} "
        f"wheels, {one.units} independent captures or vehicles",
        aligned(rows, left=1),
        f"  Standard deviations: {size(one.total, 'rad')} of a difference; "
        f"{size(one.between, 'rad')} between wheels, {size(one.within, 'rad')} within (repeated "
        "measures)",
        f"  These captures would see a bias of {degrees(one.detectable)} (95 % confidence, 99 % "
        f"power); one of {degrees(size_rad)} takes {one.captures_for(size_rad)} captures, "
        "if they scatter as much as these can (95 %).",
    ]
    if one.line is not None:
        lines.append(_line(one.line, writer))
    return lines


def _line(line: Line, writer: Writer) -> str:
    intercept = Estimate(line.intercept, line.u_intercept)
    slope = Estimate(line.slope, line.u_slope)
    widths = map(writer.view.known, (slope.expanded, slope.u))
    texts = [
        decimal(x, wide, 5, "") for x, wide in zip((slope.value, slope.u), widths, strict=True)
    ]
    return (
        f"  Line (York): second = {writer.number(intercept.value, 'rad', intercept.expanded)} "
        f"(u {writer.size(intercept.u, 'rad')}) + {texts[0]} (u {texts[1]}) x first; "
        f"chi-square {line.chi_square:.1f} of {line.dof}, p = {line.probability:.3g}"
    )


def _limit(limit: Limit, writer: Writer) -> tuple[str, str, str]:
    """Write a value and its confidence limits to the place of half their distance."""
    values = (limit.value, limit.low, limit.high)
    low, middle, high = (writer.number(x, "rad", (limit.high - limit.low) / 2.0) for x in values)
    return low, middle, high
