"""Summary and findings of a scan file, plausibility checks, self-test on certified data."""

from .findings import findings, spacing_m
from .plausibility import (
    better_unit,
    check_cloud,
    check_poses,
    check_vehicle_cloud,
    check_wheel_scan,
    float32_fact,
    float32_step,
    length,
    lone_points,
)
from .scan_summary import ScanSummary, summarise_scan
from .selftest import BOUND, Check, Figure, digest, run_selftest

__all__ = [
    "BOUND",
    "Check",
    "Figure",
    "ScanSummary",
    "better_unit",
    "check_cloud",
    "check_poses",
    "check_vehicle_cloud",
    "check_wheel_scan",
    "digest",
    "findings",
    "float32_fact",
    "float32_step",
    "length",
    "lone_points",
    "run_selftest",
    "spacing_m",
    "summarise_scan",
]
