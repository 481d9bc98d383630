"""Toe and camber of a vehicle's wheels from dense laser scans of targets clamped to them.

    import wheelplane as wp

    m = wp.measure({"RR": rr, "RL": rl, "FR": fr, "FL": fl}, target="disc-250")
    print(m.wheels["FL"].toe.deg, m.wheels["FL"].toe.U_deg)

The public names are those of `__all__`; each is loaded when it is first used. Below them the flow,
each step a folder: capture (which scan shows which wheel), readers (scan), detection (patch: the
target's points), plane, centre (from the target's edge or pattern), vehicle (frame, toe and
camber), uncertainty, measurement, kinematics (steering axis, run-out), report. The module `measure`
shows it on one screen; `five_point` and `validation` are the other two methods.
"""

import sys
from importlib import import_module
from types import ModuleType
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from .errors import ConfigError, InputError, MissingDependencyError, NotMeasuredError
    from .errors import WheelplaneError as WheelplaneError
    from .five_point import FivePointFile
    from .library import (
        Alignment,
        Comparison,
        Covariance,
        FoundTarget,
        Plane,
        Value,
        Wheel,
        find_planes,
        find_target,
        fit_plane,
        measure,
        open_measurement,
        read_five_point,
        validate,
    )

    __version__: str

__all__ = [
    "Alignment",
    "Comparison",
    "ConfigError",
    "Covariance",
    "FivePointFile",
    "FoundTarget",
    "InputError",
    "MissingDependencyError",
    "NotMeasuredError",
    "Plane",
    "Value",
    "Wheel",
    "WheelplaneError",
    "find_planes",
    "find_target",
    "fit_plane",
    "measure",
    "open_measurement",
    "read_five_point",
    "validate",
]
_ROOMS = {
    ".errors": {name for name in __all__ if name.endswith("Error")},
    ".five_point": {"FivePointFile"},
}


class _Package(ModuleType):
    """The package, whose function `measure` stands before its module of that name."""

    def __setattr__(self, name: str, value: object) -> None:
        if not (name == "measure" and isinstance(value, ModuleType)):
            super().__setattr__(name, value)


if not TYPE_CHECKING:
    sys.modules[__name__].__class__ = _Package

    def __getattr__(name):
        """Load a public name, or find the version."""
        if name == "__version__":
            found = _version()
        elif name in __all__:
            room = next((room for room, names in _ROOMS.items() if name in names), ".library")
            found = getattr(import_module(room, __name__), name)
        else:
            raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
        globals()[name] = found
        return found


def __dir__() -> list[str]:
    return sorted([*globals(), *__all__])


def _version() -> str:
    from importlib.metadata import PackageNotFoundError, version

    try:
        return version("wheelplane")
    except PackageNotFoundError:  # run from a checkout that was never installed
        return "0+unknown"
