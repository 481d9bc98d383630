"""NPZ reader: one array of points in a zip of NPY arrays, and optionally its intensities."""

from __future__ import annotations

import tempfile
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np

from ...files import Member, open_archive
from ..faults import fault
from ..source import Block, PointColumn, RawCloud, Source
from .npy import check_size, mapped, read_header, read_npy

_POINTS = ("points", "xyz")
_INTENSITY = "intensity"


def read_npz(source: Source) -> RawCloud:
    """Read the array called points or xyz, or the only one, and the one called intensity."""
    folder = Path(source.stack.enter_context(tempfile.TemporaryDirectory(prefix="wheelplane-")))
    with open_archive(source.path, source.name, folder) as archive:
        members = {member.name.removesuffix(".npy"): member for member in archive.members}
        intensity = members.pop(_INTENSITY, None)
        points = _choose(members, source)
        archive.unpack(folder, (points,) if intensity is None else (points, intensity))
    cloud = read_npy(_opened(folder, points, source), has_shade=intensity is None)
    if intensity is None:
        return cloud
    if cloud.has_intensity:
        raise fault(source, "it holds an intensity twice", "save x y z and intensity once")
    values = _vector(_opened(folder, intensity, source), cloud.rows)
    return replace(cloud, has_intensity=True, blocks=_with_intensity(cloud, values))


def _choose(members: dict[str, Member], source: Source) -> Member:
    named = [members[name] for name in _POINTS if name in members]
    if len(named) == 1:
        return named[0]
    if len(members) == 1:
        return next(iter(members.values()))
    held = ", ".join(members)[:120] or "none"
    raise fault(source, f"its arrays are {held}", "save the points as one array, `points`")


def _opened(folder: Path, member: Member, source: Source) -> Source:
    name = f"{source.name}: {member.name}"
    return Source.open(folder / member.name, name, source.stack, source.options)


def _vector(source: Source, rows: int) -> PointColumn:
    """Map an array of `rows` elements into memory, in their order."""
    header = read_header(source)
    if header.values != rows or header.dtype.names is not None:
        fact = f"it has the shape {header.shape}, the points are {rows}"
        raise fault(source, fact, "save an intensity for each point")
    check_size(source, header)
    return mapped(header, source).ravel() if rows else np.empty(0)


def _with_intensity(cloud: RawCloud, values: PointColumn) -> Iterator[Block]:
    done = 0
    for block in cloud.blocks:
        count = len(block.xyz[0])
        yield replace(block, intensity=values[done : done + count])
        done += count
