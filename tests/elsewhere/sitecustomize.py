"""Put on PYTHONPATH, this hides what the system named by WHEELPLANE_ELSEWHERE lacks.

Readers' child processes start without it: they are started as this script instead.
"""

import builtins
import ctypes
import io
import os
import runpy
import select
import signal
import subprocess
import sys

SYSTEM = os.environ.get("WHEELPLANE_ELSEWHERE", "")
MODULES = {"macos": (), "windows": ("resource", "fcntl")}
NAMES = {
    "macos": [(os, "memfd_create")],
    "windows": [
        (os, "memfd_create"), (os, "fork"), (os, "killpg"), (os, "setpgid"), (os, "O_DIRECTORY"),
        (os, "sysconf"), (os, "sched_getaffinity"), (os, "pwrite"), (select, "poll"),
        (signal, "setitimer"), (signal, "SIGALRM"),
    ],
}  # fmt: skip


def hide_files(module, name):
    """Let the function of a module see no file in /proc."""
    real = getattr(module, name)

    def function(path, *arguments, **options):
        if str(path).startswith("/proc"):
            raise FileNotFoundError(2, "No such file or directory", str(path))
        return real(path, *arguments, **options)

    setattr(module, name, function)


def hide():
    for name in MODULES[SYSTEM]:
        sys.modules[name] = None
    for module, name in NAMES[SYSTEM]:
        delattr(module, name)
    hide_files(builtins, "open")
    hide_files(io, "open")
    access, load, start = os.access, ctypes.CDLL.__getattr__, subprocess.Popen.__init__
    os.access = lambda path, *rest, **o: (
        not str(path).startswith("/proc") and access(path, *rest, **o)
    )

    def lookup(library, name):
        if name == "prctl":
            raise AttributeError(name)
        return load(library, name)

    def popen(self, arguments, *rest, **options):
        if SYSTEM == "windows" and options.get("pass_fds"):
            raise ValueError("pass_fds not supported on Windows platforms")
        if SYSTEM == "windows":
            options.pop("creationflags", None)
        if "-S" in arguments:
            at = arguments.index("-S") + 1
            arguments = [*arguments[:at], __file__, *arguments[at:]]
            options["env"] = {**options["env"], "WHEELPLANE_ELSEWHERE": SYSTEM}
        start(self, arguments, *rest, **options)

    ctypes.CDLL.__getattr__ = lookup
    subprocess.Popen.__init__ = popen


if SYSTEM:
    hide()
if __name__ == "__main__":
    del sys.argv[0]
    runpy.run_path(sys.argv[0], run_name="__main__")
