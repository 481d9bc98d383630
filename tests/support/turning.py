"""Wheels that turn about a kingpin or an axle, by rigid-body geometry alone: truth for tests.

Vehicle coordinates: x forward, y left, z up. Nothing here comes from the package under test but the
records in which its stages hand on what they saw.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace

import numpy as np
from scipy.spatial.transform import Rotation

from tests.support.given import root, standing
from wheelplane.capture.entry import Turn
from wheelplane.centre.in_plane_rotation import InPlaneRotation
from wheelplane.centre.locate_centre import TargetFit
from wheelplane.kinematics.solve import solve
from wheelplane.measurement.evaluate import align
from wheelplane.measurement.records import Evidence, Measurement, Observation, Provenance
from wheelplane.uncertainty.components import UncertaintyComponent

NOWHERE = Provenance("test", None, "0", {}, {}, 0)
WHEELS = ("RR", "RL", "FR", "FL")
# The front axle meets the plane of the rear one in the middle, so that the frame is the car's own.
PLACES = {"RR": (0.0, -0.75, 0.0), "RL": (0.0, 0.75, 0.0),
          "FR": (2.65, -0.745, 0.00745), "FL": (2.64, 0.755, -0.00755)}  # fmt: skip
NORMAL_RAD, CENTRE_M = 5.6e-5, 4e-5  # of a scan of the default scanner, each axis (k = 1)


def side(wheel: str) -> float:
    return 1.0 if wheel[1] == "L" else -1.0


def facing(wheel: str, toe: float, camber: float) -> np.ndarray:
    """Outward normal (3,) of a wheel of that toe and camber, radians."""
    out = np.cos(camber) * np.cos(toe)
    return np.array([np.cos(camber) * np.sin(toe), side(wheel) * out, -np.sin(camber)])


@dataclass
class Scene:
    """A car in a site, whose targets are seen with errors drawn from what is stated of them."""

    seed: int = 0
    normal_rad: float = NORMAL_RAD
    centre_m: float = CENTRE_M
    noise: float = 1.0  # times the errors that are stated
    extra: tuple[UncertaintyComponent, ...] = ()  # of each target beside
    mirrored: bool = False
    turned: Rotation | None = None
    u_turn: float | None = None  # of a face about its normal, where plates show it
    period: float = np.pi / 2.0
    with_centre: float = 0.0  # correlation of that turn's error with the centre's
    seen: list[Observation] = field(default_factory=list)

    def __post_init__(self) -> None:
        self.rng = np.random.default_rng(self.seed)
        site = np.random.default_rng([self.seed, 7])
        self.R = standing(Rotation.random(random_state=site.integers(1 << 31)))
        if self.turned is not None:
            self.R = self.turned * self.R
        self.shift = site.uniform(-20.0, 20.0, 3)

    def references(self, angles: dict[str, tuple[float, float]] | None = None) -> Scene:
        """All four, each with its toe and camber, radians."""
        for wheel in WHEELS:
            toe, camber = (angles or {}).get(wheel, (0.002, -0.01))
            self.look(wheel, "reference", wheel, PLACES[wheel], facing(wheel, toe, camber))
        return self

    def look(
        self, name: str, role: str, wheel: str, centre, normal, turn=None, source="", face=None
    ) -> Scene:
        """See one target; `source` of a scan that was seen before sees the same again.

        face: an axis of the plate, across its normal, which it shows where `u_turn` is given.
        """
        before = next((s for s in self.seen if s.source == source), None)
        target = before.fitted if before else self._target(np.asarray(centre), np.asarray(normal))
        if before is None and self.u_turn is not None and face is not None:
            target = self._with_face(np.asarray(centre), np.asarray(normal), np.asarray(face))
        self.seen.append(
            Observation(
                name, role, wheel, source or f"{name}.ply", "", 1, 0,
                evidence=Evidence(target), turn=turn,
            )
        )  # fmt: skip
        return self

    def measure(self) -> Measurement:
        return solve(align(self.seen, NOWHERE))

    def _target(self, centre: np.ndarray, normal: np.ndarray) -> TargetFit:
        flip = np.array([1.0, -1.0, 1.0]) if self.mirrored else np.ones(3)
        n, c = self.R.apply(normal * flip), self.R.apply(centre * flip) + self.shift
        across = np.eye(3) - np.outer(n, n)
        components = (
            UncertaintyComponent(
                "plane noise", np.vstack([self.normal_rad * root(across), np.zeros((3, 3))])
            ),
            UncertaintyComponent(
                "centre noise", np.vstack([np.zeros((3, 3)), self.centre_m * np.eye(3)])
            ),
            *self.extra,
        )
        moved = sum(e.factor @ self.rng.normal(size=e.factor.shape[1]) for e in components)
        n, c = n + self.noise * moved[:3], c + self.noise * moved[3:]
        sign = self.rng.choice([-1.0, 1.0])
        return TargetFit(c, sign * n / np.linalg.norm(n), components, 8e-4, 1000, "rim")

    def _with_face(self, centre: np.ndarray, normal: np.ndarray, face: np.ndarray) -> TargetFit:
        """Seen with its turn: what moves plane and centre may turn it too."""
        flip = np.array([1.0, -1.0, 1.0]) if self.mirrored else np.ones(3)
        n, u = self.R.apply(normal * flip), self.R.apply(face * flip)
        c = self.R.apply(centre * flip) + self.shift
        sign, r = self.rng.choice([-1.0, 1.0]), self.with_centre
        across = np.eye(3) - np.outer(n, n)
        place = np.hstack([self.centre_m * np.eye(3), np.zeros((3, 1))])
        turn = float(self.u_turn or 0.0) * np.array([r, 0.0, 0.0, np.sqrt(1.0 - r * r)])
        components = (
            UncertaintyComponent(
                "plane noise", np.vstack([self.normal_rad * root(across), np.zeros((3, 3))])
            ),
            UncertaintyComponent(
                "centre noise", np.vstack([np.zeros((3, 4)), place]), turn=sign * turn
            ),
            *self.extra,
        )
        drawn = [self.rng.normal(size=e.factor.shape[1]) for e in components]
        moved = self.noise * sum(e.factor @ d for e, d in zip(components, drawn, strict=True))
        about = self.noise * sum(
            sign * e.turn @ d for e, d in zip(components, drawn, strict=True) if e.turn is not None
        )
        u = Rotation.from_rotvec(np.cross(n, moved[:3]) + about * n).apply(u)
        n = (n + moved[:3]) / np.linalg.norm(n + moved[:3])
        periods = self.rng.integers(round(2.0 * np.pi / self.period))
        u = Rotation.from_rotvec(periods * self.period * n).apply(u - n * (n @ u))
        seen = InPlaneRotation("edges", u / np.linalg.norm(u), self.period)
        return TargetFit(c + moved[3:], sign * n, components, 8e-4, 1000, "rim", turn=seen)


def kingpin(wheel: str, caster: float, inclination: float) -> np.ndarray:
    """Unit vector upwards: top backwards by caster, inwards by inclination, as projected."""
    axis = np.array([-np.tan(caster), -side(wheel) * np.tan(inclination), 1.0])
    return axis / np.linalg.norm(axis)


def swept(
    scene: Scene, wheel: str, caster: float, inclination: float, steers, *,
    toe=0.0, camber=-0.01, inwards=0.12, ahead=-0.02, plate=None, positions=None, slips=None,
) -> Scene:  # fmt: skip
    """See the wheel turned about its kingpin by `steers`, radians about it, > 0 to the left.

    The axis passes `inwards` of the reference centre and `ahead` of it, at its height. plate: a
    turn of the plate on the wheel, so that its normal is not the wheel's. slips: of each scan, by
    what the plate lies turned about its own normal; None where it shows no turn.
    """
    axis = kingpin(wheel, caster, inclination)
    centre = np.array(PLACES[wheel])
    point = centre + np.array([ahead, -side(wheel) * inwards, 0.0])
    normal = facing(wheel, toe, camber)
    if plate is not None:
        normal = plate.apply(normal)
    face = np.cross(normal, [0.6, 0.0, 0.8])
    face /= np.linalg.norm(face)
    for i, steer in enumerate(steers):
        R = Rotation.from_rotvec(steer * axis)
        where = Turn(position=None if positions is None else positions[i])
        slip = 0.0 if slips is None else slips[i]
        shown = None if slip is None else R.apply(Rotation.from_rotvec(slip * normal).apply(face))
        scene.look(
            f"{wheel} {i}", "sweep", wheel, point + R.apply(centre - point), R.apply(normal),
            where, face=shown,
        )  # fmt: skip
    return scene


def across_axle(wheel: str, toe: float, camber: float) -> tuple[np.ndarray, np.ndarray]:
    """Unit vectors across a wheel's axle, forwards and upwards."""
    axle = facing(wheel, toe, camber)
    fore = np.cross([0.0, 0.0, 1.0], axle) * -side(wheel)
    fore /= np.linalg.norm(fore)
    return fore, np.cross(fore, axle) * side(wheel)


