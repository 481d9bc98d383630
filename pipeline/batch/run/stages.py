"""Stage of the data flow at which a capture failed, by the room whose code raised the error."""

from __future__ import annotations

import errno
import traceback

from ...errors import NotMeasuredError

# Stage of each room; the longest name counts. What fails in a room without a row (cloud, targets)
# is of the stage that called it.
STAGES = {
    "discover": "capture",
    "read": "files readers diagnostics five_point.file",
    "segment": "detection",
    "plane": "plane five_point measurement.residual_map",
    "centre": "centre kinematics.plate_pose",
    "identify": "capture.front detection.identify_wheels detection.up_direction detection.vehicles "
    "measurement.observe measurement.observe_vehicle",
    "frame": "vehicle.frame measurement.evaluate",
    "angles": "vehicle uncertainty kinematics measurement measure report",
}
STAGE_OF = {room: stage for stage, rooms in STAGES.items() for room in rooms.split()}
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
            module = frame.f_globals.get("__name__", "").partition(".")[2]
            if module == "measurement.observe" and isinstance(cause, NotMeasuredError):
                return "segment"  # which observe.py held back until the scan was let go
            while module:
                if module in STAGE_OF:
                    return STAGE_OF[module]
                module = module.rpartition(".")[0]
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
