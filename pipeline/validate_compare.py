"""Two methods on the same wheels: differences, what they are uncertain by, and the verdicts."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property, partial
from typing import Literal

import numpy as np

from pipeline.joint_test import JointTest, Source, Spread, sources_of
from pipeline.kernels import Array
from pipeline.locate_centre import TargetFit
from pipeline.measurement import Provenance
from pipeline.uncertainty import effects_of
from pipeline.validate_method import Method
from pipeline.validate_shape import frame_share, shape_difference, slopes

Verdict = Literal["agree", "disagree", "cannot tell"]
KINDS = ("toe", "camber")


@dataclass(frozen=True)
class Comparison:
    """First less second method on n wheels and trials.

    difference_rad: (2 n,) toes, then cambers; spread: of it. u_first, u_second: (2 n,).
    sources: what moves normals and centres of both (12 n), from which the other spreads follow.
    missing: name and reason of what only one method has. see_rad: an error that is to be seen.
    origins: what both were made from.
    """

    source: str
    names: tuple[str, ...]
    wheels: tuple[str, ...]
    first: Method
    second: Method
    u_first: Array
    u_second: Array
    sources: tuple[Source, ...]
    spread: Spread
    missing: tuple[tuple[str, str], ...] = ()
    notes: tuple[str, ...] = ()
    vehicle: str = ""
    see_rad: float | None = None
    origins: tuple[Provenance, ...] = ()

    @property
    def difference_rad(self) -> Array:
        """(2 n,)."""
        return self.first.angles_rad - self.second.angles_rad

    @property
    def en(self) -> Array:
        """(2 n,) normalised errors: the difference over its expanded uncertainty."""
        with np.errstate(divide="ignore", invalid="ignore"):
            return np.nan_to_num(self.difference_rad / self.spread.expanded, nan=0.0)

    @cached_property
    def joint(self) -> JointTest:
        """Of all angles together, on which the verdict of the whole stands."""
        return self.spread.test(self.difference_rad)

    @cached_property
    def visible_rad(self) -> Array:
        """(2 n,) smallest error of each angle that its own test would see."""
        return self.spread.visible

    @cached_property
    def visible_in_one_rad(self) -> float:
        """Smallest error that the joint test would see, whichever one angle has it."""
        return self.spread.visible_jointly(np.eye(len(self.difference_rad)))

    def visible_in_all_rad(self, kind: str) -> float:
        """Smallest error, alike in all toes or all cambers, that the joint test would see."""
        alike = np.repeat([kind == other for other in KINDS], len(self.names))
        return self.spread.visible_jointly(alike[:, None].astype(float))

    @property
    def verdicts(self) -> tuple[Verdict, ...]:
        """Of each angle by its own En, (2 n)."""
        return tuple(
            self._verdict(abs(en) <= 1.0, float(least))
            for en, least in zip(self.en, self.visible_rad, strict=True)
        )

    @property
    def verdict(self) -> Verdict:
        """Of the whole, by the joint test: right methods agree in 95 % of all comparisons."""
        return self._verdict(self.joint.agrees, self.visible_in_one_rad)

    def _verdict(self, agrees: bool, visible_rad: float) -> Verdict:
        if not agrees:
            return "disagree"
        blind = self.see_rad is not None and visible_rad > self.see_rad
        return "cannot tell" if blind else "agree"

    @property
    def _state(self) -> Array:
        return np.stack([self.first.state, self.second.state])

    @cached_property
    def frame_rad(self) -> Array:
        """(2 n,) of the difference: what comes from the shape of the four centres."""
        return frame_share(self._state, self.wheels)

    @property
    def planes_rad(self) -> Array:
        """(2 n,) of the difference: what comes from the planes, both in one frame."""
        return self.difference_rad - self.frame_rad

    @cached_property
    def planes(self) -> Spread:
        """Of planes_rad."""
        n = len(self.names)
        both = self.first.slopes(self.wheels), -self.second.slopes(self.wheels)
        by_frame = slopes(partial(frame_share, wheels=self.wheels), self._state)
        return Spread.of(np.hstack(both) - by_frame.reshape(2 * n, 12 * n), self.sources)

    @cached_property
    def shape(self) -> Array:
        """(6,) differences of the numbers of SHAPE."""
        return shape_difference(self._state)

    @cached_property
    def shape_spread(self) -> Spread:
        """Of them."""
        return Spread.of(slopes(shape_difference, self._state), self.sources)


def compare(
    source: str,
    names: Sequence[str],
    wheels: Sequence[str],
    first: Method,
    second: Method,
    missing: Sequence[tuple[str, str]] = (),
    notes: Sequence[str] = (),
    origins: Sequence[Provenance] = (),
) -> Comparison:
    """Of two methods that share neither points nor instrument."""
    sources = independent(first, second)
    by_first, by_second = first.slopes(wheels), second.slopes(wheels)
    return Comparison(
        source=source,
        names=tuple(names),
        wheels=tuple(wheels),
        first=first,
        second=second,
        u_first=first.u(by_first),
        u_second=second.u(by_second),
        sources=sources,
        spread=Spread.of(np.hstack([by_first, -by_second]), sources),
        missing=tuple(missing),
        notes=tuple(notes),
        origins=tuple(origins),
    )


def independent(first: Method, second: Method) -> tuple[Source, ...]:
    """Sources of two methods that share no point and no instrument."""
    width = 6 * len(first.targets)
    return (
        *_placed(first.targets, before=0, after=width),
        *_placed(second.targets, before=width, after=0),
    )


def added(deltas: Sequence[TargetFit]) -> tuple[Source, ...]:
    """Sources of a second method that is the first one with `deltas` added."""
    return tuple(_placed(deltas, before=6 * len(deltas), after=0))


def _placed(targets: Sequence[TargetFit], before: int, after: int) -> list[Source]:
    pad = ((before, after), (0, 0))
    return [
        Source(np.pad(source.factor, pad), source.freedom)
        for source in sources_of(effects_of(targets))
    ]
