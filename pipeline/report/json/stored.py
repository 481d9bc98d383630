"""A measurement from its measurement.json: from the poses and their covariance, every angle anew.

What the file does not hold is missing: the points of the scans, the maps of the targets, the noise.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from ...capture import Turn, is_capture
from ...centre import InPlaneRotation, TargetFit
from ...errors import ConfigError, Doubt, InputError, fact_of
from ...kinematics import solve
from ...measurement import (
    Conformity,
    Evidence,
    Measurement,
    Naming,
    Observation,
    Provenance,
    SuspectPoint,
    Vertical,
    assess,
    evaluate,
    tolerance_of,
)
from ...uncertainty import MonteCarlo, UncertaintyComponent
from ...vectors import Array
from ..format.earlier import SCHEMA, read_tree
from .stated_values import check_stated_values

RECORD, HEAD_BYTES = "measurement.json", 200

Tree = Mapping[str, Any]


def is_measurement(path: Path) -> bool:
    """Return whether a file is a measurement.json, by its first bytes."""
    with path.open("rb") as stream:
        head = stream.read(HEAD_BYTES)
    return head.lstrip().startswith(b"{") and SCHEMA.encode() in head


def record_of(source: Path) -> Path | None:
    """Return the measurement.json that a source is, or that a folder without a capture holds."""
    if source.is_dir():
        record = source / RECORD
        return record if record.is_file() and not is_capture(source) else None
    return source if source.is_file() and is_measurement(source) else None


def read_measurement(path: Path, name: str) -> tuple[Measurement, Conformity | None]:
    """Read measurement.json, and assess it by its tolerance again.

    Raises InputError that names the file `name` and the fact, such as a stated angle that is not
    the one of the poses.
    """
    tree, _ = read_tree(path, name)
    if tree.get("frame") is None:
        raise InputError(f"{name}: the record of a capture that could not be measured: see `batch`")
    try:
        return _measurement(tree)
    except (ArithmeticError, AttributeError, LookupError, TypeError, ValueError, ConfigError,
            InputError, AssertionError, np.linalg.LinAlgError) as error:  # fmt: skip
        raise InputError(
            f"{name}: a measurement.json that is incomplete or was changed ({fact_of(error)}): "
            "measure that capture again"
        ) from error


def _measurement(tree: Tree) -> tuple[Measurement, Conformity | None]:
    poses = tree["poses"]["as_mounted"] or tree["poses"]["evaluated"]
    known = {pose["name"]: pose for pose in poses["wheels"]}
    components = _components(poses["components"])
    inputs = tree["provenance"]["inputs"]
    repeats = {scan: group["of"] for group in tree["repeats"] for scan in group["scans"]}
    observations = [
        _observation(wheel, known.get(wheel["name"]), components, inputs, repeats)
        for wheel in tree["wheels"]
    ]
    verticals = tuple(map(_vertical, tree["verticals"]))
    used = next((one for one in verticals if one.kind == tree["vertical_in_use"]), None)
    targets = [one.fitted for one in observations if one.evidence is not None]
    found = evaluate(observations, targets, _provenance(tree), _notes(tree), used)
    found = solve(replace(found, verticals=verticals))
    check_stated_values(tree, found)
    found = replace(found, monte_carlo=_monte_carlo(tree["monte_carlo"], found))
    limits = tree["provenance"]["config"].get("tolerance")
    return found, assess(found, tolerance_of(limits, "tolerance")) if limits else None


def _notes(tree: Tree) -> tuple[str, ...]:
    """Return the notes; those of doubt as such, so that no verdict rests on what they are about."""
    about = {one["note"]: one["trial"] for one in tree.get("doubts", ())}
    return tuple(_doubt(note, about[note]) if note in about else note for note in tree["notes"])


def _doubt(note: str, trial: str | None) -> Doubt:
    return Doubt("{note}", note=note) if trial is None else Doubt("{note}", note=note, trial=trial)


def _components(entries: Sequence[Tree]) -> dict[str, list[UncertaintyComponent]]:
    """Return the components of each target; those that act on several are shared."""
    found: dict[str, list[UncertaintyComponent]] = {}
    for number, entry in enumerate(entries):
        dof = entry["degrees_of_freedom"]
        for part in entry["acts_on"]:
            rows = np.array(part["factor"], float)
            component = UncertaintyComponent(
                entry["name"],
                rows[:6],
                math.inf if dof is None else float(dof),
                str(number) if len(entry["acts_on"]) > 1 else None,
                bool(entry["pooled"]),
                rows[6] if len(rows) > 6 else None,
            )
            found.setdefault(part["name"], []).append(component)
    return found


def _observation(
    wheel: Tree,
    pose: Tree | None,
    components: Mapping[str, list[UncertaintyComponent]],
    inputs: Mapping[str, str],
    repeats: Mapping[str, str],
) -> Observation:
    name, suspect = wheel["name"], wheel["suspect"]
    of = repeats.get(name, name)
    evidence = None if pose is None else Evidence(_target(wheel, pose, components.get(name, [])))
    return Observation(
        name=name,
        role=wheel["role"],
        wheel=wheel["wheel"],
        source=wheel["file"],
        sha256=inputs.get(wheel["file"], ""),
        points_total=wheel["points_total"],
        invalid_points=wheel["missing_returns"],
        repeats=None if of == name else of,
        evidence=evidence,
        status=wheel["status"],
        reason=wheel["reason"].partition("; without it ")[0],  # which is added anew
        turn=_turn(pose),
        suspect=None
        if suspect is None
        else SuspectPoint(suspect["point"], suspect["line"], np.array(suspect["off_m"])),
    )


def _target(wheel: Tree, pose: Tree, components: list[UncertaintyComponent]) -> TargetFit:
    axis = pose["in_plane_axis"]
    period = pose["in_plane_period_deg"]
    return TargetFit(
        centre_m=_three(pose["centre_m"]),
        normal=_three(pose["normal"]),
        components=tuple(components),
        plane_rms_m=wheel["plane_rms_m"],
        points_on_target=wheel["points_on_target"],
        method=wheel["centre_method"],
        marker_ids=tuple(wheel["marker_ids"]),
        turn=None
        if axis is None
        else InPlaneRotation("edges", _three(axis), math.radians(float(period))),
    )


def _turn(pose: Tree | None) -> Turn | None:
    if pose is None:
        return None
    angles = (pose["stated_rotation_deg"], pose["u_stated_rotation_deg"])
    turn = Turn(pose["position"], *(None if a is None else math.radians(a) for a in angles))
    return None if turn == Turn() else turn


def _vertical(tree: Tree) -> Vertical:
    components = []
    for entry in tree["components"]:
        tilt, dof = np.array(entry["factor"], float), entry["degrees_of_freedom"]
        factor = np.vstack([tilt, np.zeros_like(tilt)])
        dof = math.inf if dof is None else float(dof)
        components.append(
            UncertaintyComponent(entry["name"], factor, dof, pooled=bool(entry["pooled"]))
        )
    return Vertical(tree["kind"], _three(tree["direction"]), tuple(components), tree["by"])


def _provenance(tree: Tree) -> Provenance:
    origin, naming = tree["provenance"], tree["provenance"]["naming"]
    return Provenance(
        source=tree["capture"],
        vehicle=tree["vehicle_name"],
        version=origin["version"],
        inputs=dict(origin["inputs"]),
        config={key: value for key, value in origin["config"].items() if key != "tolerance"},
        seed=origin["seed"],
        naming=None if naming is None else Naming(naming["front"], naming["up"]),
        date=tree["date"],
    )


def _monte_carlo(tree: Tree | None, found: Measurement) -> MonteCarlo | None:
    if tree is None:
        return None
    scales = [1.0 if one["unit"] == "m" else math.radians(1.0) for one in tree["quantities"]]

    def column(key: str) -> Array:
        rows = zip(tree["quantities"], scales, strict=True)
        return np.array([scale * np.asarray(one[key], float) for one, scale in rows])

    formula = found.uncertainty.standard
    low, high = column("interval_95").T
    return MonteCarlo(
        draws=tree["trials"],
        mean=column("mean"),
        standard=column("u"),
        low=low,
        high=high,
        formula=formula,
        expanded=found.uncertainty.coverage_factor * formula,
        tolerance=np.full(len(low), np.nan),
        end_difference=column("apart"),
        status=tree["status"],
    )


def _three(values: Sequence[float]) -> Array:
    found = np.array(values, float)
    if found.shape != (3,) or not np.isfinite(found).all():
        raise ValueError(f"{values!r:.60} are not three finite numbers")
    return found
