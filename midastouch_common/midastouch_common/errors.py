"""The one exception for bad input from outside the program."""

import re

EXIT_BAD_INPUT = 2
"""Exit code of a program that ends with an `InputError`; starting it again would not help."""


class InputError(ValueError):
    """A file, topic or argument cannot be used.

    The message names the input, the fault and the fix, so that a command can print it as its only line and a
    node can put it into its diagnostics. The lines of a library's message that it quotes are joined.
    """

    def __str__(self) -> str:
        return re.sub(r"\s*\n\s*", " ", super().__str__())
