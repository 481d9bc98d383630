"""Comparison of two methods on the same wheels: differences, uncertainties, verdicts."""

from __future__ import annotations

from collections.abc import Sequence
from functools import cached_property, partial
from typing import Literal

import numpy as np

from ..errors import Doubt, InputError
from ..measurement import Provenance
from ..system import frozen
from ..uncertainty import UncertainTarget, effects_of
from ..vectors import Array
from ..vehicle import REFERENCE_WHEELS, jacobian
from .frame_effect import frame_share, shape_difference, shape_of, slopes
from .statistics.joint_test import ErrorSource, JointTest, Spread, sources_of

AgreementVerdict = Literal["agree", "disagree", "cannot tell"]
KINDS = ("toe", "camber")
SHAPE_DOUBT = 1e-3  # probability of the shape of the centres below which no agreement is stated


@frozen
class Comparison:
    """Differences, first less second method, on n wheels and trials.

    difference_rad: (2 n,) toes, then cambers; spread: its covariance. u_first, u_second: (2 n,).
    sources: uncertainties of normals and centres of both (12 n), from which the other covariances
    follow. missing: name and reason of what only one method has. to_detect_rad: size of error that
    must be detectable. origins: provenance of both.
    """

    source: str
    names: tuple[str, ...]
    wheels: tuple[str, ...]
    first: ComparedMethod
    second: ComparedMethod
    u_first: Array
    u_second: Array
    sources: tuple[ErrorSource, ...]
    spread: Spread
    missing: tuple[tuple[str, str], ...] = ()
    notes: tuple[str, ...] = ()
    vehicle: str = ""
    to_detect_rad: float | None = None
    origins: tuple[Provenance, ...] = ()

    @property
    def difference_rad(self) -> Array:
        """(2 n,) first less second method: toes, then cambers."""
        return self.first.angles_rad - self.second.angles_rad

    @property
    def en(self) -> Array:
        """(2 n,) normalised errors: difference over its expanded uncertainty."""
        with np.errstate(divide="ignore", invalid="ignore"):
            return np.nan_to_num(self.difference_rad / self.spread.expanded, nan=0.0)

    @cached_property
    def joint(self) -> JointTest:
        """Joint test of all angles, on which the overall verdict is based."""
        return self.spread.test(self.difference_rad)

    @cached_property
    def detectable_rad(self) -> Array:
        """(2 n,) smallest error of each angle detectable by its own test."""
        return self.spread.detectable

    @cached_property
    def detectable_in_one_rad(self) -> float:
        """Smallest error of any single angle detectable by the joint test."""
        return self.spread.detectable_jointly(np.eye(len(self.difference_rad)))

    def detectable_in_all_rad(self, kind: str) -> float:
        """Return the smallest error of all toes, or all cambers, detectable by the joint test."""
        alike = np.repeat([kind == other for other in KINDS], len(self.names))
        return self.spread.detectable_jointly(alike[:, None].astype(float))

    @property
    def verdicts(self) -> tuple[AgreementVerdict, ...]:
        """(2 n) verdict on each angle by its own En."""
        rows = zip(self.names * len(KINDS), self.en, self.detectable_rad, strict=True)
        return tuple(
            self._verdict(abs(en) <= 1.0, float(least), self.doubts_about(name))
            for name, en, least in rows
        )

    @property
    def verdict(self) -> AgreementVerdict:
        """Overall verdict by the joint test: correct methods agree in 95 % of comparisons.

        Angles that agree by the stated uncertainties say nothing where these do not explain how far
        the centres of both methods differ.
        """
        found = self._verdict(self.joint.agrees, self.detectable_in_one_rad, self.doubts)
        return "cannot tell" if found == "agree" and self.is_shape_contradicted else found

    @property
    def doubts(self) -> tuple[Doubt, ...]:
        """Notes on scans that contradict their names: methods that agree may share an error."""
        return tuple(note for note in self.notes if isinstance(note, Doubt))

    def doubts_about(self, name: str) -> tuple[Doubt, ...]:
        """Return the notes that put a wheel or trial in doubt."""
        return tuple(doubt for doubt in self.doubts if doubt.is_about(name))

    def _verdict(
        self, agrees: bool, detectable_rad: float, doubts: Sequence[Doubt]
    ) -> AgreementVerdict:
        if not agrees:
            return "disagree"
        undetectable = self.to_detect_rad is not None and detectable_rad > self.to_detect_rad
        return "cannot tell" if undetectable or doubts else "agree"

    @property
    def _state(self) -> Array:
        return np.stack([self.first.state, self.second.state])

    @cached_property
    def frame_rad(self) -> Array:
        """(2 n,) part of the difference that is due to the shape of the four centres."""
        return frame_share(self._state, self.wheels)

    @property
    def planes_rad(self) -> Array:
        """(2 n,) part of the difference that is due to the planes, both in one frame."""
        return self.difference_rad - self.frame_rad

    @cached_property
    def planes(self) -> Spread:
        """Covariance of planes_rad."""
        n = len(self.names)
        both = self.first.slopes(self.wheels), -self.second.slopes(self.wheels)
        by_frame = slopes(partial(frame_share, wheels=self.wheels), self._state)
        return Spread.of(np.hstack(both) - by_frame.reshape(2 * n, 12 * n), self.sources)

    @cached_property
    def shape(self) -> Array:
        """(6,) differences of the quantities of SHAPE."""
        return shape_difference(self._state)

    @cached_property
    def shape_spread(self) -> Spread:
        """Covariance of shape."""
        return Spread.of(slopes(shape_difference, self._state), self.sources)

    @cached_property
    def shape_test(self) -> JointTest:
        """Joint test of the shape of the four centres."""
        return self.shape_spread.test(self.shape)

    @property
    def is_shape_contradicted(self) -> bool:
        """Whether the centres differ by more than their uncertainties explain."""
        return self.shape_test.probability < SHAPE_DOUBT


