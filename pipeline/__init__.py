"""Toe and camber of a vehicle's wheels from dense laser scans of targets clamped to them.

    from pathlib import Path
    from wheelplane.capture import open_capture
    from wheelplane.config import Config
    from wheelplane.measure import measure_capture

    with open_capture(Path("capture")) as capture:
        measurement = measure_capture(capture, Config())
    for wheel in measurement.wheels:
        print(wheel.observation.name, wheel.angles, wheel.u_toe_rad)

The flow, each step a folder: capture (which scan shows which wheel), readers (scan), detection
(patch: the target's points), plane, centre (from the target's edge or pattern), vehicle (frame,
toe and camber), uncertainty, measurement, kinematics (steering axis, run-out), report.
`measure` tells it on one screen; `five_point` and `validation` are the other two methods.
"""

from importlib.metadata import PackageNotFoundError, version

try:
    __version__ = version("wheelplane")
except PackageNotFoundError:  # run from a checkout that was never installed
    __version__ = "0+unknown"
