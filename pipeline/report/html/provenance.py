"""Where a report's figures come from: head, wheels' scans, statuses, files, settings."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from typing import Any

import numpy as np

from ...measurement import Conformity, Measurement, WheelResult
from ...system import frozen
from ..format.language import Translations
from ..format.writer import NONE, Table, Writer
from ..json.conformity import tolerance_tree
from ..tables.wheels import found_by

Pairs = list[tuple[str, str]]
SIZES = ("diameter", "side", "width", "height", "hole_diameter", "hole_spacing", "pitch")


@frozen
class Trouble:
    """Something not measured: its status in plain words, the program's own, and what to do."""

    name: str
    status: str
    means: str
    said: str
    todo: str


def methods(measurement: Measurement, words: Translations) -> str:
    """Return how targets, bare wheels or both were measured."""
    if is_five_point(measurement):
        return words("conventions.five_method")
    known = [wheel.observation.evidence for wheel in measurement.wheels]
    bare = {evidence.target.is_bare_wheel for evidence in known if evidence is not None}
    return " ".join(
        words(f"conventions.{'bare' if one else 'scan'}_method") for one in sorted(bare)
    )


def head_pairs(measurement: Measurement, number: str, words: Translations) -> Pairs:
    """Return what was measured, from what, and the report's number."""
    made = measurement.provenance
    targets = made.config.get("target"), made.config.get("targets", {})
    pairs = [
        (words("head.vehicle"), made.vehicle or words("head.no_vehicle")),
        (words("head.capture"), made.source),
        (words("head.date"), made.date or ""),
        (words("head.scans"), _scans(measurement, words)),
        (words("head.target"), _targets(*targets, words)),
        (words("head.report"), number),
    ]
    return [(name, value) for name, value in pairs if value]


def _scans(measurement: Measurement, words: Translations) -> str:
    read = measurement.points_read
    if is_five_point(measurement):
        return words("head.scans_five", planes=len(read))
    points = words.count(sum(read.values()))
    if measurement.provenance.naming is None:
        return words("head.scans_of", points=points, count=len(read))
    if len(read) == 1:
        return words("head.scans_cloud", points=points)
    return words("head.scans_clouds", points=points, count=len(read))


def is_five_point(measurement: Measurement) -> bool:
    """Return whether the measurement comes from five points a plane."""
    return measurement.wheels[0].observation.fitted.method == "points"


def _targets(
    common: Mapping[str, Any] | None, own: Mapping[str, Mapping[str, Any]], words: Translations
) -> str:
    """Return the common target, and those of single scans."""
    if common is None:
        return ""
    others = [f"{words.wheel(name)}: {_compact(one, words)}" for name, one in own.items()]
    return "; ".join([_compact(common, words), *others])


def _compact(target: Mapping[str, Any], words: Translations) -> str:
    """Return shape and sizes of a target, in mm."""
    shape = words.known("target", str(target.get("shape")))
    lengths = ((key, target[key]) for key in SIZES if isinstance(target.get(key), float))
    sizes = (f"{words.known('target', key)} {value * 1e3:g} mm" for key, value in lengths)
    return words.number(", ".join([shape, *sizes]))


def wheel_facts(result: WheelResult, writer: Writer) -> Pairs:
    """Return the facts of one scan and of its target."""
    words, seen = writer.words, result.observation
    pairs = [(words("wheel.file"), seen.source)]
    if seen.evidence is None:
        return pairs
    target, plane = seen.evidence.target, seen.evidence.plane
    bare = "_bare" * target.is_bare_wheel
    used = words("wheel.points_of", used=words.count(target.points_on_target),
                 total=words.count(seen.points_total))  # fmt: skip
    pairs += [
        (words(f"wheel.points{bare}"), used),
        (words(f"wheel.rms{bare}"), writer.millimetres(target.plane_rms_m)),
    ]
    if plane is not None:
        part = plane.correlated
        over = words("wheel.correlated_over", size=writer.millimetres(part.sigma_m),
                     length=words.number(f"{part.length_m * 1e3:.0f} mm"))  # fmt: skip
        tilt = words("wheel.tilt_of", size=writer.size(plane.tilt_rad, "rad"),
                     independent=writer.size(plane.tilt_if_independent_rad, "rad"))  # fmt: skip
        pairs += [
            (words("wheel.noise"), writer.millimetres(plane.sigma_m)),
            (words("wheel.correlated"), over if part.sigma_m > 0.0 else
             words("wheel.correlated_none")),
            (words("wheel.effective"), words.count(round(plane.effective_count))),
            (words("wheel.tilt"), tilt),
        ]  # fmt: skip
    largest = np.linalg.eigvalsh(target.centre_covariance_m2)[-1].clip(min=0.0)
    pairs += [
        (words("wheel.centre"), writer.size(math.sqrt(largest), "m")),
        (words("wheel.method"), found_by(seen, words)),
    ]
    if target.marker_ids:
        pairs.append((words("wheel.markers"), ", ".join(map(str, target.marker_ids))))
    return pairs


def troubles(measurement: Measurement, words: Translations) -> list[Trouble]:
    """Return everything with another status than ok, wheels first."""
    seen = [w.observation for w in measurement.wheels]
    found = [(words.wheel(s.name), s.status, s.reason) for s in seen]
    found += [(words("scene.kingpin", wheel=words.wheel(k.wheel)), k.status, k.reason)
              for k in measurement.steering_axes]  # fmt: skip
    found += [(f"{words('turned.turn')} {words(f'turned.turn_{t.turn}')}", t.status, t.reason)
              for t in measurement.toe_out]  # fmt: skip
    found += [(f"{words.known('role', 'runout')} {words.wheel(r.wheel)}", r.status, r.reason)
              for r in measurement.runouts]  # fmt: skip
    return [trouble(*one, words) for one in found if one[1] != "ok"]


def trouble(name: str, status: str, said: str, words: Translations) -> Trouble:
    """Return a status in plain words."""
    key = status.replace("-", "_")
    means, todo = (
        words(f"status.{key if f'status.{key}_{part}' in words.texts else 'other'}_{part}")
        for part in ("means", "do")
    )
    return Trouble(name, words.known("status", status), means, said, todo)


def inputs_table(measurement: Measurement, words: Translations) -> Table:
    """Return the table of input files with their digests."""
    rows = [[name, digest.removeprefix("sha256:")] for name, digest in
            measurement.provenance.inputs.items()]  # fmt: skip
    return Table((words("origin.file"), words("origin.digest")), rows, 2, words("origin.inputs"))


def settings(measurement: Measurement, conformity: Conformity | None) -> Pairs:
    """Return name and value of every setting in effect, as their files write them."""
    made = measurement.provenance
    tree = {**made.config, **tolerance_tree(conformity), "seed": made.seed}
    return list(_flat(tree))


def _flat(tree: Mapping[str, Any], before: str = "") -> Iterator[tuple[str, str]]:
    for key, value in tree.items():
        if isinstance(value, Mapping):
            yield from _flat(value, f"{before}{key}.")
        else:
            yield f"{before}{key}", NONE if value is None else _setting(value)


def _setting(value: object) -> str:
    if isinstance(value, bool):
        return str(value).lower()
    return f"{value:.12g}" if isinstance(value, float) else str(value)
