"""Conditions of actions."""

from __future__ import annotations

from .substitution import perform

_MEANT = {"true": True, "1": True, "false": False, "0": False}


class IfCondition:
    """That a text means true."""

    def __init__(self, predicate_expression):
        self._predicate = predicate_expression

    def evaluate(self, context) -> bool:
        """Return whether it does. Raises RuntimeError for a text that means neither."""
        text = perform(context, self._predicate).strip().lower()
        if text not in _MEANT:
            raise RuntimeError(f"'{text}' is neither true nor false")
        return _MEANT[text]


class UnlessCondition(IfCondition):
    """That a text means false."""

    def evaluate(self, context) -> bool:
        """Return whether it does."""
        return not super().evaluate(context)
