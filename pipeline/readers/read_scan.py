"""Point-cloud files to scans: one row of READERS per format."""

from __future__ import annotations

import stat
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager
from importlib import import_module
from pathlib import Path
from typing import Any

from ..errors import InputError
from ..system import frozen
from ..units import LENGTH_UNITS
from .faults import fault
from .gather import RowProgress, gather, silent
from .memory import remedy
from .options import AS_THE_FILE_SAYS, ReadOptions
from .packed import as_utf8, unpacked
from .scan import Scan
from .signature import BINARY, E57, GLB, LAS, NPY, PCD, PLY, STL, TEXT, UTF16, ZIP, looks_like
from .source import RawCloud, Source


@frozen
class Family:
    """Format: its reader, the signatures its files may begin with, and the sampler of a mesh.

    reader, sampler: `MODULE:FUNCTION` within this room, loaded when a file is opened. takes:
    options that may be stated of its files; the others say all of themselves.
    """

    reader: str
    signatures: tuple[str, ...]
    sampler: str | None = None
    takes: tuple[str, ...] = ()

    def read(self, source: Source) -> RawCloud:
        """Return the cloud of an open file."""
        read: Callable[[Source], RawCloud] = _load(self.reader)
        return read(source)


_TEXT = Family("formats.text:read_text", (TEXT,), takes=("columns", "pitch"))
_LAS = Family("formats.las:read_las", (LAS,))
READERS = {
    ".ply": Family("formats.ply:read_ply", (PLY,)),
    ".pcd": Family("formats.pcd:read_pcd", (PCD, TEXT)),
    ".ptx": Family("formats.ptx:read_ptx", (TEXT,)),
    ".pts": Family("formats.pts:read_pts", (TEXT,), takes=("columns",)),
    ".e57": Family("e57.reader:read_e57", (E57,)),
    ".las": _LAS,
    ".laz": _LAS,
    ".xyz": _TEXT,
    ".asc": _TEXT,
    ".csv": _TEXT,
    ".txt": _TEXT,
    ".npy": Family("formats.npy:read_npy", (NPY,), takes=("columns", "pitch")),
    ".npz": Family("formats.npz:read_npz", (ZIP,), takes=("columns", "pitch")),
    ".stl": Family("formats.stl:read_stl", (STL, BINARY, TEXT), "formats.stl:sample_stl"),
    ".obj": Family("formats.obj:read_obj", (TEXT,), "formats.mesh:sample_mesh"),
    ".off": Family("formats.mesh:read_mesh", (TEXT,), "formats.mesh:sample_mesh"),
    ".glb": Family("formats.mesh:read_mesh", (GLB,), "formats.mesh:sample_mesh"),
    ".3mf": Family("formats.mesh:read_mesh", (ZIP,), "formats.mesh:sample_mesh"),
}
# What scanners store before anything is exported, by suffix: whose it is, and what writes what.
RAW_FORMATS = {
    **dict.fromkeys((".fls", ".fws", ".lsproj"), ("FARO SCENE", "E57, PTX or XYZ")),
    **dict.fromkeys((".tzf", ".tzs"), ("Trimble RealWorks", "E57 or PTX")),
    **dict.fromkeys((".rdbx", ".rxp"), ("RIEGL RiSCAN PRO", "E57 or LAS")),
    **dict.fromkeys((".rcp", ".rcs"), ("Autodesk ReCap", "E57 or PTS")),
    **dict.fromkeys((".zfs", ".zfprj"), ("Z+F LaserControl", "E57 or PTX")),
    **dict.fromkeys((".imp", ".lgs"), ("Leica Cyclone", "E57, PTX or PTS")),
    ".zdf": ("Zivid Studio", "PLY, PCD or XYZ"),
    ".praw": ("Photoneo PhoXi Control", "PLY"),
    ".bag": ("RealSense Viewer", "PLY"),
    **dict.fromkeys((".gprec", ".rec"), ("LMI Gocator", "CSV")),
}

MESH_SUFFIXES = tuple(suffix for suffix, family in READERS.items() if family.sampler)


def read_scan(
    path: Path,
    length_unit: str = "m",
    name: str | None = None,
    options: ReadOptions = AS_THE_FILE_SAYS,
    *,
    sample: int | None = None,
    progress: RowProgress = silent,
    in_place: bool = False,
) -> Scan:
    """Read a point cloud, plain, compressed, or the only one in a zip or tar; whole or not at all.

    length_unit: of the file's coordinates, see LENGTH_UNITS; never guessed.
    name: the file in messages; the path by default.
    options: what the user states of the file.
    sample: of a mesh, this many points of its surface instead of its vertices.
    progress: called with the number of rows read so far and the total.
    in_place: whether the points may lie in the file itself, read-only, each contiguous but not all
    of them; until they are freed, others wait who open it for writing.
    Raises InputError, one line, when the file is not exactly what it declares.
    """
    with open_cloud(path, length_unit, name, options, sample) as (cloud, source):
        return gather(cloud, source, length_unit, progress, in_place)


