"""All that a capture shows: scan by scan, or in the one cloud of its vehicle."""

from __future__ import annotations

from collections.abc import Callable

from pipeline.capture import Capture
from pipeline.config import Config
from pipeline.measurement import Naming, Observation
from pipeline.observe import Fit, observe_entry
from pipeline.observe_cloud import observe_cloud


def observe_capture(
    capture: Capture, config: Config, fit: Fit, progress: Callable[[str], None]
) -> tuple[list[Observation], Naming | None]:
    """What each scan shows, RR, RL, FR, FL first; and how the wheels of one cloud were named."""
    if capture.cloud is not None:
        return observe_cloud(capture.cloud, capture, config, fit, progress)
    entries = [observe_entry(entry, capture, config, fit, progress) for entry in capture.entries]
    return entries, None
