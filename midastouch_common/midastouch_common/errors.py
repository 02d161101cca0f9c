"""The one exception for bad input from outside the program."""

EXIT_BAD_INPUT = 2
"""Exit code of a program that `InputError` ends: it would end so again, however often it is started."""


class InputError(ValueError):
    """A file, topic or argument cannot be used.

    The message names the input, says what is wrong with it and how to fix it, so that a command can print
    it as its only line and a node can put it into its diagnostics.
    """
