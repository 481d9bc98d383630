"""Command line as `python -m wheelplane`, where no script is installed."""

from .cli import main

main()
