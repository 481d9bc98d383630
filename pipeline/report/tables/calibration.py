"""Tables of a calibration: points, budgets, what each quantity shows, gauge R&R, adjustments."""

from __future__ import annotations

import math
import re

from ...calibration import (
    QUANTITIES,
    Adjustment,
    Calibration,
    CalibrationPoint,
    GaugeRR,
    ItemQuantity,
    QuantityResult,
)
from ...errors import Wording
from ...measurement import Estimate
from ..format.digits import rounded
from ..format.language import Translations
from ..format.writer import Columns, Table, Writer
from .conformity import decided

NOTED = 0.5  # share of a rectangle in u from which k of 1.96 becomes 1.95 or less
STATES = {"as found": "found", "as left": "left"}


def title(result: QuantityResult, words: Translations) -> str:
    """Return the quantity, and whether as found or as left."""
    state = words(f"calibration.{STATES[result.state]}")
    return f"{quantity(result.quantity, words)}, {state}"


def quantity(kind: str, words: Translations) -> str:
    """Return the name of a machine's quantity."""
    return words(f"calibration.quantity_{kind}")


def point_name(point: str, kind: str, words: Translations) -> str:
    """Return the name of a point: of a wheel, an axle, the vehicle or a turn; else its own."""
    if QUANTITIES[kind].subject == "wheel":
        return words.wheel(point)
    return words.texts.get(f"calibration.at_{point}", point)


def declared(result: QuantityResult, writer: Writer) -> str:
    """Return in words what the item declares of a quantity."""
    words, stated = writer.words, result.declared
    parts = [words("calibration.resolution_of", value=words.number(stated.resolution))]
    parts += [words(f"calibration.{name}", value=value) for name, value in _given(stated, words)]
    if result.in_place:
        points = ", ".join(point_name(one, result.quantity, words) for one in result.in_place)
        parts.append(words("calibration.in_place", points=points))
    if result.vertical is not None:
        parts.append(words(f"calibration.measured_from_{result.vertical}"))
    return "; ".join(parts)


def _given(stated: ItemQuantity, words: Translations) -> list[tuple[str, str]]:
    sense = (stated.positive or "").replace("-", "_")
    found = [
        ("positive_is", stated.positive and words(f"calibration.sense_{sense}")),
        ("from_axis", stated.axis and words.known("axis", stated.axis)),
        ("defined", stated.definition and words(f"calibration.camber_{stated.definition}")),
        ("inner", stated.inner_deg and words.number(f"{stated.inner_deg:g}°")),
        ("mpe_of", stated.mpe and words.number(f"±{stated.mpe}")),
        ("own_u", stated.uncertainty and words.number(stated.uncertainty)),
    ]
    return [(name, str(value)) for name, value in found if value]


def points_table(result: QuantityResult, writer: Writer) -> Table:
    """Return a row for each point: reference, reading, error, U, En, verdict and its risk."""
    words = writer.words
    limited = any(point.verdict is not None for point in result.points)
    compared = any(point.en is not None for point in result.points)
    columns: Columns = (
        *(words(f"calibration.{name}")
          for name in ("point", "reference", "reference_u", "reading", "error")),
        "u", "k", "U", "s", "n",
        *(["En"] if compared else []),
        *([words("verdict.decision"), "P", words("verdict.risk")] if limited else []),
    )  # fmt: skip
    rows = [_row(point, writer, compared, limited) for point in result.points]
    return writer.table(columns, rows, 1, title(result, words))


def _row(point: CalibrationPoint, writer: Writer, compared: bool, limited: bool) -> list[str]:
    unit, words, error = point.unit, writer.words, point.error
    finest = error.expanded
    row = [
        point_name(point.point, point.quantity, words),
        writer.number(point.reference.value, unit, finest),
        writer.size(point.reference.expanded, unit),
        writer.number(point.reading, unit, finest),
        signed(error, point, writer),
        writer.size(error.u, unit),
        _factor(error, words),
        writer.size(finest, unit),
        writer.size(point.repeatability, unit),
        str(point.n),
    ]
    if compared:
        row.append(writer.none if point.en is None else words.number(f"{point.en:.2f}"))
    if limited:
        row += _decided(point, writer)
    return row


def _decided(point: CalibrationPoint, writer: Writer) -> list[str]:
    if point.verdict is None:
        return [writer.none] * 3
    word = decided(point.verdict.decision, writer.words).lower()
    return [word, writer.share(point.verdict.probability), writer.share(point.verdict.risk)]


def _factor(error: Estimate, words: Translations) -> str:
    return words.number(f"{error.expanded / error.u:.2f}") if error.u > 0.0 else "-"


