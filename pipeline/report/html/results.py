"""The headline of a report: the verdict and its rule."""

from __future__ import annotations

from ...measurement import Conformity, Measurement, stated
from ...system import frozen
from ..format.language import Translations
from ..format.writer import NONE
from ..tables.conformity import SIGNS, decided, doubted, rule


@frozen
class Headline:
    """The verdict: kind is `conform`, `not-conform`, `undecided` or `none`."""

    kind: str
    sign: str
    title: str
    says: tuple[str, ...]


def headline(
    measurement: Measurement, conformity: Conformity | None, words: Translations
) -> Headline:
    """Return the verdict in words, with its rule, and what was not measured."""
    missing = [words.wheel(w.observation.name) for w in measurement.wheels if w.angles is None]
    left = (words("verdict.incomplete", names=", ".join(missing)),) if missing else ()
    if conformity is None:
        return Headline("none", NONE, words("verdict.none"), (words("verdict.none_says"), *left))
    tolerance, decision = conformity.tolerance, conformity.decision
    key = decision.replace(" ", "_")
    simple = "_simple" if decision == "conform" and tolerance.rule == "simple" else ""
    says = [words(f"verdict.{key}_says{simple}"), *doubted(conformity.doubts, words), *left]
    title = " ".join(tolerance.title.split())
    if title:
        says.append(f"{words('verdict.against')}: {title}")
    says.append(rule(conformity, words))
    kind = decision.replace(" ", "-")
    return Headline(kind, SIGNS[decision], decided(decision, words), tuple(says))


def factor_words(measurement: Measurement, words: Translations) -> str:
    """Return the coverage factor of the reported values, or its range."""
    factors = [q.coverage_factor for q in stated(measurement)]
    low, high = (words.number(f"{k:.2f}") for k in (min(factors), max(factors)))
    if low == high:
        return words("results.factor_one", k=low)
    return words("results.factor_range", low=low, high=high)
