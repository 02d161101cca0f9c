"""Values of parameters."""

from __future__ import annotations

import yaml
from launch.substitution import perform


class ParameterValue:
    """A value of a known type: str, int, float or bool."""

    def __init__(self, value, *, value_type):
        self._value, self._type = value, value_type

    def evaluate(self, context) -> str | int | float | bool:
        """Return it. Raises ValueError for a text that is not of the type."""
        text = perform(context, self._value)
        return evaluated(text) if self._type is bool else self._type(text)


def evaluated(text: str) -> str | int | float | bool | list:
    """Return what a text is as YAML. Raises TypeError for what no parameter can be."""
    found = yaml.safe_load(text)
    if found is None or isinstance(found, dict) or (isinstance(found, list) and len({type(one) for one in found}) != 1):
        if text == "":
            return ""
        raise TypeError(f"{text}: must be a bool, number or text, or a list of one of these")
    return found
