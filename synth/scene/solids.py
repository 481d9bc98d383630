"""Solids of triangles; the only file of the generator that imports trimesh."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import Any

import numpy as np
import numpy.typing as npt

from ..arrays import Array, Mask

# Adjacent facets that meet at less than this angle belong to one smooth surface.
CREASE_RAD = np.radians(20.0)
# Solids are revolved so much larger, which keeps every digit: small facets would be left out.
ENLARGED = 1024.0


@dataclass(frozen=True)
class Solid:
    """Triangles of one material.

    vertices_m: (V, 3). faces: (F, 3) indices. surface: (F,) number of the smooth surface.
    front: (F,) True for the measured face of a target, exactly on z = 0 in its own coordinates.
    material: name of a surface in the scanner file whose albedo may replace the reflectance.
    """

    vertices_m: Array
    faces: npt.NDArray[np.int64]
    surface: npt.NDArray[np.int64]
    front: Mask
    reflectance: float
    material: str = ""

    @property
    def corners_m(self) -> Array:
        """Corners of every facet, (F, 3, 3)."""
        return self.vertices_m[self.faces]

    def with_front(self, front: Mask) -> Solid:
        """Return the solid with these facets (F,) as the measured face, a surface of its own."""
        own = np.where(front, self.surface.max() + 1, self.surface)
        return replace(self, front=front, surface=own)

    def of(self, material: str) -> Solid:
        """Return the solid with its material."""
        return replace(self, material=material)

    def placed(self, T_to_from: Array) -> Solid:
        """Return the solid in other coordinates, T_to_from (4, 4), which may mirror it."""
        moved = self.vertices_m @ T_to_from[:3, :3].T + T_to_from[:3, 3]
        mirrored = np.linalg.det(T_to_from[:3, :3]) < 0.0
        faces = self.faces[:, ::-1] if mirrored else self.faces  # seen from outside as before
        return replace(self, vertices_m=moved, faces=faces)


def revolved(profile: Sequence[tuple[float, float]], sections: int, reflectance: float) -> Solid:
    """Build a solid of revolution of a profile (radius, z) about z."""
    from trimesh.creation import revolve

    mesh = revolve(np.array(profile) * ENLARGED, sections=sections)
    mesh.vertices = mesh.vertices / ENLARGED
    return _solid(mesh, reflectance)


def box(low_m: Sequence[float], high_m: Sequence[float], reflectance: float) -> Solid:
    """Build an upright box between two corners."""
    from trimesh.creation import box as trimesh_box

    return _solid(trimesh_box(bounds=[low_m, high_m]), reflectance)


def bevelled(half_m: Array, depth_m: float, edge_m: Array, reflectance: float) -> Solid:
    """Build a box of half widths (2,), top on z = 0, whose top's edges have a convex profile.

    edge_m: from the sides to the top: distance from the side, and z (K, 2).
    """
    from trimesh import Trimesh

    corners = np.array([[1.0, 1.0], [-1.0, 1.0], [-1.0, -1.0], [1.0, -1.0]])
    rings = [
        _at(corners * half_m, -depth_m),
        *(_at(corners * (half_m - x), z) for x, z in edge_m.tolist()),
    ]
    return _solid(Trimesh(np.vstack(rings)).convex_hull, reflectance)


def arch_panel(
    spread_rad: tuple[float, float],
    radius_m: float,
    extent_m: tuple[float, float, float],
    depth_m: float,
    reflectance: float,
) -> Solid:
    """Build a flat panel on z = 0 with a round cut-out about the origin, flanged inwards by depth.

    It spans polar angles `spread_rad` between the cut-out and a rectangle that reaches `extent_m`
    = (right, left, top) in x and y; its lower edge is a radius.
    """
    from trimesh import Trimesh

    right, left, top = extent_m
    corners = [np.arctan2(top, right), np.arctan2(top, -left)]
    angles = np.union1d(
        np.linspace(*spread_rad, 180), [a for a in corners if _inside(a, spread_rad)]
    )
    way = np.column_stack([np.cos(angles), np.sin(angles)])
    side_m = np.where(way[:, 0] >= 0, right, left) / np.maximum(np.abs(way[:, 0]), 1e-9)
    top_m = np.where(way[:, 1] > 1e-9, top / np.maximum(way[:, 1], 1e-9), np.inf)
    reach = np.minimum(side_m, top_m)
    rings = [(way * radius_m, -depth_m), (way * radius_m, 0.0), (way * reach[:, None], 0.0)]
    vertices = np.vstack([np.column_stack([xy, np.full(len(xy), z)]) for xy, z in rings])
    n = len(angles)
    start = np.concatenate([np.arange(n - 1), n + np.arange(n - 1)])
    faces = np.vstack(
        [np.column_stack([start, start + n, start + 1]),
         np.column_stack([start + 1, start + n, start + n + 1])]
    )  # fmt: skip
    return _solid(Trimesh(vertices, faces, process=False), reflectance)


def ruled(one_m: Array, other_m: Array, reflectance: float) -> Solid:
    """Build the ruled surface between the corresponding points of one (N, 3) and other (N, 3)."""
    from trimesh import Trimesh

    n = len(one_m)
    start = np.arange(n - 1)
    faces = np.vstack(
        [np.column_stack([start, start + 1, start + n]),
         np.column_stack([start + 1, start + n + 1, start + n])]
    )  # fmt: skip
    return _solid(Trimesh(np.vstack([one_m, other_m]), faces, process=False), reflectance)


def punched(
    side_m: float,
    middle_m: float,
    radius_m: float,
    depth_m: float,
    edge_m: Array,
    sections: int,
    reflectance: float,
) -> Solid:
    """Build a panel from the origin to (side, side), top on z = 0, with a round hole through it.

    The hole's centre is (middle, middle); hole and outer sides have walls `depth_m` deep, the
    sides through the origin have none. edge_m: profile of the top's edges, about the hole and along
    the outer sides, from the walls to the top: distance from the wall, and z (K, 2).
    """
    from trimesh import Trimesh

    levels = [(0.0, -depth_m), *edge_m.tolist()]
    ends_m = side_m - np.unique([levels[0][0], levels[-1][0]])
    corners = [
        np.arctan2(*(np.array([[0, 0, 1, 1], [0, 1, 1, 0]]) * end - middle_m)) for end in ends_m
    ]
    turns = 2 * np.pi * np.arange(sections) / sections
    turn = np.union1d(np.arctan2(np.sin(turns), np.cos(turns)), np.concatenate(corners))
    turn = np.append(turn, turn[0])
    way = np.column_stack([np.cos(turn), np.sin(turn)])

    def outer(x_m: float, z_m: float) -> Array:
        """Return where the rays from the hole's centre leave the panel, x inside its sides."""
        sides_m = np.where(way > 0, side_m - x_m - middle_m, middle_m)
        free_m = np.min(sides_m / np.maximum(np.abs(way), 1e-12), axis=1)
        return _at(middle_m + way * free_m[:, None], z_m)

    rims = [_at(middle_m + (radius_m + x) * way, z) for x, z in levels]
    rings = [outer(*levels[0]), *rims, outer(*levels[-1])]
    n = len(turn)
    start = np.concatenate([k * n + np.arange(n - 1) for k in range(len(rings) - 1)])
    faces = np.vstack(
        [np.column_stack([start, start + n, start + 1]),
         np.column_stack([start + 1, start + n, start + n + 1])]
    )  # fmt: skip
    panel = _solid(Trimesh(np.vstack(rings), faces, process=False), reflectance)
    sides = [
        _at(np.array([[side_m - x, 0.0], [side_m - x, side_m - x], [0.0, side_m - x]]), z)
        for x, z in levels
    ]
    walls = [ruled(lower, upper, reflectance) for lower, upper in pairwise(sides)]
    whole, _ = joined([panel, *walls])
    return replace(whole, reflectance=reflectance)


