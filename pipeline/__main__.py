"""Command line as `python -m wheelplane`, where no script is installed.

`-m` puts the current folder, where the scans of others may lie, ahead of all libraries: it is taken
out again, unless this program itself lies there. What was imported before, Python's own start and
the package, is safe with `python -P -m wheelplane` only.
"""

import os
import sys

HERE = os.path.dirname(os.path.dirname(os.path.abspath(__file__)))  # noqa: PTH100, PTH120
if not sys.flags.safe_path and sys.path[0] != HERE:
    del sys.path[0]

from .cli import main  # noqa: E402

main()