def signed(
    error: Estimate, point: CalibrationPoint | QuantityResult | Adjustment, writer: Writer
) -> str:
    """Write an error with its sign, to the place of its U; one that rounds to zero has none."""
    write = writer.millimetres if point.unit == "m" else writer.arc
    text = write(error.value, error.expanded, "+")
    return text if re.search("[1-9]", text) else text.removeprefix("+")


def budget_table(result: QuantityResult, writer: Writer) -> Table:
    """Return the budget of the point of the largest u: a row for each contribution."""
    words = writer.words
    point = max(result.points, key=lambda one: one.error.u)
    rows = [
        [
            words(f"calibration.{line.origin}"),
            _cause(line.name, words),
            writer.size(line.u, point.unit),
            _dof(line.dof, writer),
            writer.share((line.u / point.error.u) ** 2),
        ]
        for line in point.budget
    ]
    rows.append([words("calibration.sum"), "", writer.size(point.error.u, point.unit),
                 _dof(point.error.dof, writer), ""])  # fmt: skip
    columns = (words("calibration.origin"), words("calibration.component"), "u",
               words("calibration.dof"), words("calibration.share"))  # fmt: skip
    caption = words("calibration.budget", point=point_name(point.point, point.quantity, words))
    return writer.table(columns, rows, 2, caption)


def _cause(name: str, words: Translations) -> str:
    key = f"calibration.cause_{name}"
    return words(key) if key in words.texts else words.known("cause", name)


def _dof(dof: float, writer: Writer) -> str:
    return writer.words.number(f"{dof:.0f}") if dof < 1e4 else _unlimited(writer)


def _unlimited(writer: Writer) -> str:
    return "inf" if writer.plain else "∞"


def shown_lines(result: QuantityResult, writer: Writer) -> list[str]:
    """Return in words zero error, sensitivity, linearity, hysteresis and the two scatters."""
    words, line, unit = writer.words, result.characteristic, result.unit
    lines = [_stated("zero", line.zero, result, writer)]
    if line.sensitivity is None:
        lines[0] = _stated("mean", line.zero, result, writer)
    else:
        place = math.floor(math.log10(max(line.sensitivity.expanded, 1e-9))) - 1
        value = rounded(line.sensitivity.value, place, "")
        spread = rounded(line.sensitivity.expanded, place, "")
        parts = {"value": words.number(value), "expanded": words.number(spread),
                 "k": _factor(line.sensitivity, words)}  # fmt: skip
        lines.append(words("calibration.sensitivity", **parts))
    if line.linearity is not None:
        lines.append(
            _stated(
                "linearity",
                line.linearity,
                result,
                writer,
                point=point_name(line.worst_point, result.quantity, words),
            )
        )
    if line.fits is not None:
        lines.append(words("calibration.fits", probability=writer.share(line.fits)))
    if result.hysteresis is not None:
        lines.append(_stated("hysteresis", result.hysteresis, result, writer))
    lines += _rectangles(result, writer)
    lines += remarks(result, writer)
    size, dof = writer.size(result.repeatability, unit), result.dof_repeatability
    lines.append(words("calibration.repeatability", value=size, dof=dof))
    if result.reproducibility is not None:
        size = writer.size(result.reproducibility, unit)
        levels = "; ".join(result.levels)
        lines.append(words("calibration.reproducibility", value=size, levels=levels))
    return lines


def remarks(result: QuantityResult, writer: Writer) -> list[str]:
    """Return in words a coarser step than declared, points left out, and points without reading."""
    words = writer.words
    lines = []
    if result.coarser is not None:
        lines.append(words("calibration.coarser", step=writer.size(result.coarser, result.unit)))
    if result.finer is not None:
        lines.append(words("calibration.finer", step=writer.size(result.finer, result.unit)))
    for key, names in (("left_out", result.left_out), ("unread", result.unread)):
        if names:
            points = ", ".join(point_name(one, result.quantity, words) for one in names)
            lines.append(words(f"calibration.{key}", points=points))
    return lines


def _stated(
    key: str, known: Estimate, result: QuantityResult, writer: Writer, **parts: object
) -> str:
    value, expanded = signed(known, result, writer), writer.size(known.expanded, result.unit)
    k = _factor(known, writer.words)
    return writer.words(f"calibration.{key}", value=value, expanded=expanded, k=k, **parts)


def _rectangles(result: QuantityResult, writer: Writer) -> list[str]:
    """Return in words why k is less than Student's t: at the point of the largest rectangle."""
    point = max(result.points, key=lambda one: one.error.uniform)
    name = point_name(point.point, result.quantity, writer.words)
    found = [("rectangle", point.error), ("rectangle_hysteresis", result.hysteresis)]
    return [
        writer.words(
            f"calibration.{key}",
            k=_factor(known, writer.words),
            share=writer.share(known.uniform**2),
            point=name,
        )
        for key, known in found
        if known is not None and known.uniform > NOTED
    ]


