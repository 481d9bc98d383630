"""Comparison of one method with another: one capture, an archive, coverage."""

from .agreement import Agreement
from .comparison import KINDS, Comparison, check_alike, compare
from .coverage import nees, scores
from .five_point import Estimator, FivePointOptions, points_of
from .frame_effect import SHAPE
from .mounting import Mounting, Mountings, MountingScatter, validate_mountings
from .request import (
    Against,
    Request,
    RequestPart,
    as_method,
    measured,
    note_of_plates,
    of_faces,
)
from .statistics.bland_altman import Limit
from .statistics.joint_test import JointTest, Spread
from .statistics.line_fit import Line, fit_line
from .statistics.power import detectable_alone
from .study import EACH, ComparisonStudy, Row, is_archive_of_captures, validate_archive
from .validate_capture import compare_with_points, validate_capture

__all__ = [
    "EACH",
    "KINDS",
    "SHAPE",
    "Against",
    "Agreement",
    "Comparison",
    "ComparisonStudy",
    "Estimator",
    "FivePointOptions",
    "JointTest",
    "Limit",
    "Line",
    "Mounting",
    "MountingScatter",
    "Mountings",
    "Request",
    "RequestPart",
    "Row",
    "Spread",
    "as_method",
    "check_alike",
    "compare",
    "compare_with_points",
    "detectable_alone",
    "fit_line",
    "is_archive_of_captures",
    "measured",
    "nees",
    "note_of_plates",
    "of_faces",
    "points_of",
    "scores",
    "validate_archive",
    "validate_capture",
    "validate_mountings",
]
