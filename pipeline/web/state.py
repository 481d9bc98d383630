"""What all requests of a server share."""

from __future__ import annotations

from .files.folders import Folders
from .files.uploads import Uploads
from .jobs.queue import Jobs
from .security import Guard
from .settings import Settings


class State:
    """The allowed folders, what was uploaded, and what was measured."""

    def __init__(self, settings: Settings, guard: Guard) -> None:
        self.settings, self.guard = settings, guard
        self.folders = Folders(tuple(folder.resolve() for folder in settings.folders))
        self.uploads, self.jobs = Uploads(settings), Jobs(settings)