def anova_table(study: GaugeRR, result: QuantityResult, writer: Writer) -> Table:
    """Return the analysis of variance; squares in minutes of arc or millimetres, squared."""
    words = writer.words
    scale = (math.degrees(60.0) if result.unit == "rad" else 1e3) ** 2
    rows = [
        [
            words.known("calibration", f"anova {row.source}"),
            str(row.dof),
            words.number(f"{row.sum_of_squares * scale:.4g}"),
            words.number(f"{row.mean_square * scale:.4g}") if row.source != "total" else "",
            "" if row.f is None else words.number(f"{row.f:.2f}"),
            "" if row.p is None else words.number(f"{row.p:.2g}"),
        ]
        for row in study.rows
    ]
    unit = "'" if result.unit == "rad" else "mm"
    squares = (words(f"calibration.{mean}", unit=unit) for mean in ("ss", "ms"))
    head = (words("calibration.source"), words("calibration.dof"), *squares, "F", "p")
    return writer.table(head, rows, 1, words("calibration.anova"))


def gauge_rr_table(study: GaugeRR, result: QuantityResult, writer: Writer) -> Table:
    """Return the variation of equipment, appraisers and parts, and their share of the total."""
    words = writer.words
    parts = (("ev", study.ev), ("av", study.av), ("int", study.interaction), ("grr", study.grr),
             ("pv", study.pv), ("tv", study.tv))  # fmt: skip
    rows = [
        [
            words(f"calibration.grr_{name}"),
            writer.size(size, result.unit),
            words.number(f"{100.0 * size / study.tv:.1f} %") if study.tv else writer.none,
            words.number(f"{100.0 * (size / study.tv) ** 2:.1f} %") if study.tv else writer.none,
        ]
        for name, size in parts
    ]
    head = (words("calibration.variation"), "s", words("calibration.of_total"),
            words("calibration.contribution"))  # fmt: skip
    number = study.distinct_categories
    ndc = _unlimited(writer) if number is None else number
    return writer.table(head, rows, 1, words("calibration.grr", ndc=ndc))


def adjustments_table(found: Calibration, writer: Writer) -> Table:
    """Return the errors as found and as left, and their change."""
    words = writer.words
    rows = [
        [
            quantity(one.quantity, words),
            point_name(one.point, one.quantity, words),
            *(signed(known, one, writer) for known in (one.found, one.left, one.change)),
            writer.size(one.change.expanded, one.unit),
        ]
        for one in found.adjustments
    ]
    head = (words("calibration.of"), words("calibration.point"), words("calibration.found"),
            words("calibration.left"), words("front.change"), "U")  # fmt: skip
    return writer.table(head, rows, 2, words("calibration.adjustments"))


def as_found(found: Calibration, words: Translations) -> list[str]:
    """Return sentences on the verdict before the adjustment; none where nothing was adjusted."""
    before = found.decision_as_found
    if before is None:
        return []
    return [
        words("calibration.found_says", found=decided(before, words).lower()),
        *not_read_again(found, words),
    ]


def not_read_again(found: Calibration, words: Translations) -> list[str]:
    """Return a sentence on the points that were not read again as left; none without one."""
    points = [
        f"{quantity(one.quantity, words)} {point_name(one.point, one.quantity, words)}"
        for one in found.not_read_again
    ]
    return [words("calibration.not_read_again", points=", ".join(points))] if points else []


def rule_words(found: Calibration, words: Translations) -> str:
    """Return the decision rule in words."""
    rule = found.rule
    if rule is None:
        return words("calibration.no_rule")
    parts = {
        "confidence": words.number(f"{rule.confidence:g}"),
        "ratio": words.number(f"{rule.ratio:g}"),
    }
    return f"{words('verdict.rule')}: {words(f'calibration.rule_{rule.rule}', **parts)}"


def reasons(result: QuantityResult, writer: Writer) -> list[str]:
    """Return why points are undecided, points of one reason together."""
    words = writer.words
    found: dict[str, list[str]] = {}
    for point in result.points:
        verdict = point.verdict
        if verdict is not None and verdict.decision == "undecided":
            key = "undecidable" if verdict.guard_band is None else "near"
            text = words("verdict.in_doubt" if point.doubts else f"calibration.{key}")
            if isinstance(verdict.reason, Wording) and not point.doubts:
                parts = {k: words.number(str(v)) for k, v in verdict.reason.parts.items()}
                text = words("fault.below_ratio", **parts)
            name = point_name(point.point, point.quantity, words)
            found.setdefault(text, []).append(name)
    return [f"{', '.join(names)}: {text}" for text, names in found.items()]
