"""Toe and camber of a vehicle's wheels from dense laser scans of targets clamped to them.

    with open_capture(Path("capture")) as capture:
        measurement = measure_capture(capture, Config())

The way of the data: capture, readers, segment (ransac), fit_plane, locate_centre (rim),
reference_frame, angles, uncertainty, align, report; `measure` tells it in one screen.
"""

from importlib.metadata import PackageNotFoundError, version

try:
    __version__ = version("wheelplane")
except PackageNotFoundError:  # run from a checkout that was never installed
    __version__ = "0+unknown"
