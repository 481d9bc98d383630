"""What the generator says when it cannot go on."""


class SynthError(Exception):
    """A reason to stop that the user can mend.

    The text is one line that names the file or option, the fact, and the mend.
    """
