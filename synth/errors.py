"""Exception of the generator."""


class SynthError(Exception):
    """An error that the user can correct.

    The text is one line: the file or option, the fact, and what to do.
    """
