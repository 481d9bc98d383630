"""What one method says of a vehicle's wheels, in the form in which methods are compared."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from pipeline.errors import InputError
from pipeline.jacobian import jacobian
from pipeline.joint_test import Spread, sources_of
from pipeline.kernels import Array
from pipeline.locate_centre import TargetFit
from pipeline.reference_frame import REFERENCE_WHEELS
from pipeline.uncertainty import effects_of
from pipeline.validate_shape import shape_of

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
