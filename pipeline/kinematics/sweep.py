"""Scans of wheels in several positions, by steering or about their axles, with the frame's wheels.

Every result is a number with its slopes by the same K inputs: normal and centre of every measured
target of the capture, RR, RL, FR, FL first; then those of every scan of a sweep or run-out once
more, without what is fixed to its target; then the stated rotation of every scan; then the observed
in-plane rotation of every target that shows it; last, where one is in use, the vertical with a
centre of zeros.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from ..capture import Role
from ..centre import RotationMark, TargetFit
from ..measurement import Estimate, Measurement, Vertical, WheelResult, estimate
from ..system import frozen
from ..uncertainty import Effect, UncertaintyComponent, chi_square_beyond, effects_of
from ..vectors import Array
from ..vehicle import (
    Dual,
    FrameSlopes,
    VehicleFrame,
    build_reference_frame,
    frame_slopes,
    upright,
)
from .axis_fit import OneAxis, fit_one_axis
from .plate_pose import Poses

OF_VERTICAL = 6  # inputs: its normal, and a centre that is not used
DOUBT = 1e-3  # probability of a fit below which the scans do not rotate about one axis
# What rotates with the wheel, and is no part of its axle; of a flatness that a fit observed, with
# degrees of freedom, each scan has its own.
TURNS_WITH_WHEEL = ("flatness", "clamp", "tyre run-out")
# What does not weigh the poses of a fit: rotations are stated beside them, and the distance of a
# plate from its wheel moves all centres alike, along their normals.
APART = ("turn", "stand-off")


@frozen
class SweepScans:
    """All measured scans of sweeps and run-outs, with the uncertainty effects on them.

    reference_centres_m: (4, 3), on which the frame stands; d_centres: (12, K) of them by the
    inputs; slopes: of the frame by them. measured: all targets, and scans: those of sweeps and
    run-outs, both in the measurement's order. effects: of all
    components on the K inputs. u_turns_rad: (n,) of the stated rotations, inf where none is. faces:
    indices of the scans whose in-plane rotation is observed.
    """

    frame: VehicleFrame
    slopes: FrameSlopes
    reference_centres_m: Array
    d_centres: Array
    measured: tuple[WheelResult, ...]
    scans: tuple[WheelResult, ...]
    effects: tuple[Effect, ...]
    u_turns_rad: Array
    faces: tuple[int, ...] = ()
    vertical: Vertical | None = None

    @property
    def count(self) -> int:
        """K."""
        return self._first_vertical + OF_VERTICAL * (self.vertical is not None)

    @property
    def _first_vertical(self) -> int:
        return self._first_turn + len(self.scans) + len(self.faces)

    @property
    def _first_turn(self) -> int:
        return 6 * (len(self.measured) + len(self.scans))

    def of_wheel(self, wheel: str, role: Role) -> list[int]:
        """Return the indices of a wheel's scans of that role."""
        return [
            i
            for i, scan in enumerate(self.scans)
            if scan.wheel == wheel and scan.observation.role == role
        ]

    def columns(self, index: int) -> tuple[Array, Array]:
        """Return the slopes (3, K) of a scan's outward normal, and of its centre."""
        return self._columns(self.scans[index], len(self.measured) + index)

    def columns_of_target(self, row: int) -> tuple[Array, Array]:
        """Return the slopes (3, K) of a measured target's outward normal, and of its centre."""
        return self._columns(self.measured[row], row)

    def _columns(self, result: WheelResult, place: int) -> tuple[Array, Array]:
        whole = np.zeros((2, 3, self.count))
        whole[0, :, 6 * place : 6 * place + 3] = _facing(result) * np.eye(3)
        whole[1, :, 6 * place + 3 : 6 * place + 6] = np.eye(3)
        return whole[0], whole[1]

    def inputs_of(self, members: Sequence[int]) -> Array:
        """Return the Jacobian (7 m + k, K) of the observations of m scans by all inputs.

        Rows: normals and centres, the stated rotations, the k observed in-plane rotations.
        """
        own = [part for i in members for part in self.columns(i)]
        turns = np.zeros((len(members), self.count))
        turns[np.arange(len(members)), self._first_turn + np.array(members)] = 1.0
        mine = self.faces_of(members)
        faces = np.zeros((len(mine), self.count))
        for row, i in enumerate(mine):
            column = self._first_turn + len(self.scans) + self.faces.index(i)
            faces[row, column] = _facing(self.scans[i])
        return np.vstack([*own, turns, faces])

    def without_faces(self) -> SweepScans:
        """Return the scans without their in-plane rotations."""
        faces = slice(self._first_turn + len(self.scans), self._first_vertical)
        cut = [replace(e, factor=np.delete(e.factor, faces, axis=0)) for e in self.effects]
        d_centres = np.delete(self.d_centres, faces, axis=1)
        return replace(self, faces=(), d_centres=d_centres, effects=tuple(cut))

    def in_frame(self, vector: Array, moved: Array) -> tuple[Dual, Dual, Dual]:
        """Return the parts of a vector (3,) with slopes (3, K) to the left, forward and up."""
        axes = (
            (self.frame.left, self.slopes.left),
            (self.frame.forward, self.slopes.forward),
            (self.frame.up, self.slopes.up),
        )
        left, forward, up = (
            Dual(float(vector @ axis), axis @ moved + (vector @ turned) @ self.d_centres)
            for axis, turned in axes
        )
        return left, forward, up

    def upright(self, vector: Array, moved: Array) -> tuple[Dual, Dual, Dual]:
        """Return the parts of a vector (3,) to the left, forward and up in the vertical's frame."""
        parts = self.in_frame(vector, moved)
        if self.vertical is None:
            return parts
        columns = np.zeros((3, self.count))
        columns[:, self._first_vertical : self._first_vertical + 3] = np.eye(3)
        left, forward, up = upright(parts, self.in_frame(self.vertical.normal, columns))
        return left, forward, up

    def estimate(self, number: Dual) -> Estimate:
        """Return a number with its uncertainty by all components (JCGM 100, 5.2 and G.4)."""
        return estimate(number.value, number.slope, self.effects)

    def probability(self, numbers: Sequence[Dual]) -> float:
        """Return the probability that numbers whose true values are zero deviate as far or more."""
        values = np.array([number.value for number in numbers])
        slopes = np.stack([number.slope for number in numbers])
        V = sum(((slopes @ e.factor) @ (slopes @ e.factor).T for e in self.effects), np.zeros(()))
        return chi_square_beyond(float(values @ np.linalg.pinv(V) @ values), len(values))

    def fit(self, members: Sequence[int], turns_rad: Array, u_turns: Array, axis: Array) -> OneAxis:
        """Fit the axis about which the scans `members` rotated; see `fit_one_axis`."""
        scans = [self.scans[i] for i in members]
        whole = self.inputs_of(members)
        own = np.vstack([whole[: 6 * len(members)], whole[7 * len(members) :]])
        factors = [own @ effect.factor for effect in self.effects if effect.name not in APART]
        mine = self.faces_of(members)
        turns = [self.scans[i].observation.fitted.turn for i in mine]
        seen = Poses(
            normals=np.stack([scan.normal for scan in scans if scan.normal is not None]),
            centres_m=np.stack([scan.observation.fitted.centre_m for scan in scans]),
            covariance=np.asarray(sum(factor @ factor.T for factor in factors)),
            with_face=tuple(list(members).index(i) for i in mine),
            faces=np.array([t.axis for t in turns if t is not None]).reshape(-1, 3),
            periods_rad=np.array([t.period_rad for t in turns if t is not None]),
        )
        return fit_one_axis(seen, turns_rad, u_turns, axis)

    def faces_of(self, members: Sequence[int]) -> list[int]:
        """Return those of the scans whose in-plane rotation is observed."""
        return [i for i in members if i in self.faces]

    def on_centres(self, centres_m: Array, d_centres: Array) -> SweepScans:
        """Return the scans in the frame of other centres (4, 3) with their slopes (12, K)."""
        frame = build_reference_frame(centres_m)
        return replace(
            self,
            frame=frame,
            slopes=frame_slopes(frame, centres_m - centres_m[0]),
            reference_centres_m=centres_m,
            d_centres=d_centres,
        )

    def mark_of(self, faces: Sequence[int]) -> RotationMark | None:
        """Return the mark that shows the in-plane rotation of those scans of one wheel."""
        turns = [self.scans[i].observation.fitted.turn for i in faces]
        return next((turn.mark for turn in turns if turn is not None), None)