def compare(
    source: str,
    names: Sequence[str],
    wheels: Sequence[str],
    first: ComparedMethod,
    second: ComparedMethod,
    missing: Sequence[tuple[str, str]] = (),
    notes: Sequence[str] = (),
    origins: Sequence[Provenance] = (),
) -> Comparison:
    """Compare two methods that share neither points nor instrument."""
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


def independent(first: ComparedMethod, second: ComparedMethod) -> tuple[ErrorSource, ...]:
    """Return the sources of two methods that share neither points nor instrument."""
    width = 6 * len(first.targets)
    return (
        *_placed(first.targets, before=0, after=width),
        *_placed(second.targets, before=width, after=0),
    )


def added(deltas: Sequence[UncertainTarget]) -> tuple[ErrorSource, ...]:
    """Return the sources of a second method that is the first one with `deltas` added."""
    return tuple(_placed(deltas, before=6 * len(deltas), after=0))


def _placed(targets: Sequence[UncertainTarget], before: int, after: int) -> list[ErrorSource]:
    pad = ((before, after), (0, 0))
    return [
        ErrorSource(np.pad(source.factor, pad), source.dof)
        for source in sources_of(effects_of(targets))
    ]


ALIKE = 0.05  # of track or wheelbase; two methods on one vehicle differ by less


@frozen
class ComparedMethod:
    """Result of one method on n wheels; the first four are RR, RL, FR, FL.

    angles_rad: (2 n,) toes, then cambers.
    """

    label: str
    targets: tuple[UncertainTarget, ...]
    angles_rad: Array

    @property
    def state(self) -> Array:
        """(n, 6) normals and centres, about the mean of the four centres."""
        centres = np.stack([target.centre_m for target in self.targets])
        normals = np.stack([target.normal for target in self.targets])
        return np.hstack([normals, centres - centres[:4].mean(axis=0)])

    def slopes(self, wheels: Sequence[str]) -> Array:
        """Return the derivatives (2 n, 6 n) of the angles by normals and centres."""
        state = self.state
        return jacobian(state[:4, 3:], state[:, :3], wheels)[: 2 * len(state)]

    def u(self, slopes: Array) -> Array:
        """Return the standard uncertainties (2 n,) of the angles, of all components together."""
        return Spread.of(slopes, sources_of(effects_of(self.targets))).u


def check_alike(
    first: ComparedMethod, second: ComparedMethod, source: str, units: str = "the length units"
) -> None:
    """Raise InputError where the four centres cannot be of one vehicle, in the same order.

    units: what to check of those in which the second one's file is read.
    """
    centres = [np.stack([t.centre_m for t in m.targets[:4]]) for m in (first, second)]
    shapes = [shape_of(c - c.mean(axis=0))[:3] for c in centres]
    for name, one, other in zip(("rear track", "front track", "wheelbase"), *shapes, strict=True):
        if abs(one - other) > ALIKE * max(one, other):
            raise InputError(
                f"{source}: {name} {one:.4g} m by {first.label}, {other:.4g} m by {second.label}: "
                f"check {units}, and that both are of this vehicle"
            )
    distances = np.linalg.norm(centres[0][:, None] - centres[1], axis=2)
    nearest = np.argmin(distances, axis=0)
    reach = ALIKE * float(shapes[0].max())
    same_positions = bool(np.all(distances.min(axis=0) < reach)) and len(set(nearest)) == len(
        nearest
    )
    if same_positions and list(nearest) != [0, 1, 2, 3]:
        found = ",".join(REFERENCE_WHEELS[index] for index in nearest)
        raise InputError(
            f"{source}: {second.label} of {','.join(REFERENCE_WHEELS)} lie at {found} of "
            f"{first.label}: name the wheel of each block with --blocks"
        )
