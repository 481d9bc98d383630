"""Rate of targets found in hard scenes: four on a vehicle, one on a wheel; and the failures.

    .venv/bin/python -m tests.bench.detection [--scenes 200] [--wheels 200] [--first 0]

Scenes of tests/support/vehicle_scenes.py, replayed by their number. A target is found correctly
within 2 % of its radius and 0.5 degrees of the truth, after plane and centre are fitted. One that
could not be measured has a status, as has a vehicle whose wheels cannot be identified; one that is
wrong without a status is the worst outcome.
"""

from __future__ import annotations

import argparse
import os
import time
from collections import Counter
from collections.abc import Callable, Sequence
from dataclasses import dataclass

os.environ["OMP_NUM_THREADS"] = os.environ["OPENBLAS_NUM_THREADS"] = "1"  # as the command

import numpy as np

from tests.support.vehicle_scenes import RADIUS_M, Scene, TrueFace, hard_wheel, vehicle_scene
from wheelplane.centre.locate_centre import locate_centre
from wheelplane.centre.target_view import TargetView
from wheelplane.config import Config
from wheelplane.detection.find_target import find_target
from wheelplane.detection.find_targets import find_targets
from wheelplane.detection.identify_wheels import find_axles
from wheelplane.detection.vehicles import FoundTarget
from wheelplane.errors import InputError, NotMeasuredError
from wheelplane.plane.fit_plane import fit_plane
from wheelplane.plane.patch import Patch
from wheelplane.targets.plates import DiscTarget

CONFIG = Config()
DISC = DiscTarget(shape="disc", diameter=2.0 * RADIUS_M)
NEAR_M, NEAR_RAD = 0.02 * RADIUS_M, np.radians(0.5)


@dataclass(frozen=True)
class Found:
    """A face that was found: status 'ok', with centre and normal, or why it was not measured."""

    status: str
    reason: str
    centre_m: np.ndarray
    normal: np.ndarray

    def shows(self, face: TrueFace) -> bool:
        """Whether it is that face, to within the limits."""
        return self.off_m(face) < NEAR_M and self.off_rad(face) < NEAR_RAD

    def off_m(self, face: TrueFace) -> float:
        return float(np.linalg.norm(self.centre_m - face.centre_m))

    def off_rad(self, face: TrueFace) -> float:
        across = np.linalg.norm(np.cross(self.normal, face.normal))
        return float(np.arctan2(across, self.normal @ face.normal))


@dataclass(frozen=True)
class Verdict:
    """right: faces found right. wrong: measured, but no true face's. faults: a line each."""

    right: int
    wrong: int
    faults: tuple[str, ...]


def measured(patch: Patch) -> Found:
    """Plane and centre of a patch, or why not."""
    try:
        plane = fit_plane(patch, DISC, CONFIG.plane)
        fitted = locate_centre(TargetView(patch, plane, DISC, CONFIG.centre))
    except NotMeasuredError as error:
        return Found(error.status, str(error), patch.origin_m, patch.basis[2])
    return Found("ok", "", fitted.centre_m, fitted.normal)


def find_on_vehicle(scene: Scene) -> list[Found]:
    """The faces that stand as a vehicle's wheels; all of them, with a status, where none do."""
    patches = find_targets(
        scene.points_m, DISC, CONFIG.segment, parts=scene.parts, stations_m=scene.stations_m
    )
    faces = [FoundTarget(patch.origin_m, patch.basis[2], patch.match) for patch in patches]
    try:
        axles = find_axles(faces, RADIUS_M)
    except InputError as error:
        return [Found("refused", str(error), face.centre_m, face.normal) for face in faces]
    return [measured(patches[i]) for i in range(len(patches)) if i not in axles.left_out]


def find_on_wheel(scene: Scene) -> list[Found]:
    """The one face of a wheel's scan."""
    try:
        return [measured(find_target(scene.points_m, DISC, CONFIG.segment, 0))]
    except NotMeasuredError as error:
        return [Found(error.status, str(error), np.full(3, np.nan), np.full(3, np.nan))]


def judge(faces: Sequence[TrueFace], found: Sequence[Found]) -> Verdict:
    """What was found against what is true."""
    good = [item for item in found if item.status == "ok"]
    faults, right = [], 0
    for face in faces:
        shown = [item for item in good if item.shows(face)]
        right += bool(shown)
        if not shown:
            faults.append(
                f"{face.name} ({face.hardship}, {face.points} points): {_why(face, found)}"
            )
    wrong = sum(not any(item.shows(face) for face in faces) for item in good)
    for item in good:
        if not any(item.shows(face) for face in faces):
            faults.append(f"wrong without a status: {_where(item, faces)}")
    extra = len(found) - right - wrong - sum(item.status != "ok" for item in found)
    if extra:
        faults.append(f"{extra} faces found twice")
    return Verdict(right, wrong + extra, tuple(faults))


def _why(face: TrueFace, found: Sequence[Found]) -> str:
    near = [item for item in found if not item.off_m(face) > 2.0 * RADIUS_M]
    if not near:
        return "; ".join(["not found", *(f"{item.status}: {item.reason}" for item in found[:1])])
    item = min(near, key=lambda item: np.nan_to_num(item.off_m(face), nan=np.inf))
    off = f"off by {item.off_m(face) * 1e3:.2f} mm, {np.degrees(item.off_rad(face)):.2f} degrees"
    if item.normal @ face.normal < 0.0:
        off += " (the normal points away from the scanner)"
    return off if item.status == "ok" else f"{item.status}: {item.reason}; {off}"


def _where(item: Found, faces: Sequence[TrueFace]) -> str:
    if not faces:
        return "there is no target"
    face = min(faces, key=item.off_m)
    return (
        f"{item.off_m(face) * 1e3:.1f} mm and {np.degrees(item.off_rad(face)):.2f} degrees "
        f"off {face.name} ({face.hardship})"
    )


def run(
    kind: str,
    numbers: Sequence[int],
    draw: Callable[[int], Scene],
    find: Callable[[Scene], list[Found]],
) -> None:
    """Draw, find, judge and print."""
    whole, wrong, seconds, failed = 0, 0, 0.0, Counter[str]()
    for number in numbers:
        scene = draw(number)
        start = time.perf_counter()
        found = find(scene)
        seconds += time.perf_counter() - start
        verdict = judge(scene.faces, found)
        whole += not verdict.faults
        wrong += verdict.wrong
        failed.update(face.hardship for face in scene.faces if not _shown(face, found))
        for fault in verdict.faults:
            print(
                f"{kind} {number} [{scene.note}, {len(scene.points_m)} points] {fault}", flush=True
            )
    count = max(len(numbers), 1)
    print(
        f"{kind}: {whole} of {len(numbers)} right ({whole / count:.1%}), {wrong} wrong without a "
        f"status, {seconds / count:.2f} s each; faces missed by hardship: {dict(failed)}"
    )


def _shown(face: TrueFace, found: Sequence[Found]) -> bool:
    return any(item.status == "ok" and item.shows(face) for item in found)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--scenes", type=int, default=200)
    parser.add_argument("--wheels", type=int, default=200)
    parser.add_argument("--first", type=int, default=0)
    options = parser.parse_args()
    first = options.first
    run("wheel", range(first, first + options.wheels), hard_wheel, find_on_wheel)
    run("vehicle", range(first, first + options.scenes), vehicle_scene, find_on_vehicle)


if __name__ == "__main__":
    main()
