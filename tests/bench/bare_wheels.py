"""Bare wheels: axis and centre against the rim's own axis, the spin axis, and usual ways.

.venv/bin/python -m tests.bench.bare_wheels [--kind one|yard|sparse|turned] [--wheels 200]
    [--first 0] [--keep DIR] [--today] [--million]

one: 0.8 mm noise, 1 mm spacing, one scan, against the rim's axis. yard: 3 mm, 4 mm, likewise.
sparse: 0.8 mm, 5 mm, 30 to 45 degrees off the axle, likewise.
turned: three scans at 0, 120 and 240 degrees, 0.5 mm run-out; the mean of the three axes against
the spin axis. Wheel number s is drawn from the seed s (tests/support/bare_wheels.py). Rubber has
three times the noise. A scan takes some 5 s; --keep DIR keeps the clouds. --today: besides, the
plane of the side wall by Open3D's segment_plane (3 mm, 1,000 iterations) and a circle fitted to the
rim, both on points cut out with the true radii. --million: time for a scan of a million points.
A centre by the tyre is compared with the tyre's widest ring, others with the flange's edge.
Angles in minutes of arc, lengths in mm; inside: within the 95 % interval by Student's t.
"""

from __future__ import annotations

import argparse
import os
import time
from collections.abc import Iterator
from pathlib import Path

for variable in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS"):
    os.environ.setdefault(variable, "1")

import numpy as np  # noqa: E402

from tests.support.bare_wheels import draw_bay  # noqa: E402
from wheelplane.errors import NotMeasuredError  # noqa: E402
from wheelplane.uncertainty import coverage_factor  # noqa: E402
from wheelplane.wheel.find_wheel import find_wheel  # noqa: E402
from wheelplane.wheel.fit_wheel import fit_wheel  # noqa: E402

MINUTE = np.radians(1.0 / 60.0)
TURNS = (0.0, 2.0 * np.pi / 3.0, 4.0 * np.pi / 3.0)
KINDS = {
    "one": ({"noise_m": 0.0008, "spacing_m": 0.001}, TURNS[:1]),
    "yard": ({"noise_m": 0.003, "spacing_m": 0.004}, TURNS[:1]),
    "sparse": ({"noise_m": 0.0008, "spacing_m": 0.005, "incidence_deg": (30.0, 45.0)}, TURNS[:1]),
    "turned": ({"noise_m": 0.0008, "spacing_m": 0.001, "rim_runout_m": 0.0005}, TURNS),
}


def scans_of(kind: str, seed: int, keep: Path | None) -> Iterator[dict[str, np.ndarray]]:
    """Yield points and true axes of each scan of a wheel."""
    given, turns = KINDS[kind]
    bay = None
    for number, turn in enumerate(turns):
        path = None if keep is None else keep / f"{kind}-{seed}-{number}.npz"
        if path is not None and path.is_file():
            yield dict(np.load(path))
            continue
        bay = draw_bay(seed, **given) if bay is None else bay
        scan = bay.scan(np.random.default_rng([seed, 5, number]), turn)
        names = {"points": scan.points_m.astype(np.float32), "up": scan.up}
        names |= {"rim": np.stack(scan.rim), "spin": np.stack(scan.spin)}
        names["widest"] = np.array(scan.drawn.widest_m)
        if path is not None:
            path.parent.mkdir(parents=True, exist_ok=True)
            np.savez(path, **names)
        yield names


def axes_across(axis: np.ndarray, up: np.ndarray) -> np.ndarray:
    """Level and upward directions across an axis, rows (2, 3)."""
    level = np.cross(up, axis)
    level /= np.linalg.norm(level)
    return np.stack([level, np.cross(axis, level)])


def errors(normal, centre, true, up) -> np.ndarray:
    """Toe, camber (rad), level, upward, axial (m) error of an axis and centre."""
    direction, place = true
    across = axes_across(direction, up)
    normal = normal * np.sign(normal @ direction)
    level = (place - centre) @ direction / (normal @ direction)
    off = centre + level * normal - place
    return np.concatenate([across @ (normal - direction), across @ off, [-level]])


def stated(fits, true, up) -> tuple[np.ndarray, np.ndarray]:
    """Standard uncertainties and coverage factors of the same five, of the mean of the fits."""
    direction = true[0]
    across = axes_across(direction, up)
    rows = np.zeros((5, 6))
    rows[:2, :3], rows[2:4, 3:], rows[4, 3:] = across, across, direction
    parts = [
        (np.sum((rows @ c.factor) ** 2, axis=1) / len(fits) ** 2, c.dof)
        for fit in fits
        for c in fit.components
    ]
    total = sum(part for part, _ in parts)
    loss = sum((part**2 / dof for part, dof in parts if np.isfinite(dof)), np.full(5, 1e-300))
    return np.sqrt(total), coverage_factor(0.95, total**2 / loss)


def side_wall_plane(points, true) -> np.ndarray:
    """Normal of the side wall's plane by Open3D."""
    import open3d

    radius, height = cylindrical(points, true)
    wall = points[(radius > 0.255) & (radius < 0.30) & (np.abs(height) < 0.03)]
    cloud = open3d.geometry.PointCloud(open3d.utility.Vector3dVector(wall))
    open3d.utility.random.seed(0)
    plane, _ = cloud.segment_plane(0.003, 3, 1000)
    return plane[:3] / np.linalg.norm(plane[:3])


