"""Messages in the library's words: its arguments instead of the options of the command line."""

from __future__ import annotations

import re
from collections.abc import Callable
from functools import wraps
from typing import ParamSpec, TypeVar

from ..errors import WheelplaneError

P = ParamSpec("P")
R = TypeVar("R")

ARGUMENTS = {
    *("target", "length-unit", "scanner", "config", "vertical"),
    *("coordinates", "angle-unit", "azimuth"),
    *("axis", "angles", "convention", "rim"),
}
DECLARED = {  # what only a capture.toml states
    "columns": "columns",
    "pitch": "pitch",
    "front": "front",
    "front-point": "front_point",
    "up": "up",
    "hint": "[hints]",
}
# Advice that names what the library does not have, and what to do instead.
ADVICE = {
    "see what was found with --explain DIR and ": "",
    "allow more by --memory": "allow this process more",
    "name the scan of each block with --blocks, - for none": "give a block for each scan, in the "
    "order of the scans",
    "name the wheel of each block with --blocks": "give the blocks in the order of the scans",
    "name the scan of each block with --blocks": "give the blocks in the order of the scans",
}
OPTION = re.compile(r"--([a-z][a-z-]*)")
OPTION_OR_DECLARED = re.compile(r"--\S+ \(or (\S+ in capture\.toml)\)")


def in_library_words(message: str) -> str:
    """Return a message in which options of the command line are arguments of the library."""
    for advice, instead in ADVICE.items():
        message = message.replace(advice, instead)
    return OPTION.sub(_argument, OPTION_OR_DECLARED.sub(r"\1", message))


def _argument(option: re.Match[str]) -> str:
    name = option[1]
    if name in ARGUMENTS:
        return name.replace("-", "_")
    return f"{DECLARED[name]} of a capture.toml" if name in DECLARED else f"{name} of the command"


def library_errors(function: Callable[P, R]) -> Callable[P, R]:
    """Let a public function raise its errors in the library's words; their types stay."""

    @wraps(function)
    def wrapped(*args: P.args, **kwargs: P.kwargs) -> R:
        try:
            return function(*args, **kwargs)
        except WheelplaneError as error:
            error.args = (in_library_words(str(error)),)
            raise

    return wrapped
