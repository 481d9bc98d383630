"""Ray casting: the facet that a ray meets first; the only file that imports Open3D."""

from __future__ import annotations

import ctypes
import sys
from copy import copy
from typing import Any

import numpy as np
import numpy.typing as npt

from ..arrays import Array, Array32
from ..errors import SynthError

DEBIAN = "libusb-1.0-0 libgl1 libegl1 libx11-6 libudev1 libidn2-0 libgomp1"


class RayCaster:
    """A mesh prepared for ray casting.

    The facet is found in single precision; the caller computes the point on it.
    """

    def __init__(self, vertices_m: Array, faces: npt.NDArray[np.int64]) -> None:
        self._open3d = _open3d()
        tensor = self._open3d.core.Tensor
        self._scene = self._open3d.t.geometry.RaycastingScene()
        self._scene.add_triangles(
            tensor(vertices_m.astype(np.float32)), tensor(faces.astype(np.uint32))
        )
        self._origin_m = np.zeros(3)

    def seen_from(self, origin_m: Array) -> RayCaster:
        """Return it for rays in coordinates whose origin lies at origin_m (3,) of the mesh."""
        seen = copy(self)
        seen._origin_m = origin_m
        return seen

    def cast(
        self, origins_m: Array | float, directions: Array
    ) -> tuple[npt.NDArray[np.int64], Array32]:
        """Return the facet (N,), -1 without a hit, and the coarse range (N,) in metres.

        origins_m: (N, 3) or 0. directions: (N, 3) of unit length.
        """
        rays = np.empty((len(directions), 6), dtype=np.float32)
        rays[:, :3] = origins_m + self._origin_m
        rays[:, 3:] = directions
        answer = self._scene.cast_rays(self._open3d.core.Tensor(rays))
        facets = answer["primitive_ids"].numpy()
        missed = facets == self._scene.INVALID_ID
        return np.where(missed, -1, facets.astype(np.int64)), answer["t_hit"].numpy()


def _open3d() -> Any:
    """Import Open3D, with libusb from the wheel of libusb-package if the system has none."""
    try:
        if sys.platform == "linux":
            import libusb_package

            library = libusb_package.get_library_path()
            if library is not None:
                ctypes.CDLL(str(library), mode=ctypes.RTLD_GLOBAL)
        import open3d
    except (ImportError, OSError) as error:
        text = " ".join(str(error).split())
        raise SynthError(
            f"ray casting: Open3D does not load ({text}); pip install 'wheelplane[synth]', "
            f"and on Debian or Ubuntu apt install {DEBIAN}"
        ) from error
    return open3d
