"""Where in the way of the data a capture failed, by the code that said so."""

from __future__ import annotations

import errno
import traceback

from pipeline.errors import NotMeasuredError

STAGES = {
    "discover": "capture capture_file capture_folder capture_names capture_entries capture_target "
    "scan_entry",
    "read": "archive readers digest plausible five_point_file",
    "segment": "segment local_planes candidates hypotheses patch faces cloud_faces surfels raster",
    "plane": "fit_plane trimmed trimmed_plane slab_sums correlation face_map five_point "
    "point_causes",
    "centre": "locate_centre outline rim rim_start rim_beams rim_background rim_equations centres "
    "face_outline face_turn face_view face_image edge_centre edge_profile pattern features "
    "feature_places pattern_pose plate_places",
    "identify": "identify_wheels observe observe_cloud observe_capture axles upright front",
    "frame": "reference_frame align",
    "angles": "angles uncertainty jacobian repeats turned steering runout report one_axis "
    "axle_frame toe_out vehicle definitions quantities stated_causes other_formulas monte_carlo "
    "judge conformity measure",
}
STAGE_OF = {module: stage for stage, modules in STAGES.items() for module in modules.split()}
# Tools of several stages: what goes wrong in them is of the stage that called them.
TOOLS = (
    "errors units blocks kernels compiled passes cloud_sample cubes distributions first_order "
    "ransac config plates printed targets tolerance causes measurement"
)
# Of the machine, not of the capture: elsewhere, or a little later, it may well be measured.
PASSING = {
    errno.ENOSPC,
    errno.EDQUOT,
    errno.EMFILE,
    errno.ENFILE,
    errno.ENOMEM,
    errno.EAGAIN,
    errno.EROFS,
    errno.ESTALE,
    errno.ETIMEDOUT,
}


def stage_of(error: BaseException) -> str:
    """The stage whose code raised the error, or the first cause of it."""
    for cause in reversed(causes(error)):
        frames = [frame for frame, _ in traceback.walk_tb(cause.__traceback__)]
        for frame in reversed(frames):
            module = frame.f_globals.get("__name__", "").removeprefix("pipeline.").partition(".")[0]
            if module == "observe" and isinstance(cause, NotMeasuredError):
                return "segment"  # which observe.py held back until the scan was let go
            if module in STAGE_OF:
                return STAGE_OF[module]
    return "read"


def causes(error: BaseException) -> list[BaseException]:
    """The error, what it arose from, what that arose from, and so on."""
    chain = [error]
    while (before := chain[-1].__cause__ or chain[-1].__context__) is not None:
        chain.append(before)
    return chain


def passing(error: BaseException) -> OSError | None:
    """The fault of the machine that an error arose from; None where the capture is to blame."""
    for one in causes(error):
        if isinstance(one, OSError) and one.errno in PASSING:
            return one
    return None
