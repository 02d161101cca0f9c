"""Text that is known when it is needed."""

from __future__ import annotations

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from . import LaunchContext


class Substitution:
    """Something that stands for a text."""

    def perform(self, context: LaunchContext) -> str:
        """Return the text."""
        raise NotImplementedError


def perform(context: LaunchContext, value: object) -> str:
    """Return the text of a text, a path, a substitution, or a list of these, which are joined."""
    if isinstance(value, list | tuple):
        return "".join(perform(context, part) for part in value)
    return value.perform(context) if isinstance(value, Substitution) else str(value)


class Joined(Substitution):
    """Texts and substitutions, joined."""

    def __init__(self, parts: object):
        self._parts = parts

    def perform(self, context: LaunchContext) -> str:
        """Join them."""
        return perform(context, self._parts)
