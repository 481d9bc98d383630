"""Two methods on the same wheels: differences, what they are uncertain by, and the verdicts."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property, partial
from typing import Literal

import numpy as np

from ..centre import TargetFit
from ..errors import InputError
from ..measurement import Provenance
from ..uncertainty import effects_of
from ..vectors import Array
from ..vehicle import REFERENCE_WHEELS, jacobian
from .frame_effect import frame_share, shape_difference, shape_of, slopes
from .statistics.joint_test import JointTest, Source, Spread, sources_of

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
        Source(np.pad(source.factor, pad), source.dof) for source in sources_of(effects_of(targets))
    ]


ALIKE = 0.05  # of the length; no two methods of one car differ by more in track or wheelbase


@dataclass(frozen=True)
class Method:
    """What one method says of n wheels; the first four are RR, RL, FR, FL.

    angles_rad: (2 n,) toes, then cambers.
    """

    label: str
    targets: tuple[TargetFit, ...]
    angles_rad: Array

    @property
    def state(self) -> Array:
        """(n, 6) normals and centres, about the mean of the four centres."""
        centres = np.stack([target.centre_m for target in self.targets])
        normals = np.stack([target.normal for target in self.targets])
        return np.hstack([normals, centres - centres[:4].mean(axis=0)])

    def slopes(self, wheels: Sequence[str]) -> Array:
        """(2 n, 6 n) derivatives of the angles by normals and centres."""
        state = self.state
        return jacobian(state[:4, 3:], state[:, :3], wheels)[: 2 * len(state)]

    def u(self, slopes: Array) -> Array:
        """(2 n,) standard uncertainties of the angles with these slopes, by all causes."""
        return Spread.of(slopes, sources_of(effects_of(self.targets))).u


def check_alike(first: Method, second: Method, source: str) -> None:
    """Raise InputError where the four centres cannot be those of one car, in one order."""
    centres = [np.stack([t.centre_m for t in m.targets[:4]]) for m in (first, second)]
    shapes = [shape_of(c - c.mean(axis=0))[:3] for c in centres]
    for name, one, other in zip(("rear track", "front track", "wheelbase"), *shapes, strict=True):
        if abs(one - other) > ALIKE * max(one, other):
            raise InputError(
                f"{source}: {name} {one:.4g} m by {first.label}, {other:.4g} m by {second.label}: "
                "check the length units, and that both are of this vehicle"
            )
    apart = np.linalg.norm(centres[0][:, None] - centres[1], axis=2)
    nearest = np.argmin(apart, axis=0)
    reach = ALIKE * float(shapes[0].max())
    same_place = bool(np.all(apart.min(axis=0) < reach)) and len(set(nearest)) == len(nearest)
    if same_place and list(nearest) != [0, 1, 2, 3]:
        found = ",".join(REFERENCE_WHEELS[index] for index in nearest)
        raise InputError(
            f"{source}: {second.label} of {','.join(REFERENCE_WHEELS)} lie at {found} of "
            f"{first.label}: name what each block shows with --blocks"
        )
