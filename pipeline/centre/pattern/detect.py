"""Circles, checkerboard corners and ArUco markers in an image, with cv2.

The features are unordered: OpenCV's grids may start at any corner and be rotated (its issues 4998,
22083, 24964, 26830), and are dropped where one feature is hidden. Pixel 0, 0 is the middle of the
first one (issue 22288).
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from ...cloud import load_opencv
from ...system import frozen
from ...vectors import Array, Mask

Grey = npt.NDArray[np.uint8]
QUIET = 12  # pixels of margin, without which markers at the image's border are missed
MIN_CORNERS = 3  # rows and columns of a partly hidden board


@frozen(eq=False)
class Markers:
    """Markers found: ids (K,); corners (K, 4, 2), pixels, clockwise from each one's upper left."""

    ids: npt.NDArray[np.int64]
    corners: Array


def find_circles(grey: Grey, diameter: float) -> Array:
    """Find the centres (K, 2) of dark or bright circles of about that diameter, pixels."""
    cv2 = load_opencv()
    parameters = cv2.SimpleBlobDetector.Params()
    area = np.pi / 4.0 * diameter**2
    parameters.filterByArea = True  # its defaults, 25 to 5000 pixels, fit no target
    parameters.minArea, parameters.maxArea = 0.4 * area, 2.0 * area
    parameters.filterByCircularity = True
    parameters.minCircularity = 0.4  # of a jagged circle of a dozen pixels
    parameters.filterByColor = False
    parameters.filterByInertia = False
    parameters.filterByConvexity = False
    parameters.minThreshold, parameters.maxThreshold, parameters.thresholdStep = 20, 235, 15
    parameters.minDistBetweenBlobs = float(diameter)
    found = cv2.SimpleBlobDetector.create(parameters).detect(grey)
    return np.array([spot.pt for spot in found], dtype=np.float64).reshape(-1, 2)


def find_corners(grey: Grey, rows: int, columns: int) -> Array:
    """Find the inner corners (K, 2) of a checkerboard, or of a part of it, pixels."""
    cv2 = load_opencv()
    flags = cv2.CALIB_CB_EXHAUSTIVE | cv2.CALIB_CB_ACCURACY | cv2.CALIB_CB_LARGER
    wide = np.pad(grey, QUIET, mode="edge")
    for size in ((columns, rows), (min(MIN_CORNERS, columns), min(MIN_CORNERS, rows))):
        found, corners, _ = cv2.findChessboardCornersSBWithMeta(wide, size, flags)
        if found:
            return np.asarray(corners, dtype=np.float64).reshape(-1, 2) - QUIET
    return np.zeros((0, 2))


def find_markers(grey: Grey, dictionary: str) -> Markers:
    """Find the markers of a dictionary, black on white or white on black."""
    cv2 = load_opencv()
    parameters = cv2.aruco.DetectorParameters()
    parameters.detectInvertedMarker = True
    known = cv2.aruco.getPredefinedDictionary(getattr(cv2.aruco, dictionary))
    wide = np.pad(grey, QUIET, mode="edge")
    corners, ids, _ = cv2.aruco.ArucoDetector(known, parameters).detectMarkers(wide)
    if ids is None:
        return Markers(np.zeros(0, dtype=np.int64), np.zeros((0, 4, 2)))
    placed = np.array(corners, dtype=np.float64).reshape(-1, 4, 2) - QUIET
    return Markers(np.asarray(ids, dtype=np.int64).ravel(), placed)


def marker_bits(dictionary: str) -> int:
    """Return the width of a marker of the dictionary in modules, with its black border."""
    cv2 = load_opencv()
    return int(cv2.aruco.getPredefinedDictionary(getattr(cv2.aruco, dictionary)).markerSize) + 2


def marker_modules(dictionary: str, marker: int) -> Mask:
    """Return which modules (B, B) of a marker are dark, first row at the top, with its border."""
    cv2 = load_opencv()
    known = cv2.aruco.getPredefinedDictionary(getattr(cv2.aruco, dictionary))
    image = cv2.aruco.generateImageMarker(known, marker, marker_bits(dictionary))
    return np.asarray(image == 0)
