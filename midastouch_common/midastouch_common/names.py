"""Names that users give: of namespaces, topics, frames and sensors."""

from __future__ import annotations

import re

from .errors import InputError

_PART = r"(?![0-9])(?:(?!__)[A-Za-z0-9_])+"
_WORDS = "letters, digits and '_' (not two in a row), no part beginning with a digit"
_KINDS = {
    "namespace": (rf"/|/?{_PART}(/{_PART})*/?", f"{_WORDS}, such as left or robot/left"),
    "topic": (rf"/?{_PART}(/{_PART})*", f"{_WORDS}, such as /left/image_raw"),
    "frame": (r"\S+", "no spaces"),
    # it becomes the name of files
    "serial number": (r"[A-Za-z0-9][A-Za-z0-9._-]{0,63}", "letters, digits, '.', '_' and '-' only, at most 64"),
}


def require_name(kind: str, name: str, source: str) -> str:
    """Return `name`.

    Parameters
    ----------
    kind
        "namespace", "topic", "frame" or "serial number".
    name
    source
        What names it, for the message.

    Raises
    ------
    InputError
        It cannot be the name of one of this kind.
    """
    pattern, rule = _KINDS[kind]
    if not re.fullmatch(pattern, name):
        raise InputError(f"{source} '{name}': not a {kind}; {rule}")
    return name