def sweep_scans(measurement: Measurement) -> SweepScans:
    """Return the sweep and run-out scans; a measurement's first four wheels are the frame's."""
    measured = tuple(wheel for wheel in measurement.wheels if wheel.normal is not None)
    scans = tuple(w for w in measured if w.observation.role in ("sweep", "runout"))
    turns = [scan.observation.turn for scan in scans]
    u_turns = np.array([math.inf if t is None or t.u_rad is None else t.u_rad for t in turns])
    targets = [_of_scan(wheel) for wheel in measured]
    targets += [_on_its_wheel(_of_scan(scan)) for scan in scans]
    faces = _faces(scans)
    targets += [_turn_alone(targets[len(measured) + i]) for i in faces]
    centres = np.stack([wheel.observation.fitted.centre_m for wheel in measured[:4]])
    slopes = frame_slopes(measurement.frame, centres - centres[0])
    own = OF_VERTICAL * (measurement.vertical is not None)
    d_centres = np.zeros((12, 6 * (len(measured) + len(scans)) + len(scans) + len(faces) + own))
    for i in range(4):
        d_centres[3 * i : 3 * i + 3, 6 * i + 3 : 6 * i + 6] = np.eye(3)
    effects = [_widened(effect, len(scans), len(faces), own) for effect in effects_of(targets)]
    size = d_centres.shape[1]
    first = 6 * (len(measured) + len(scans))
    effects += [_of_turn(u, first + i, size) for i, u in enumerate(u_turns) if math.isfinite(u)]
    if measurement.vertical is not None:
        for effect in effects_of([measurement.vertical]):
            above = np.zeros((size - OF_VERTICAL, effect.factor.shape[1]))
            effects.append(replace(effect, factor=np.vstack([above, effect.factor])))
    return SweepScans(
        measurement.frame,
        slopes,
        centres,
        d_centres,
        measured,
        scans,
        tuple(effects),
        u_turns,
        faces,
        measurement.vertical,
    )


