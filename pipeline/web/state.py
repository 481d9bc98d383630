"""State shared by all requests of a server."""

from __future__ import annotations

from .files.folders import Folders
from .files.uploads import Uploads
from .jobs.queue import Jobs
from .security import Guard
from .settings import PageSettings


class PageState:
    """Allowed folders, uploads and jobs of a server."""

    def __init__(self, settings: PageSettings, guard: Guard) -> None:
        self.settings, self.guard = settings, guard
        self.folders = Folders(tuple(folder.resolve() for folder in settings.folders))
        self.uploads, self.jobs = Uploads(settings), Jobs(settings)
