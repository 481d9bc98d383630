"""A comparison of two methods on one capture: differences, their causes, the centres' shape."""

from __future__ import annotations

import math

import numpy as np

from ...validation import KINDS, Comparison, JointTest, Spread
from ...vectors import Array
from ..format.language import Translations
from ..format.writer import Column, Columns, Table, Writer
from .conformity import doubted

CLASSES = {"agree": "conform", "disagree": "not-conform"}
# Names of the quantities of `validation.SHAPE`, and their units.
SHAPES = (("rear_track", "m"), ("front_track", "m"), ("wheelbase", "m"),
          ("offset", "m"), ("direction", "rad"), ("twist", "rad"))  # fmt: skip


def labels(found: Comparison, words: Translations) -> tuple[str, str]:
    """Return the names of both methods; of a file, its own."""
    return method_label(found.first.label, words), method_label(found.second.label, words)


def method_label(label: str, words: Translations) -> str:
    """Return the name of a method, with what follows its comma."""
    name, comma, rest = label.partition(",")
    key = name.replace(" ", "_")
    return words.texts.get(f"method_label.{key}", name) + comma + rest


def agreed(verdict: str, words: Translations) -> str:
    """Return the verdict on a comparison in a word."""
    return words.known("agreement", verdict)


def joint_words(test: JointTest, words: Translations) -> str:
    """Return a joint test in a few words."""
    p = words.number(f"{test.probability:.3g}")
    chi_square = words.number(f"{test.chi_square:.1f}")
    text = words("comparison.test", chi_square=chi_square, count=test.count, p=p)
    if test.dof > 1e4:
        return text
    return words("comparison.test_dof", test=text, dof=f"{test.dof:.0f}")


def degrees(angle_rad: float, words: Translations) -> str:
    """Write a detectable size in decimal degrees."""
    if not math.isfinite(angle_rad):
        return words("comparison.no_size")
    return words.number(f"{math.degrees(angle_rad):.3g}°")


def coverage_factors(spread: Spread) -> Array:
    """(q,) U over u of each difference, for values of which u alone is known; 0 where u is 0."""
    return np.divide(spread.expanded, spread.u, out=np.zeros(len(spread.u)), where=spread.u > 0.0)


def differences_table(found: Comparison, writer: Writer) -> Table:
    """Return each angle by both methods, and their difference with its verdict."""
    words = writer.words
    difference, expanded = found.difference_rad, found.spread.expanded
    factors, rows, classes = coverage_factors(found.spread), [], []
    for i, name, wheel, kind in _rows(found):
        methods = []
        for method, u in ((found.first, found.u_first[i]), (found.second, found.u_second[i])):
            # a method without uncertainty, such as the truth: to the difference's place
            wide = factors[i] * u or expanded[i]
            methods += [writer.number(method.angles_rad[i], "rad", wide), writer.size(u, "rad")]
        rows.append([
            writer.wheel(name), writer.wheel(wheel), writer.quantity(kind), *methods,
            writer.number(difference[i], "rad", expanded[i]),
            writer.size(found.spread.u[i], "rad"), writer.size(expanded[i], "rad"),
            words.number(f"{found.en[i]:+.2f}"), degrees(found.detectable_rad[i], words),
            agreed(found.verdicts[i], words),
        ])  # fmt: skip
        classes.append(CLASSES.get(found.verdicts[i], "undecided"))
    first, second = labels(found, words)
    u = Column("u", "text")
    columns: Columns = (
        words("results.name"), Column(words("results.wheel"), "text"), words("comparison.angle"),
        first, u, second, u, words("comparison.difference"), u, "U", words("comparison.en"),
        Column(words("comparison.detectable"), minor=True), words("comparison.verdict"),
    )  # fmt: skip
    return writer.table(columns, rows, 3, words("comparison.differences"), classes)


def causes_table(found: Comparison, writer: Writer) -> Table:
    """Return the parts of each difference that frame and planes cause."""
    words, rows = writer.words, []
    for i, name, wheel, kind in _rows(found):
        parts = (found.difference_rad[i], found.frame_rad[i], found.planes_rad[i])
        whole, planes = found.spread.expanded[i], found.planes.expanded[i]
        texts = (
            writer.number(float(x), "rad", U)
            for x, U in zip(parts, (whole, whole, planes), strict=True)
        )
        u = writer.size(found.planes.u[i], "rad")
        rows.append([writer.wheel(name), writer.wheel(wheel), writer.quantity(kind), *texts, u])
    columns: Columns = (
        words("results.name"), Column(words("results.wheel"), "text"), words("comparison.angle"),
        words("comparison.difference"), words("comparison.by_frame"),
        words("comparison.by_plane"), "u",
    )  # fmt: skip
    return writer.table(columns, rows, 3, words("comparison.why_title"))


def shape_table(found: Comparison, writer: Writer) -> Table:
    """Return the differences of the four centres' shape."""
    words, spread, rows = writer.words, found.shape_spread, []
    for index, (name, unit) in enumerate(SHAPES):
        value, u, expanded = (float(x[index]) for x in (found.shape, spread.u, spread.expanded))
        en = words.number(f"{value / expanded:+.2f}") if expanded > 0.0 else writer.none
        if unit == "m":
            texts = writer.millimetres(value, expanded, "+"), writer.size(u, "m")
        else:
            texts = writer.number(value, "rad", expanded), writer.size(u, "rad")
        rows.append([words(f"shape.{name}"), *texts, en])
    columns = (Column(words("vehicle.quantity"), quiet=True), words("comparison.difference"), "u",
               words("comparison.en"))  # fmt: skip
    return writer.table(columns, rows, 1, words("comparison.shape"))


def whole_lines(found: Comparison, words: Translations) -> list[str]:
    """Return the joint test, what was seen, and what would be."""
    beyond = int(np.count_nonzero(np.abs(found.en) > 1.0))
    toes, cambers = (degrees(found.detectable_in_all_rad(kind), words) for kind in KINDS)
    one = found.detectable_in_one_rad
    lines = [
        words("comparison.all", test=joint_words(found.joint, words)),
        words("comparison.beyond", beyond=beyond, count=len(found.en)),
        words("comparison.smallest", one=degrees(one, words), toes=toes, cambers=cambers),
    ]
    if found.to_detect_rad is not None and one > found.to_detect_rad:
        lines.append(words("comparison.unseen", size=degrees(found.to_detect_rad, words)))
    lines += doubted(found.doubts, words)
    if found.joint.agrees and found.is_shape_contradicted:
        p = words.number(f"{found.shape_test.probability:.2g}")
        lines.append(words("comparison.shape_doubt", p=p))
    return lines


def missing_lines(found: Comparison, words: Translations) -> list[str]:
    """Return what could not be compared, and why."""
    return [words("comparison.not_compared", name=n, reason=r) for n, r in found.missing]


def _rows(found: Comparison) -> list[tuple[int, str, str, str]]:
    """Index, name, wheel and angle: wheel by wheel, toe before camber."""
    count = len(found.names)
    return [
        (index + count * kind, name, wheel, KINDS[kind])
        for index, (name, wheel) in enumerate(zip(found.names, found.wheels, strict=True))
        for kind in range(2)
    ]
