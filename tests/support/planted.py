"""A folder as a stranger may deliver it, with files that Python or the linker would take."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

from tests.support.paths import ROOT

SCRIPT = """
from wheelplane.cli import main

if __name__ == "__main__":
    main()
"""
# What the program and multiprocessing import at various times, and the program itself.
MODULES = (
    "numpy", "hashlib", "sqlite3", "tempfile", "pydantic", "rich", "sitecustomize", "usercustomize"
)  # fmt: skip
PACKAGES = ("pipeline", "wheelplane", "wheelplane_synth", "multiprocessing")
LIBRARIES = ("kernels.so", "libc.so.6", "libm.so.6", "libdl.so.2", "libz.so.1", "libpthread.so.0")


class Planted:
    """The folder `folder`; each planted module that is imported adds its name to a list."""

    def __init__(self, place: Path, modules: tuple[str, ...] = MODULES + PACKAGES) -> None:
        self.folder, self._ran = place / "delivered", place / "ran.txt"
        self._script = place / "bin" / "wheelplane"
        self._script.parent.mkdir(parents=True)
        self._script.write_text(SCRIPT)
        note = f"with open({str(self._ran)!r}, 'a') as ran:\n    print(__file__, file=ran)\n"
        self.folder.mkdir()
        for module in modules:
            path = self.folder / (f"{module}/__init__.py" if module in PACKAGES else f"{module}.py")
            path.parent.mkdir(exist_ok=True)
            path.write_text(note)
        for library in LIBRARIES:
            (self.folder / library).write_text("no library")
        self._files = self._here()

    @property
    def ran(self) -> list[str]:
        """The planted modules that were imported."""
        return self._ran.read_text().splitlines() if self._ran.exists() else []

    @property
    def untouched(self) -> bool:
        """Whether nothing was imported, and nothing written."""
        return not self.ran and self._here() == self._files

    def run(
        self, *arguments: object, start: tuple[str, ...] = ()
    ) -> subprocess.CompletedProcess[str]:
        """Run the command in the folder, by its script as it is installed; or by `start`."""
        return subprocess.run(
            [sys.executable, *(start or (str(self._script),)), *map(str, arguments)],
            cwd=self.folder,
            env={"PATH": "/usr/bin:/bin", "PYTHONPATH": str(ROOT / ".ci" / "editable")},
            capture_output=True,
            text=True,
            check=False,
            timeout=300,
        )

    def _here(self) -> set[Path]:
        return set(self.folder.rglob("*"))
