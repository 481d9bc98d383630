"""Stage of the data flow at which a capture failed, by the package whose code raised the error."""

from __future__ import annotations

import errno
import traceback

from ...errors import NotMeasuredError

# Stage of each package; the longest name counts. An error in a package without a row (cloud,
# targets) belongs to the stage that called it.
STAGES = {
    "discover": "capture",
    "read": "files readers diagnostics five_point.file",
    "segment": "detection wheel.find_axis wheel.find_wheel",
    "plane": "plane wheel five_point measurement.residual_map",
    "centre": "centre kinematics.plate_pose",
    "identify": "capture.front detection.identify_wheels detection.up_direction detection.vehicles "
    "measurement.observe measurement.observe_vehicle",
    "frame": "vehicle.frame measurement.evaluate",
    "angles": "vehicle uncertainty kinematics measurement measure report",
}
STAGE_OF = {room: stage for stage, rooms in STAGES.items() for room in rooms.split()}
# Faults of the machine, not of the capture: another try may succeed.
TRANSIENT = {
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
    """Return the stage whose code raised the error, or the first error of its chain."""
    for cause in reversed(error_chain(error)):
        frames = [frame for frame, _ in traceback.walk_tb(cause.__traceback__)]
        for frame in reversed(frames):
            module = frame.f_globals.get("__name__", "").partition(".")[2]
            if module == "measurement.observe" and isinstance(cause, NotMeasuredError):
                return "segment"  # raised by observe.py after the scan was released
            while module:
                if module in STAGE_OF:
                    return STAGE_OF[module]
                module = module.rpartition(".")[0]
    return "read"


def error_chain(error: BaseException) -> list[BaseException]:
    """Return the error and the errors that it was raised from, latest first."""
    chain = [error]
    while (before := chain[-1].__cause__ or chain[-1].__context__) is not None:
        chain.append(before)
    return chain


def transient_fault(error: BaseException) -> OSError | None:
    """Return the fault of the machine that caused an error; None if it is due to the capture."""
    for one in error_chain(error):
        if isinstance(one, OSError) and one.errno in TRANSIENT:
            return one
    return None