@contextmanager
def open_cloud(
    path: Path,
    length_unit: str = "m",
    name: str | None = None,
    options: ReadOptions = AS_THE_FILE_SAYS,
    sample: int | None = None,
) -> Iterator[tuple[RawCloud, Source]]:
    """Open a cloud with its checked header, its blocks still to be read; errors are one line."""
    name = " ".join((name or str(path)).splitlines())
    if length_unit not in LENGTH_UNITS:
        known = ", ".join(LENGTH_UNITS)
        raise InputError(f"{name}: the length unit '{length_unit}' is unknown: use {known}")
    try:
        with ExitStack() as stack:
            cloud, source = _open(path, name, options, sample, stack)
            _check_unit(cloud, length_unit, source)
            yield cloud, source
    except FileNotFoundError:
        raise InputError(f"{name}: there is no such file: check the name") from None
    except PermissionError:
        raise InputError(
            f"{name}: no permission to read it: change the file's permissions"
        ) from None
    except MemoryError:
        raise InputError(f"{name}: the cloud does not fit into memory: {remedy('it')}") from None
    except OSError as error:
        raise InputError(
            f"{name}: it cannot be read ({error.strerror}): check the path and the disk"
        ) from None


def _open(
    path: Path, name: str, options: ReadOptions, sample: int | None, stack: ExitStack
) -> tuple[RawCloud, Source]:
    _check_file(path, name)
    path, name = unpacked(path, name, READERS, stack)
    family = READERS.get(path.suffix.lower())
    if family is None:
        raise unknown_format(path.suffix, name)
    for option in ("columns", "pitch"):
        if getattr(options, option) is not None and option not in family.takes:
            fact = f"--{option} (or {option} in capture.toml) is not for {path.suffix} files"
            raise InputError(f"{name}: {fact}, which say it themselves: leave it out")
    source = Source.open(path, name, stack, options)
    if source.size == 0:
        raise InputError(f"{name}: the file is empty: copy or export it again")
    kind = looks_like(source.stream.read(4096))
    if kind == UTF16 and TEXT in family.signatures:
        source = Source.open(as_utf8(path, name, stack), name, stack, options)
        kind = looks_like(source.stream.read(4096))
    if kind not in family.signatures:
        raise InputError(
            f"{name}: the suffix is '{path.suffix}', but it does not begin like "
            f"{family.signatures[0]}; it looks like {kind}: check the file or its suffix"
        )
    source.stream.seek(0)
    if sample is None:
        return family.read(source), source
    if family.sampler is None:
        meshes = ", ".join(MESH_SUFFIXES)
        raise InputError(
            f"{name}: of a file with this suffix the points are read, and no surface: leave out "
            f"--sample, or export a mesh ({meshes})"
        )
    sampled: Callable[[Source, int], RawCloud] = _load(family.sampler)
    return sampled(source, sample), source


def _load(function: str) -> Any:
    """Return a function of this room by `MODULE:FUNCTION`."""
    module, _, name = function.partition(":")
    return getattr(import_module(f".{module}", __package__), name)


def unknown_format(suffix: str, name: str) -> InputError:
    """Return the error for a file that no reader is for: what to export instead."""
    raw = RAW_FORMATS.get(suffix.lower())
    if raw is not None:
        program, formats = raw
        fact = f"{name}: {suffix} is a raw format of {program}, which others cannot read"
        return InputError(f"{fact}: export {formats} from it")
    return InputError(
        f"{name}: the suffix '{suffix}' is not of a known point cloud format: use one "
        f"of {' '.join(READERS)}, packed or not"
    )


def _check_unit(cloud: RawCloud, length_unit: str, source: Source) -> None:
    """Raise InputError where the file states a unit other than the one that the user stated."""
    if cloud.unit in (None, length_unit):
        return
    fact = f"the file states lengths in {cloud.unit}, but they would be taken as {length_unit}"
    action = f'give --length-unit {cloud.unit}, or length_unit = "{cloud.unit}" in capture.toml'
    if cloud.unit not in LENGTH_UNITS:
        action = f"export them in {', '.join(LENGTH_UNITS)}"
    raise fault(source, fact, action)


def _check_file(path: Path, name: str) -> None:
    mode = path.stat().st_mode
    if stat.S_ISDIR(mode):
        raise InputError(f"{name}: it is a folder: name a scan file in it")
    if not stat.S_ISREG(mode):
        raise InputError(f"{name}: it is not a regular file: copy the scan to a file")