def rim_circle(points, true, edge_m) -> tuple[np.ndarray, np.ndarray]:
    """Plane and centre of a circle by least squares, of the points on the flange's edge."""
    radius, height = cylindrical(points, true)
    ring = points[(np.abs(radius - edge_m) < 0.003) & (np.abs(height) < 0.005)]
    middle = ring.mean(axis=0)
    normal = np.linalg.svd(ring - middle, full_matrices=False)[2][2]
    across = axes_across(normal, np.array([0.3, 0.5, 0.8]))
    uv = (ring - middle) @ across.T
    solved = np.linalg.lstsq(np.column_stack([uv, np.ones(len(uv))]), np.sum(uv**2, axis=1))[0]
    return normal, middle + 0.5 * solved[:2] @ across


def cylindrical(points, true) -> tuple[np.ndarray, np.ndarray]:
    local = points - true[1]
    height = local @ true[0]
    return np.sqrt(np.maximum(np.einsum("ij,ij->i", local, local) - height**2, 0.0)), height


def line(name: str, rows: list[np.ndarray]) -> str:
    """Root mean square and worst error of each of the five."""
    table = np.abs(np.stack(rows)) / ([MINUTE] * 2 + [1e-3] * 3)
    rms = np.sqrt(np.mean(table**2, axis=0))
    numbers = (f"{a:.2f} ({b:.2f})" for a, b in zip(rms, table.max(axis=0), strict=True))
    return f"{name:28s}" + "".join(f"{one:>18s}" for one in numbers)


def run(kind: str, wheels: range, keep: Path | None, *, today: bool) -> None:
    """Print the errors of one kind of scan."""
    found, inside, walls, circles = [], [], [], []
    failed = tyres = 0
    seconds = []
    for seed in wheels:
        scans = list(scans_of(kind, seed, keep))
        clouds = [scan["points"].astype(np.float64) for scan in scans]
        start = time.process_time()
        try:
            fits = [fit_wheel(find_wheel(points), None) for points in clouds]
        except NotMeasuredError as error:
            failed += 1
            print(f"wheel {seed}: {error.status}: {error}", flush=True)
            continue
        seconds.append((time.process_time() - start) / len(fits))
        tyres += any(fit.method == "tyre" for fit in fits)
        true, up = scans[0]["spin" if kind == "turned" else "rim"], scans[0]["up"]
        normals = [fit.normal * np.sign(fit.normal @ true[0]) for fit in fits]
        off_tyre = [scans[0]["widest"] if fit.method == "tyre" else 0.0 for fit in fits]
        centres = [f.centre_m - m * n for f, m, n in zip(fits, off_tyre, normals, strict=True)]
        normal, centre = np.mean(normals, axis=0), np.mean(centres, axis=0)
        off = errors(normal / np.linalg.norm(normal), centre, true, up)
        u, k = stated(fits, true, up)
        found.append(off)
        inside.append(np.abs(off) < k * u)
        if today:
            wall = side_wall_plane(clouds[0], true)
            walls.append(errors(wall, true[1], true, up))
            edge = draw_bay(seed, **KINDS[kind][0]).drawn
            circles.append(errors(*rim_circle(clouds[0], true, edge.edge_m), true, up))
    print(f"{kind}: {len(found)} wheels, {failed} not measured, {tyres} by the tyre; rms (worst)")
    names = ("toe '", "camber '", "level mm", "upward mm", "axial mm")
    print(" " * 28 + "".join(f"{one:>18s}" for one in names))
    print(line("wheelplane", found))
    shares = np.mean(np.stack(inside), axis=0)
    print(f"{'inside':28s}" + "".join(f"{one:>18.1%}" for one in shares))
    print(f"inside, toe, camber, level and upward together: {np.mean(np.stack(inside)[:, :4]):.1%}")
    print(f"processor time a scan: {np.mean(seconds):.2f} s, {max(seconds):.2f} s at most")
    if today:
        print(line("side wall, segment_plane", walls))
        print(line("circle of the rim", circles))


def million() -> None:
    """Print the time for a scan of about a million points."""
    scan = draw_bay(1, spacing_m=0.00073).scan(np.random.default_rng(1))
    for _ in range(3):
        start, used = time.perf_counter(), time.process_time()
        fit_wheel(find_wheel(scan.points_m), None)
        wall, used = time.perf_counter() - start, time.process_time() - used
        print(f"{len(scan.points_m)} points: {wall:.2f} s, {used:.2f} s of the processor")


def main() -> None:
    """Run from the command line."""
    parser = argparse.ArgumentParser()
    parser.add_argument("--kind", choices=KINDS, default="one")
    parser.add_argument("--wheels", type=int, default=200)
    parser.add_argument("--first", type=int, default=0)
    parser.add_argument("--keep", type=Path)
    parser.add_argument("--today", action="store_true")
    parser.add_argument("--million", action="store_true")
    given = parser.parse_args()
    if given.million:
        million()
        return
    wheels = range(given.first, given.first + given.wheels)
    run(given.kind, wheels, given.keep, today=given.today)


if __name__ == "__main__":
    main()
