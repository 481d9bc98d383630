"""Contents and findings of a scan file, plausibility checks, self-test on certified data."""

from .findings import oddities, spacing_m
from .plausibility import (
    check_cloud,
    check_vehicle_cloud,
    check_wheel_scan,
    float32_fact,
    float32_step,
    length,
)
from .selftest import BOUND, Check, Figure, digest, run_selftest
from .survey import Survey, survey_file

__all__ = [
    "BOUND",
    "Check",
    "Figure",
    "Survey",
    "check_cloud",
    "check_vehicle_cloud",
    "check_wheel_scan",
    "digest",
    "float32_fact",
    "float32_step",
    "length",
    "oddities",
    "run_selftest",
    "spacing_m",
    "survey_file",
]