def leaning(wheel: str, toe: float, camber: float, wobble) -> Rotation:
    """From the axle to the normal of a plate that leans by `wobble`, forwards and upwards."""
    fore, top = across_axle(wheel, toe, camber)
    off = wobble[0] * fore + wobble[1] * top
    return Rotation.from_rotvec(np.cross(facing(wheel, toe, camber), off))


def rolled(
    scene: Scene, wheel: str, turns, *, toe=0.003, camber=-0.012, wobble=(0.0, 0.0),
    eccentric_m=(0.0, 0.0), u_turn=0.0175, stated=None, with_reference=False, moves=None,
) -> Scene:  # fmt: skip
    """See the wheel turned about its axle by `turns`, radians, > 0 as it rolls forwards.

    wobble: lean of the plate's normal at no turn, forwards and upwards; eccentric_m alike. stated:
    what the user says of the turns. with_reference: the first is the reference scan.
    """
    axle, (fore, top) = facing(wheel, toe, camber), across_axle(wheel, toe, camber)
    plate = leaning(wheel, toe, camber, wobble).apply(axle)
    middle, aside = np.array(PLACES[wheel]), eccentric_m[0] * fore + eccentric_m[1] * top
    face = np.cross(plate, top)
    face /= np.linalg.norm(face)
    for i, turn in enumerate(turns):
        R = Rotation.from_rotvec(turn * side(wheel) * axle)
        shift = np.zeros(3) if moves is None else np.asarray(moves[i])
        said = Turn(angle_rad=float(turn if stated is None else stated[i]), u_rad=float(u_turn))
        first = with_reference and i == 0
        scene.look(
            f"{wheel} turn {i}", "runout", wheel, middle + R.apply(aside) + shift, R.apply(plate),
            said, f"{wheel}.ply" if first else "", R.apply(face),
        )  # fmt: skip
    return scene


def mounted(scene: Scene, wheel: str, **plate) -> Scene:
    """Replace the reference scan by one of the plate of `rolled`, at a rotation of its own."""
    seen = rolled(scene, wheel, [1.0], **plate).seen.pop()
    seen = replace(seen, name=wheel, role="reference", turn=None, source=f"{wheel}.ply")
    scene.seen[WHEELS.index(wheel)] = seen
    return scene
