"""Comments of messages: each field has one, each number its unit, and docs and code say the same."""

import re

import pytest
from documents import ROOT, table

from midastouch_filter.active_touch.suggestion import Suggestion
from midastouch_filter.core.state import Status

UNITS = {"m", "m^2", "rad", "s", "ms", "nats", "count", "fraction, 0 to 1", "unit vector"}
POSE_UNITS = "m, quaternion"
FILES = sorted((ROOT / "midastouch_msgs").glob("*/*.*"))
ALIASES = {"spread_translation": "spread_t", "spread_rotation": "spread_r"}
"""Fields of FilterStatus that are called otherwise in `Status`."""


def fields(text: str) -> list[tuple[str, str, str]]:
    """(type, name, comment directly above) of every field; constants are none."""
    found, comment = [], []
    for line in text.splitlines():
        if line.startswith("#"):
            comment.append(line[1:].strip())
            continue
        if match := re.fullmatch(r"([\w/]+)(?:\[\d*\])? (\w+)", line):
            found.append((match[1], match[2], " ".join(comment)))
        comment = []
    return found


def units(comment: str) -> list[str]:
    return re.findall(r"\[([^\]]+)\]", comment)


def numbers() -> dict[tuple[str, str], str]:
    """Unit by (message, field)."""
    return {
        (path.stem, name): units(comment)[0]
        for path in FILES
        for kind, name, comment in fields(path.read_text())
        if re.match(r"u?int|float", kind)
    }


@pytest.mark.parametrize("path", FILES, ids=lambda path: path.name)
def test_every_field_says_what_it_is_and_every_number_its_unit(path):
    found = fields(path.read_text())
    assert found
    for kind, name, comment in found:
        assert comment, f"{name} has no comment"
        if re.match(r"u?int|float", kind):
            assert units(comment)[:1], f"{name} has no unit; say it in brackets, as [m]"
            assert units(comment)[0] in UNITS, name
        if kind.startswith("geometry_msgs/Pose"):
            assert POSE_UNITS in units(comment), f"{name}: [{POSE_UNITS}]"


def test_the_table_of_numbers_has_the_same_units():
    rows = table("docs/interfaces.md", "## Numbers in messages")
    listed = {
        (message.strip("`"), field): unit for message, names, unit, _ in rows for field in re.findall(r"`(\w+)`", names)
    }
    assert listed == numbers()


@pytest.mark.parametrize(("message", "filled_from"), [("FilterStatus", Status), ("Suggestion", Suggestion)])
def test_units_are_those_of_what_the_filter_sends(message, filled_from):
    sent = dict(re.findall(r"(\w+) : \[([\w^]+)\]", filled_from.__doc__))
    assert len(sent) >= 3
    of_message = {ALIASES.get(name, name): unit for (of, name), unit in numbers().items() if of == message}
    assert {name: of_message[name] for name in sent} == sent
