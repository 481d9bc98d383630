"""Compile pipeline/cloud/kernels.c where the package is built or installed.

    python .ci/build_kernels.py

As hatchling's hook, makes the wheel one of this system with the kernels in it; without a compiler
the wheel is one of any system, and the program uses numpy in their place.
"""

from __future__ import annotations

import hashlib
import os
import shlex
import shutil
import subprocess
import sys
import sysconfig
from pathlib import Path
from typing import Any

CLOUD = Path(__file__).resolve().parents[1] / "pipeline" / "cloud"
SOURCE, LIBRARY = CLOUD / "kernels.c", CLOUD / "kernels.so"
# No fused multiply-adds: each processor gives the same bits.
OPTIONS = ["-std=gnu11", "-O3", "-shared", "-fPIC", "-fvisibility=hidden", "-ffp-contract=off"]


def compile_kernels() -> str | None:
    """Compile the kernels by the compiler that CC names, or `cc`; return why there are none.

    The library replaces an older one when it is whole: a program may be loading that.
    """
    compiler = shlex.split(os.environ.get("CC", "cc"))
    if not compiler or shutil.which(compiler[0]) is None:
        LIBRARY.unlink(missing_ok=True)
        return "there is no C compiler"
    digest = hashlib.sha256(SOURCE.read_bytes()).hexdigest()
    made = LIBRARY.with_name(f"kernels-{os.getpid()}.so")
    command = [*compiler, *OPTIONS, f'-DSOURCE_DIGEST="{digest}"', "-o", str(made), str(SOURCE)]
    run = subprocess.run(command, capture_output=True, text=True, check=False)  # noqa: S603
    if run.returncode:
        made.unlink(missing_ok=True)
        LIBRARY.unlink(missing_ok=True)
        return (run.stderr.strip() or f"{compiler[0]} ended with {run.returncode}").splitlines()[0]
    made.replace(LIBRARY)
    return None


def get_build_hook() -> type[Any]:
    """Return the hook; hatchling is there when it asks for one."""
    from hatchling.builders.hooks.plugin.interface import BuildHookInterface

    class KernelHook(BuildHookInterface[Any]):
        """Compile the kernels for a wheel, also one that only points to this folder."""

        def initialize(self, version: str, build_data: dict[str, Any]) -> None:
            if self.target_name != "wheel":
                return
            missing = compile_kernels()
            if missing:
                self.app.display_warning(f"the kernels for large clouds are not built: {missing}")
                return
            platform = sysconfig.get_platform().replace("-", "_").replace(".", "_")
            build_data["artifacts"].append(str(LIBRARY.relative_to(self.root)))
            build_data["pure_python"], build_data["tag"] = False, f"py3-none-{platform}"

    return KernelHook


if __name__ == "__main__":
    sys.exit(compile_kernels())
