"""What the tests of made scans share: parameter files, changed copies, and bounds."""

from __future__ import annotations

import copy
import json
import shutil
import tomllib
from pathlib import Path

import numpy as np
from scipy import stats

from tests.support.paths import CONFIGS
from wheelplane_synth.output.archive import write_capture
from wheelplane_synth.output.files import ply
from wheelplane_synth.parameters.parameters import Beam

SALOON = CONFIGS / "vehicles" / "saloon.toml"
DEFAULT = CONFIGS / "scanners" / "default.toml"
IDEAL = CONFIGS / "scanners" / "ideal.toml"
DISC = CONFIGS / "targets" / "disc-250.toml"
RADIUS_M = 0.125
# Of a plate as made: standard deviations of a radius or half a side, and of the thickness,
# relative; width of the chamfer, or radius of the edge, that deburring leaves, from 0 to it.
SIZE_M, THICKNESS, MOST_CHAMFER_M, MOST_EDGE_RADIUS_M = 0.0001, 0.03, 0.0005, 0.0007
# Parts of these by which plates of one drawing differ from each other; of their edges, too.
OF_SIZE, OF_THICKNESS, OF_EDGE = 0.7, 0.3, 0.2


def draw_edge(rng: np.random.Generator) -> tuple[float, bool]:
    """Width of a chamfer or radius of an edge that a shop leaves, and whether it is the latter."""
    share, is_round = float(rng.uniform()), bool(rng.uniform() < 0.5)
    return share * (MOST_EDGE_RADIUS_M if is_round else MOST_CHAMFER_M), is_round


def parted(rng: np.random.Generator, share: float, count: int) -> np.ndarray:
    """Unit deviations of plates, to two, of which a share is their own and the rest of all."""
    common, own = (np.clip(rng.standard_normal(n), -2.0, 2.0) for n in (1, count))
    return np.sqrt(1.0 - share**2) * common + share * own


def changed(path: Path, folder: Path, values: dict[str, object]) -> Path:
    """A copy of a parameter file with some of its values changed, or added."""
    tree = copy.deepcopy(tomllib.loads(path.read_text()))
    for key, value in values.items():
        table, _, name = key.rpartition(".")
        (tree[table] if table else tree)[name] = value
    copied = folder / f"{len(list(folder.iterdir()))}-{path.name}"
    copied.write_text(as_toml(tree))
    return copied


def as_toml(tree: dict[str, object]) -> str:
    """The text of a parameter file: its keys, then its tables of keys."""
    tables = {k: v for k, v in tree.items() if isinstance(v, dict)}
    lines = [f"{k} = {json.dumps(v)}" for k, v in tree.items() if k not in tables]
    for table, content in tables.items():
        lines += [f"[{table}]", *(f"{k} = {json.dumps(v)}" for k, v in content.items())]
    return "\n".join(lines) + "\n"


def write_small_capture(folder: Path, trials: int = 1, seed: int = 1) -> Path:
    """A capture of coarse scans, which are measured in a second."""
    text = DEFAULT.read_text()
    coarse = folder.parent / "coarse.toml"
    coarse.write_text(text.replace("0.0009", "0.004"))
    write_capture(
        folder,
        seed=seed,
        vehicle=SALOON,
        scanner=coarse,
        target=DISC,
        trials=trials,
    )
    return folder


def of_spot(radius_m: float, **more: object) -> Beam:
    """A beam without errors and with that footprint."""
    calm = dict.fromkeys(
        ("range_sigma_m", "angle_sigma_urad", "dropout_fraction", "stray_fraction"), 0.0
    )
    return Beam(**calm, intensity_sigma=0.0, spot_radius_m=radius_m, **more)


def read_ply(path: Path) -> tuple[np.ndarray, np.ndarray]:
    header, _, body = path.read_bytes().partition(b"end_header\n")
    assert b"format binary_little_endian 1.0" in header
    rows = np.frombuffer(body, dtype=[("p", "<f8", 3), ("i", "<f4")])
    assert f"element vertex {len(rows)}\n".encode() in header
    return rows["p"], rows["i"]


def chi_square_bounds(count: int) -> tuple[float, float]:
    low, high = stats.chi2.ppf([1e-6, 1 - 1e-6], count)
    return low, high


def with_second_target(folder: Path, centre_m: np.ndarray, raised_m: float) -> Path:
    """A copy beside a capture, with the target of FL a second time, above the first."""
    doubled = folder.parent / "doubled"
    shutil.copytree(folder, doubled)
    points, intensity = read_ply(doubled / "fl.ply")
    on = np.linalg.norm(points - centre_m, axis=1) < 1.02 * RADIUS_M
    raised = points[on] + [0.0, 0.0, raised_m]
    content = ply(np.vstack([points, raised]), np.concatenate([intensity, intensity[on]]))
    (doubled / "fl.ply").write_bytes(content)
    return doubled


def with_dense_tyre(folder: Path, times: int) -> Path:
    """A copy beside a capture, with that many points for each around the target of FL."""
    dense = folder.parent / "dense"
    shutil.copytree(folder, dense)
    points, intensity = read_ply(dense / "fl.ply")
    truth = json.loads((dense / "truth.json").read_text())
    (centre_m,) = (w["centre_m"] for w in truth["wheels"] if w["name"] == "FL")
    apart = np.linalg.norm(points - centre_m, axis=1)
    around = np.flatnonzero((apart > 1.3 * RADIUS_M) & (apart < 2.2 * RADIUS_M)).repeat(times - 1)
    noise = np.random.default_rng(1).normal(0.0, 0.002, (len(around), 3))
    content = ply(
        np.vstack([points, points[around] + noise]),
        np.concatenate([intensity, intensity[around]]),
    )
    (dense / "fl.ply").write_bytes(content)
    return dense


def as_one_cloud(folder: Path, cloud: Path) -> Path:
    """Write the four scans of a capture as one cloud."""
    scans = [read_ply(folder / f"{wheel}.ply") for wheel in ("rr", "rl", "fr", "fl")]
    cloud.write_bytes(ply(*(np.concatenate(part) for part in zip(*scans, strict=True))))
    return cloud
