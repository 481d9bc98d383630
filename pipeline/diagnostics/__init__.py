"""Summary and findings of a scan file, plausibility checks, self-test on certified data."""

from typing import TYPE_CHECKING

from ..system import loader
from .findings import findings, spacing_m
from .plausibility import (
    TRACKS_M,
    WHEELBASES_M,
    WHEELS_APART_M,
    better_unit,
    check_cloud,
    check_poses,
    check_vehicle_cloud,
    check_wheel_scan,
    check_wheels,
    float32_fact,
    float32_step,
    is_usual,
    length,
    lone_points,
    vehicle_unit,
)

if TYPE_CHECKING:
    from .scan_summary import ScanSummary, summarise_scan
    from .selftest import BOUND, Check, Figure, digest, run_selftest

__all__ = [
    "BOUND",
    "TRACKS_M",
    "WHEELBASES_M",
    "WHEELS_APART_M",
    "Check",
    "Figure",
    "ScanSummary",
    "better_unit",
    "check_cloud",
    "check_poses",
    "check_vehicle_cloud",
    "check_wheel_scan",
    "check_wheels",
    "digest",
    "findings",
    "float32_fact",
    "float32_step",
    "is_usual",
    "length",
    "lone_points",
    "run_selftest",
    "spacing_m",
    "summarise_scan",
    "vehicle_unit",
]

if not TYPE_CHECKING:
    __getattr__ = loader(
        __name__,
        {
            ".scan_summary": {"ScanSummary", "summarise_scan"},
            ".selftest": {"BOUND", "Check", "Figure", "digest", "run_selftest"},
        },
    )