def ellipsoid(centre_m: Sequence[float], half_m: Sequence[float], reflectance: float) -> Solid:
    """Build an ellipsoid with these half axes along x, y, z."""
    turn = np.linspace(0.0, np.pi, 49)
    profile = list(zip(np.sin(turn), -np.cos(turn), strict=True))
    pose = np.eye(4)
    pose[:3, :3], pose[:3, 3] = np.diag(half_m), centre_m
    return revolved(profile, 72, reflectance).placed(pose)


def joined(solids: Sequence[Solid]) -> tuple[Solid, Array]:
    """Join all solids to one; return it with the reflectance of each facet (F,)."""
    first_vertex = np.cumsum([0] + [len(s.vertices_m) for s in solids])
    first_surface = np.cumsum([0] + [int(s.surface.max()) + 1 for s in solids])
    whole = Solid(
        np.vstack([s.vertices_m for s in solids]),
        np.vstack([s.faces + k for s, k in zip(solids, first_vertex, strict=False)]),
        np.concatenate([s.surface + k for s, k in zip(solids, first_surface, strict=False)]),
        np.concatenate([s.front for s in solids]),
        float("nan"),
    )
    return whole, np.concatenate([np.full(len(s.faces), s.reflectance) for s in solids])


def _at(xy_m: Array, z_m: float) -> Array:
    return np.column_stack([xy_m, np.full(len(xy_m), z_m)])


def _inside(angle: float, spread_rad: tuple[float, float]) -> bool:
    return spread_rad[0] < angle < spread_rad[1]


def _solid(mesh: Any, reflectance: float) -> Solid:
    """Convert a mesh of trimesh to arrays, without its facets of no area."""
    from trimesh.graph import connected_component_labels

    mesh.update_faces(mesh.area_faces > 1e-14)
    smooth = mesh.face_adjacency[mesh.face_adjacency_angles < CREASE_RAD]
    labels = connected_component_labels(smooth, node_count=len(mesh.faces))
    faces = np.array(mesh.faces, dtype=np.int64)
    vertices = np.array(mesh.vertices, dtype=np.float64)
    surface = np.asarray(labels, dtype=np.int64)
    return Solid(vertices, faces, surface, np.zeros(len(faces), dtype=bool), reflectance)
