"""What all requests of a server share."""

from __future__ import annotations

from pipeline.web.folders import Folders
from pipeline.web.jobs import Jobs
from pipeline.web.security import Guard
from pipeline.web.settings import Settings
from pipeline.web.uploads import Uploads


class State:
    """The allowed folders, what was uploaded, and what was measured."""

    def __init__(self, settings: Settings, guard: Guard) -> None:
        self.settings, self.guard = settings, guard
        self.folders = Folders(tuple(folder.resolve() for folder in settings.folders))
        self.uploads, self.jobs = Uploads(settings), Jobs(settings)