def _facing(scan: WheelResult) -> float:
    """Return 1 where the fitted normal is the outward one, else -1."""
    assert scan.normal is not None
    return 1.0 if scan.normal @ scan.observation.fitted.normal > 0.0 else -1.0


def _faces(scans: Sequence[WheelResult]) -> tuple[int, ...]:
    """Return the scans whose in-plane rotation is used: by the mark that most of a group show.

    A group is one wheel's scans of one role. One rotation alone determines nothing, and a print may
    be rotated on its board against the edges.
    """
    kept: list[int] = []
    groups = [(scan.wheel, scan.observation.role) for scan in scans]
    for group in dict.fromkeys(groups):
        by_mark: dict[str, list[int]] = {"print": [], "edges": []}
        for i, scan in enumerate(scans):
            turn = scan.observation.fitted.turn
            if groups[i] == group and turn is not None:
                by_mark[turn.mark].append(i)
        most = max(by_mark.values(), key=len)
        kept += most if len(most) > 1 else []
    return tuple(sorted(kept))


def _turn_alone(target: TargetFit) -> TargetFit:
    """Return a target's rotation as the first of six numbers, moved by the same components."""
    components = []
    for component in target.components:
        if component.turn is not None:
            factor = np.zeros((6, len(component.turn)))
            factor[0] = component.turn
            components.append(replace(component, factor=factor))
    return replace(target, components=tuple(components))


def _on_its_wheel(target: TargetFit) -> TargetFit:
    """Return the target without what rotates with it, which the axis fit absorbs in its pose."""
    left = [component for component in target.components if not turns_with_wheel(component)]
    return replace(target, components=tuple(left))


def turns_with_wheel(component: UncertaintyComponent) -> bool:
    """Return whether a component rotates with the wheel, so that no axle has it."""
    observed = component.name == "flatness" and math.isfinite(component.dof)
    return component.name in TURNS_WITH_WHEEL and not observed


def _of_scan(result: WheelResult) -> TargetFit:
    """Return the target with its components shared by all uses of one scan.

    The distance of its plate from the wheel is the same in all scans of one mounting.
    """
    seen = result.observation
    plate = seen.repeats or (seen.name if seen.role == "trial" else result.wheel)
    of = {"stand-off": f"plate of {plate}"}
    components = tuple(
        replace(one, shared=one.shared or of.get(one.name, f"scan {seen.source}"))
        for one in seen.fitted.components
    )
    return replace(seen.fitted, components=components)


def _widened(effect: Effect, turns: int, faces: int, own: int) -> Effect:
    """Return the effect with rows for the stated rotations, and one of six of each observed one.

    own: number of rows of the vertical, on which no target's effect acts.
    """
    size = len(effect.factor) - 6 * faces
    none, last = (np.zeros((count, effect.factor.shape[1])) for count in (turns, own))
    rows = (effect.factor[:size], none, effect.factor[size::6], last)
    return replace(effect, factor=np.vstack(rows))


def _of_turn(u_rad: float, row: int, size: int) -> Effect:
    factor = np.zeros((size, 1))
    factor[row] = u_rad
    return Effect("turn", factor, math.inf, pooled=False)
