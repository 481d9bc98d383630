"""Writer of a cloud as E57, one posed scan per station; the only file that imports pye57."""

from __future__ import annotations

import uuid
from pathlib import Path
from typing import Any

import numpy as np

from ..arrays import Array, Array32
from ..errors import SynthError
from ..scanner.stations import Station

CAPACITY = 100_000  # points that the library takes at a time
FIELDS = ("cartesianX", "cartesianY", "cartesianZ", "intensity")


class E57Cloud:
    """E57 of scans in their scanner's own coordinates, with poses in the site's."""

    def __init__(self, path: Path, seed: int) -> None:
        self._lib = _library()
        self._seed, self._count = seed, 0
        self._file = self._lib.ImageFile(str(path), "w")
        self._file.extensionsAdd("", self._lib.E57_V1_0_URI)
        self._scans = self._lib.VectorNode(self._file, True)
        root = self._file.root()
        self._set_texts(root, formatName="ASTM E57 3D Imaging Data File", guid=self._guid())
        root.set("versionMajor", self._lib.IntegerNode(self._file, self._lib.E57_FORMAT_MAJOR))
        root.set("versionMinor", self._lib.IntegerNode(self._file, self._lib.E57_FORMAT_MINOR))
        root.set("data3D", self._scans)
        root.set("images2D", self._lib.VectorNode(self._file, True))
        self._arrays = [np.empty(CAPACITY) for _ in FIELDS]
        self._writer: Any = None
        self._R_site_station = np.eye(3)

    def begin(self, station: Station) -> None:
        """Begin the blocks of this station."""
        self._end()
        self._count += 1
        half = station.heading_rad / 2
        cos, sin = np.cos(station.heading_rad), np.sin(station.heading_rad)
        self._R_site_station = np.array([[cos, -sin, 0.0], [sin, cos, 0.0], [0.0, 0.0, 1.0]])
        scan = self._lib.StructureNode(self._file)
        self._set_texts(scan, guid=self._guid(), name=f"station {station.number}")
        pose = self._lib.StructureNode(self._file)
        pose.set("rotation", self._numbers(w=np.cos(half), x=0.0, y=0.0, z=np.sin(half)))
        pose.set(
            "translation", self._numbers(**dict(zip("xyz", station.position_site_m, strict=True)))
        )
        scan.set("pose", pose)
        points = self._lib.CompressedVectorNode(
            self._file, self._prototype(), self._lib.VectorNode(self._file, True)
        )
        scan.set("points", points)
        self._scans.append(scan)
        buffers = self._lib.VectorSourceDestBuffer()
        for name, array in zip(FIELDS, self._arrays, strict=True):
            buffers.append(
                self._lib.SourceDestBuffer(self._file, name, array, CAPACITY, True, True)
            )
        self._writer = points.writer(buffers)

    def add(self, points_station_m: Array, intensity: Array32) -> None:
        """Write points (N, 3), in the axes of the site from the scanner, and intensity (N,)."""
        rows = np.column_stack([points_station_m @ self._R_site_station, intensity])
        for start in range(0, len(rows), CAPACITY):
            part = rows[start : start + CAPACITY]
            for array, values in zip(self._arrays, part.T, strict=True):
                array[: len(part)] = values
            self._writer.write(len(part))

    def close(self) -> None:
        """Finish the file."""
        self._end()
        self._file.close()

    def _end(self) -> None:
        if self._writer is not None:
            self._writer.close()
            self._writer = None

    def _prototype(self) -> Any:
        node = self._lib.StructureNode(self._file)
        kinds = [self._lib.E57_DOUBLE] * 3 + [self._lib.E57_SINGLE]
        for name, kind in zip(FIELDS, kinds, strict=True):
            node.set(name, self._lib.FloatNode(self._file, 0.0, kind))
        return node

    def _guid(self) -> str:
        """Return an identifier that depends on seed and scan alone."""
        name = f"wheelplane synth {self._seed} {self._count}"
        return f"{{{uuid.uuid5(uuid.NAMESPACE_OID, name)}}}"

    def _set_texts(self, node: Any, **texts: str) -> None:
        for name, text in texts.items():
            node.set(name, self._lib.StringNode(self._file, text))

    def _numbers(self, **values: float) -> Any:
        node = self._lib.StructureNode(self._file)
        for name, value in values.items():
            node.set(name, self._lib.FloatNode(self._file, float(value)))
        return node


def _library() -> Any:
    try:
        from pye57 import libe57
    except ImportError as error:
        text = " ".join(str(error).split())
        raise SynthError(
            f"vehicle.e57: pye57 does not load ({text}); pip install 'wheelplane[e57]', or write "
            "a PLY"
        ) from error
    return libe57
