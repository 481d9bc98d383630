"""What the program says when it cannot go on: one family, one line each."""


class WheelplaneError(Exception):
    """Any reason to stop that the user can mend.

    The text is one line that names the file or option, the fact with its number, and the mend.
    What a file wrote into it cannot steer the terminal: it is printable.
    """

    def __init__(self, text: str) -> None:
        super().__init__("".join(c if c.isprintable() else repr(c)[1:-1] for c in text))


class InputError(WheelplaneError):
    """A file, folder or option that cannot be used as it stands."""


class ConfigError(WheelplaneError):
    """A configuration that is misspelt, out of range, or names something unknown."""


class MissingDependencyError(WheelplaneError):
    """An optional library, or a system library below it, that this machine lacks."""


class NotMeasuredError(WheelplaneError):
    """A scan that was read but whose target could not be measured.

    `status` is the short name that stands in the result; the text says why.
    """

    def __init__(self, status: str, reason: str) -> None:
        super().__init__(reason)
        self.status = status
