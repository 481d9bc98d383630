"""Exceptions of the program, one family, each with a message of one line; sentences for reports."""

from __future__ import annotations

from typing import Any, Self


def printable(text: str) -> str:
    """Escape characters by which text from a file could control the terminal."""
    return "".join(c if c.isprintable() else repr(c)[1:-1] for c in text)


def fact_of(error: Exception) -> str:
    """Describe for a user what a parser, or the reading of what it parsed, stopped at."""
    if isinstance(error, UnicodeDecodeError):
        return f"byte 0x{error.object[error.start]:02x}"
    if hasattr(error, "lineno"):  # of JSON
        return f"line {error.lineno} is not JSON"
    if isinstance(error, KeyError):
        return f"it lacks {error}"
    if isinstance(error, AttributeError | IndexError | TypeError | AssertionError):
        return "a part of it is missing or has another form"
    return " ".join(str(error).split())[:120]


def remedy_of(error: Exception) -> str:
    """Say what to do about a file that the system does not let be read."""
    if isinstance(error, PermissionError):
        return "change its permissions, or those of its folders"
    return "check the path"


class WheelplaneError(Exception):
    """Any error that the user can correct.

    The text is one line: the file or option, the fact with its number, and what to do. It is made
    printable, so that text from a file cannot control the terminal.
    """

    def __init__(self, text: str) -> None:
        super().__init__(printable(text))


class InputError(WheelplaneError):
    """A file, folder or option that cannot be used as it stands."""


class ConfigError(WheelplaneError):
    """A configuration that is misspelt, out of range, or names something unknown."""


class MissingDependencyError(WheelplaneError):
    """An optional library, or a system library below it, that this machine lacks."""


class NotMeasuredError(WheelplaneError):
    """A scan that was read but whose target could not be measured.

    status: its short name in the result; the text is the reason.
    """

    def __init__(self, status: str, reason: str) -> None:
        super().__init__(reason)
        self.status = status

    def __reduce__(self) -> tuple[Any, ...]:
        """Return what a copy is made of, as another process sends it."""
        return type(self), (self.status, str(self))


class TimeLimitError(BaseException):
    """End of the time; not an Exception, so that nothing takes it for a fault of one file."""


class Wording(str):
    """Sentence in English that remembers its template and parts; a string like any other.

    Reports and the page find its words in another language by the template.
    """

    __slots__ = ("parts", "template")
    template: str
    parts: dict[str, object]

    def __new__(cls, template: str, **parts: object) -> Self:
        """Fill the parts in."""
        made = super().__new__(cls, template.format(**parts))
        made.template, made.parts = template, parts
        return made

    def __getnewargs_ex__(self) -> tuple[Any, ...]:
        """Return what a copy is made of."""
        return (self.template,), self.parts


class Doubt(Wording):
    """Note on scans or readings that contradict the others, so that no verdict rests on them.

    It is about the trial, or point, among its parts; about the vehicle, trials included, where it
    has none.
    """

    __slots__ = ()

    def is_about(self, subject: str) -> bool:
        """Return whether the values of a wheel, trial or `vehicle` are in doubt by it."""
        return self.parts.get("trial", subject) == subject
