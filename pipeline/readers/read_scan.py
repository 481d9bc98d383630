"""Point-cloud files to scans: one row of READERS per format."""

from __future__ import annotations

import stat
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass
from pathlib import Path

from ..errors import InputError
from ..units import LENGTH_UNITS
from .e57.reader import read_e57
from .formats.las import read_las
from .formats.mesh import read_obj, read_stl, sample_obj, sample_stl
from .formats.npy import read_npy
from .formats.npz import read_npz
from .formats.pcd import read_pcd
from .formats.ply import read_ply
from .formats.pts import read_pts
from .formats.ptx import read_ptx
from .formats.text import read_text
from .gather import RowProgress, gather, silent
from .packed import unpacked
from .scan import Scan
from .signature import BINARY, E57, LAS, NPY, PCD, PLY, STL, TEXT, ZIP, looks_like
from .source import RawCloud, Source


@dataclass(frozen=True)
class Family:
    """Reader of a format, the signatures its files may begin with, and the sampler of a mesh."""

    read: Callable[[Source], RawCloud]
    signatures: tuple[str, ...]
    sample: Callable[[Source, int], RawCloud] | None = None


READERS = {
    ".ply": Family(read_ply, (PLY,)),
    ".pcd": Family(read_pcd, (PCD, TEXT)),
    ".ptx": Family(read_ptx, (TEXT,)),
    ".pts": Family(read_pts, (TEXT,)),
    ".e57": Family(read_e57, (E57,)),
    ".las": Family(read_las, (LAS,)),
    ".laz": Family(read_las, (LAS,)),
    ".xyz": Family(read_text, (TEXT,)),
    ".csv": Family(read_text, (TEXT,)),
    ".txt": Family(read_text, (TEXT,)),
    ".npy": Family(read_npy, (NPY,)),
    ".npz": Family(read_npz, (ZIP,)),
    ".stl": Family(read_stl, (STL, BINARY, TEXT), sample_stl),
    ".obj": Family(read_obj, (TEXT,), sample_obj),
}

MESH_SUFFIXES = tuple(suffix for suffix, family in READERS.items() if family.sample)


def read_scan(
    path: Path,
    length_unit: str = "m",
    name: str | None = None,
    *,
    sample: int | None = None,
    progress: RowProgress = silent,
) -> Scan:
    """Read a point cloud, plain, compressed, or the only one in a zip or tar; whole or not at all.

    length_unit: of the file's coordinates, "m", "mm" or "in"; never guessed.
    name: the file in messages; the path by default.
    sample: of a mesh, this many points of its surface instead of its vertices.
    progress: called with the number of rows read so far and the total.
    Raises InputError, one line, when the file is not exactly what it declares.
    """
    with open_cloud(path, length_unit, name, sample) as (cloud, source):
        return gather(cloud, source, length_unit, progress)


@contextmanager
def open_cloud(
    path: Path, length_unit: str = "m", name: str | None = None, sample: int | None = None
) -> Iterator[tuple[RawCloud, Source]]:
    """Open a cloud with its checked header, its blocks still to be read; errors are one line."""
    name = " ".join((name or str(path)).splitlines())
    if length_unit not in LENGTH_UNITS:
        known = ", ".join(LENGTH_UNITS)
        raise InputError(f"{name}: the length unit '{length_unit}' is unknown: use {known}")
    try:
        with ExitStack() as stack:
            yield _open(path, name, sample, stack)
    except FileNotFoundError:
        raise InputError(f"{name}: there is no such file: check the name") from None
    except PermissionError:
        raise InputError(
            f"{name}: no permission to read it: change the file's permissions"
        ) from None
    except MemoryError:
        raise InputError(
            f"{name}: the cloud does not fit into memory: thin it, or use a larger machine"
        ) from None
    except OSError as error:
        raise InputError(
            f"{name}: it cannot be read ({error.strerror}): check the path and the disk"
        ) from None


def _open(path: Path, name: str, sample: int | None, stack: ExitStack) -> tuple[RawCloud, Source]:
    _check_file(path, name)
    path, name = unpacked(path, name, READERS, stack)
    family = READERS.get(path.suffix.lower())
    if family is None:
        raise InputError(
            f"{name}: the suffix '{path.suffix}' is not of a known point cloud format: use one "
            f"of {' '.join(READERS)}, packed or not"
        )
    source = Source.open(path, name, stack)
    if source.size == 0:
        raise InputError(f"{name}: the file is empty: copy or export it again")
    kind = looks_like(source.stream.read(4096))
    if kind not in family.signatures:
        raise InputError(
            f"{name}: the suffix is '{path.suffix}', but it does not begin like "
            f"{family.signatures[0]}; it looks like {kind}: check the file or its suffix"
        )
    source.stream.seek(0)
    if sample is None:
        return family.read(source), source
    if family.sample is None:
        raise InputError(f"{name}: it is a cloud, not a mesh (.stl, .obj): leave out --sample")
    return family.sample(source, sample), source


def _check_file(path: Path, name: str) -> None:
    mode = path.stat().st_mode
    if stat.S_ISDIR(mode):
        raise InputError(f"{name}: it is a folder: name a scan file in it")
    if not stat.S_ISREG(mode):
        raise InputError(f"{name}: it is not a regular file: copy the scan to a file")
