"""`python -m wheelplane`: the command, where no script is installed."""

from .cli import main

main()
