"""Commands in the messages of the programs: what is to be pasted after a colon, or stands in backticks, works."""

import argparse
import ast
import re
import shlex
import sys

import packages
import pytest

from midastouch_common.missing_modules import EXTRAS, install_extra
from midastouch_tools.cli import add_commands, build_parser

# after a colon or "see ", or in backticks: to the end of the sentence
COMMAND = re.compile(r"(?:: |see |`|\n  )midastouch ([a-z][a-z-]*[^`;,()\n]*)")
NAME = re.compile(r"\bmidastouch ([a-z]+-[a-z-]*[a-z])")


def text(node: ast.AST) -> str:
    """Of a string, or of an f-string with a 1 for each value."""
    if isinstance(node, ast.Constant) and isinstance(node.value, str):
        return node.value
    if isinstance(node, ast.JoinedStr):
        return "".join(part.value if isinstance(part, ast.Constant) else "1" for part in node.values)
    return ""


def messages() -> list[tuple[str, str]]:
    """File and text of every string in the product code, docstrings among them."""
    found = []
    folders = [packages.ROOT / one / inner for one in packages.WITH_MODULES for inner in (one, "launch")]
    for path in sorted(path for folder in folders for path in folder.rglob("*.py")):
        tree = ast.parse(path.read_text())
        within = {id(part) for node in ast.walk(tree) if isinstance(node, ast.JoinedStr) for part in node.values}
        texts = [text(node) for node in ast.walk(tree) if id(node) not in within]
        found += [(path.relative_to(packages.ROOT).as_posix(), each) for each in texts if each]
    return found


MESSAGES = messages()


def test_every_hint_parses():
    parser, calls = build_parser(), set()
    for file, message in MESSAGES:
        calls |= {(file, call.strip().rstrip(".")) for call in COMMAND.findall(message)}
    calls = {(file, call) for file, call in calls if " " in call}  # a name alone is no call
    assert len(calls) > 10
    for file, call in sorted(calls):
        try:
            parser.parse_args(shlex.split(call))
        except SystemExit as exit_:
            if exit_.code:
                pytest.fail(f"{file}: midastouch {call}")


def test_every_command_that_is_mentioned_exists():
    sections = add_commands(argparse.ArgumentParser())
    mentioned = {name for _, message in MESSAGES for name in NAME.findall(message)}
    assert len(mentioned) > 10
    assert mentioned - {name for section in sections for name in section.parsers} == set()


def test_every_list_of_requirements_is_there():
    for name, distributions in EXTRAS.items():
        file = packages.ROOT / "tools" / "requirements" / f"{name}.txt"
        assert install_extra(name) == f"{sys.executable} -m pip install -r {file}"
        assert {line.split("==")[0] for line in file.read_text().splitlines() if "==" in line} == set(distributions)
    # no message says "pip install" on its own
    assert [file for file, message in MESSAGES if "pip install" in message] == []
