"""Reference values of a machine's quantities, in its axis and sign, with their covariance."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from functools import cached_property

import numpy as np

from ..errors import Doubt, Wording
from ..measurement import (
    WHEEL_BY_SWEEP,
    Estimate,
    Measurement,
    WheelResult,
    estimate,
    toe_out_at,
    weighted_sum,
)
from ..system import frozen
from ..uncertainty import Effect, effects_of
from ..vectors import Array
from ..vehicle import VEHICLE, WHEEL, linearise, named
from .forms.item import Item, ItemQuantity
from .forms.quantities import AXLES, QUANTITIES, TURNS
from .forms.quantities import VEHICLE as WHOLE

ROLES = ("reference", "trial")


class Quantities(dict[str, Estimate]):
    """Estimates by name, each made when it is first asked for: most of a vehicle's never are."""

    def __init__(self, known: dict[str, tuple[float, Array]], effects: tuple[Effect, ...]) -> None:
        super().__init__()
        self.known, self.effects = known, effects

    def __missing__(self, name: str) -> Estimate:
        value, slope = self.known[name]
        self[name] = estimate(value, slope, self.effects)
        return self[name]


@frozen
class Reference:
    """A measurement as the reference of one series; of all where series is None."""

    measurement: Measurement
    series: str | None = None

    @property
    def source(self) -> str:
        """Name of the capture or file."""
        return self.measurement.provenance.source

    @cached_property
    def by_name(self) -> Quantities:
        """Quantities of all wheels and of the vehicle: `RR.toe`, `thrust_angle`."""
        wheels = [wheel for wheel in self.measurement.wheels if wheel.evaluated is not None]
        poses = [wheel.pose for wheel in wheels if wheel.pose is not None]
        vertical = self.measurement.vertical
        linear = linearise(
            np.stack([pose.centre_m for pose in poses[:4]]),
            np.stack([pose.normal for pose in poses]),
            [str(wheel.wheel) for wheel in wheels],
            None if vertical is None else vertical.normal,
        )
        names = [f"{w.observation.name}.{entry.name}" for entry in WHEEL for w in wheels]
        names += [entry.name for entry in VEHICLE]
        pairs = zip(linear.values.tolist(), linear.slopes, strict=True)
        inputs = poses if vertical is None else [*poses, vertical]
        return Quantities(dict(zip(names, pairs, strict=True)), tuple(effects_of(inputs)))

    @cached_property
    def wheels(self) -> dict[str, WheelResult]:
        """Reference wheels and trials by name."""
        return {
            wheel.observation.name: wheel
            for wheel in self.measurement.wheels
            if wheel.observation.role in ROLES
        }

    def in_place(self, kind: str, point: str, item: Item) -> bool:
        """Return whether a point counts from a thrust line that its own trial turns."""
        wheel = self.wheels.get(point)
        if item.declared()[kind].axis != "thrust-line" or wheel is None:
            return False
        return wheel.observation.role == "trial" and wheel.wheel in ("RR", "RL")

    def doubts_about(self, point: str) -> tuple[Doubt, ...]:
        """Return the notes by which a wheel, trial, pair, axle or the vehicle is in doubt."""
        names = point.split("+")
        doubts = self.measurement.doubts
        return tuple(one for one in doubts if any(one.is_about(name) for name in names))

    def points(self, kind: str, item: Item) -> list[str]:
        """Return the points at which a quantity of the item has a reference value."""
        subject = QUANTITIES[kind].subject
        candidates = {"wheel": list(self.wheels), "axle": AXLES, "vehicle": WHOLE, "turn": TURNS}
        return [
            point
            for point in candidates[subject]
            if isinstance(self.value(kind, point, item), Estimate)
        ]

    def value(self, kind: str, point: str, item: Item) -> Estimate | str:
        """Return the reference value in the item's axis and sign; or why there is none."""
        found = self._value(kind, point, item.declared()[kind])
        if isinstance(found, str):
            return found
        sign = item.sign(kind)
        return replace(found, value=sign * found.value, slope=sign * found.slope)

    def _value(self, kind: str, point: str, stated: ItemQuantity) -> Estimate | str:
        if kind == "total_toe" and "+" in point:
            return self._pair(point)
        subject = QUANTITIES[kind].subject
        fixed = {"axle": AXLES, "vehicle": WHOLE, "turn": TURNS}.get(subject, ())
        if subject != "wheel" and point not in fixed:
            pair = ", or two targets such as 1+2" * (kind == "total_toe")
            choices = f"{' or '.join(fixed)}{pair}"
            return Wording(
                "{point} is no point of {kind}: write {choices}",
                point=repr(point),
                kind=kind,
                choices=choices,
            )
        if subject == "wheel" and point not in self.wheels:
            known = ", ".join(self.wheels)
            return Wording(
                "{point} is no wheel or trial of {source}: known are {known}",
                point=repr(point),
                source=self.source,
                known=known,
            )
        if kind in ("caster", "sai"):
            return self._swept(kind, point)
        if kind == "toe_out_on_turns":
            return self._on_turn(point, float(stated.inner_deg or 0.0))
        if subject == "wheel":
            name = "camber_iso" if stated.definition == "iso" else kind
            return self._of_wheel(point, named(name, stated.axis))
        name = {"total_toe": f"{point}_total_toe", "track": f"{point}_track",
                "setback": f"{point}_setback"}.get(kind, kind)  # fmt: skip
        name = named(name, stated.axis)
        if name not in self.by_name.known:
            return f"{kind} at {point} is zero by definition of its axis"
        return self.by_name[name]

    def _of_wheel(self, point: str, name: str) -> Estimate | str:
        wheel = self.wheels[point]
        if wheel.angles is None:
            seen = wheel.observation
            return f"{point!r} was not measured ({seen.status}: {seen.reason})"
        return self.by_name[f"{point}.{name}"]

    def _pair(self, point: str) -> Estimate | str:
        """Return the total toe of two targets, one on either side."""
        names = point.split("+")
        unknown = [name for name in names if name not in self.wheels]
        if len(names) != 2 or unknown:
            known = ", ".join(self.wheels)
            return f"{point!r} is no pair of targets of {self.source}: known are {known}"
        sides = {str(self.wheels[name].wheel)[-1:] for name in names}
        if sides != {"L", "R"}:
            return f"{point!r}: total toe is of one left and one right target"
        found = [self._of_wheel(name, "toe") for name in names]
        reasons = [one for one in found if isinstance(one, str)]
        if reasons:
            return reasons[0]
        return weighted_sum([(1.0, one) for one in found if isinstance(one, Estimate)])

    def _swept(self, kind: str, point: str) -> Estimate | str:
        axes = [axis for axis in self.measurement.steering_axes if axis.wheel == point]
        if not axes:
            return f"{self.source} has no steering sweep of {point}, which {kind} needs"
        found: Estimate | None = getattr(axes[0], WHEEL_BY_SWEEP[kind])
        if found is None or axes[0].status not in ("ok", "range-too-small"):
            return f"{kind} of {point} was not measured ({axes[0].status}: {axes[0].reason})"
        return found

    def _on_turn(self, point: str, inner_deg: float) -> Estimate | str:
        curves = [curve for curve in self.measurement.toe_out if curve.turn == point]
        if not curves:
            return f"{self.source} has no steering sweep of both front wheels"
        found = toe_out_at(curves[0], float(np.radians(inner_deg)))
        return found.difference or f"toe-out was not measured ({found.status}: {found.reason})"


def reference_of(references: Sequence[Reference], series: str) -> Reference | None:
    """Return the reference of a series; None where no reference is named for it."""
    return next((one for one in references if one.series in (None, series)), None)


def joint_effects(estimates: Sequence[Estimate]) -> list[Effect]:
    """Return the effects of what estimates depend on, acting on all N of them; factors (N, k).

    Estimates of one measurement share their effects, by which they are correlated.
    """
    groups: dict[tuple[int, ...], list[int]] = {}
    for index, one in enumerate(estimates):
        groups.setdefault(tuple(map(id, one.effects)), []).append(index)
    found = []
    for members in groups.values():
        for effect in estimates[members[0]].effects:
            factor = np.zeros((len(estimates), effect.factor.shape[1]))
            factor[members] = [estimates[i].slope @ effect.factor for i in members]
            found.append(replace(effect, factor=factor))
    for index, one in enumerate(estimates):
        if one.u_own:
            factor = np.zeros((len(estimates), 1))
            factor[index] = one.u_own
            found.append(Effect("interpolation", factor, float("inf"), False))
    return found
