"""Words that the field has others for do not come back: in names, comments and docstrings of product code, in docs.

Names of commands, keys of files and aliases of parameters keep theirs: strings, and what stands in backticks, are not
looked at.
"""

import ast
import io
import re
import tokenize
from pathlib import Path

import pytest
from documents import DOCUMENTS, ROOT

BANNED = {
    "hindsight": "comparison",
    "mend": "fix",
    "misfit": "residual ratio",
    "peer": "baseline",
    "relief": "penetration map",
    "rival": "competitor, competing hypothesis",
    "stock": "cache",
    "strain": "squared Mahalanobis innovation",
    "unrivalled": "unchallenged",
    "untold": "unreported",
}
"""Word: what to say instead."""
BANNED_AS_NAMES = BANNED | {
    "feel": "measure",
    "felt": "measured",
    "patience": "timeout",
    "reflect": "deferred update",
    "share": "fraction",
    "told": "reported",
    "twin": "symmetric pose, alike object",
}
"""The same for names in Python; plain English has other uses for these words."""
BANNED_IN_THE_FILTER = BANNED_AS_NAMES | {"place": "hypothesis; of points: position, point"}
BANNED_CONSTANTS = {"ASKED", "HELD", "SAID", "TOLD"}
"""Whole names of constants; say what they limit, with the unit."""
OTHER_MEANINGS = {
    "SHARE", "FindPackageShare", "get_package_share_directory", "get_package_share_path",  # of ROS
    "_reflect",  # at an edge
    "column_shares", "row_shares",  # of Rerun's layouts
}  # fmt: skip
ENDINGS = ("", "s", "ed", "ing", "es")
FOLDERS = [*(path.parent for path in ROOT.glob("*/package.xml")), ROOT / "examples", ROOT / "tools"]
SOURCES = sorted(
    path
    for folder in FOLDERS
    for path in folder.rglob("*")
    if path.suffix in {".py", ".cpp", ".hpp", ".h", ".msg", ".srv", ".action"}
    and not {"test", "build"} & {*path.relative_to(ROOT).parts}
)


def base_word(word: str, banned: dict[str, str]) -> str | None:
    """The banned word that this is a form of."""
    return next((known for known in banned for ending in ENDINGS if word.lower() == known + ending), None)


def in_text(text: str) -> list[tuple[int, str]]:
    """(line, word) of what is banned in prose; backticks quote names, which have reasons of their own."""
    blank = re.sub(
        r"```.*?```|`[^`]*`|<!--.*?-->|\[\w+\]\([^)]*\.json\)|\]\([^)]*\)",
        lambda span: re.sub(r"[^\n]", " ", span[0]),
        text,
        flags=re.S,
    )
    return [
        (number, word)
        for number, line in enumerate(blank.splitlines(), start=1)
        for word in re.findall(r"[A-Za-z]+", line)
        if base_word(word, BANNED)
    ]


def in_name(name: str, banned: dict[str, str]) -> list[str]:
    """Parts of a name, in snake_case or CamelCase, that are banned."""
    if name in OTHER_MEANINGS:
        return []
    if name.strip("_") in BANNED_CONSTANTS:
        return [name]
    parts = [part for each in name.split("_") for part in re.findall(r"[A-Z]?[a-z]+|[A-Z]+(?![a-z])", each)]
    return [part for part in parts if base_word(part, banned)]


def in_python(source: str, banned: dict[str, str] = BANNED_AS_NAMES) -> list[tuple[int, str]]:
    """(line, word) of what is banned in names, comments and docstrings; other strings are not looked at."""
    found = []
    for token in tokenize.generate_tokens(io.StringIO(source).readline):
        if token.type == tokenize.NAME:
            found += [(token.start[0], f"{token.string} ({part})") for part in in_name(token.string, banned)]
        elif token.type == tokenize.COMMENT:
            found += [(token.start[0], word) for _, word in in_text(token.string)]
    for statement in ast.walk(ast.parse(source)):
        # docstrings, of attributes too
        if isinstance(statement, ast.Expr) and isinstance(statement.value, ast.Constant):
            value = statement.value
            if isinstance(value.value, str):
                found += [(value.lineno + line - 1, word) for line, word in in_text(value.value)]
    return sorted(found)


def in_other_code(source: str) -> list[tuple[int, str]]:
    """(line, word) of what is banned in C++ and messages, names and comments alike."""
    without_strings = re.sub(r'"(?:[^"\\\n]|\\.)*"', '""', source)
    return in_text(re.sub(r"_", " ", without_strings))


def offences(path: Path) -> list[str]:
    source, name = path.read_text(), path.relative_to(ROOT).as_posix()
    banned = BANNED_IN_THE_FILTER if name.startswith("midastouch_filter/") else BANNED_AS_NAMES
    found = in_python(source, banned) if path.suffix == ".py" else in_other_code(source)
    return [f"{name}:{line}: {word}" for line, word in found]


@pytest.mark.parametrize("folder", sorted({path.relative_to(ROOT).parts[0] for path in SOURCES}))
def test_code_uses_the_words_of_the_field(folder):
    found = [each for path in SOURCES if path.relative_to(ROOT).parts[0] == folder for each in offences(path)]
    assert not found, "\n".join([*found, f"say instead: {BANNED_IN_THE_FILTER}"])


@pytest.mark.parametrize("document", DOCUMENTS)
def test_documents_use_the_words_of_the_field(document):
    """But for generated tables, which quote committed reports."""
    text = DOCUMENTS[document]
    written = re.sub(r"<!-- table .*?<!-- end -->", lambda one: "\n" * one[0].count("\n"), text, flags=re.S)
    found = [f"{document}:{line}: {word}" for line, word in in_text(written)]
    assert not found, "\n".join([*found, f"say instead: {BANNED}"])


def test_a_banned_word_is_found_wherever_it_stands():
    code = """'''A misfit.'''
_HELD = 1  # of the rivals
class Relief:
    feltDepth = "untold"
    '''`relief_fit` is old.'''
"""
    names = [(2, "_HELD (_HELD)"), (3, "Relief (Relief)"), (4, "feltDepth (felt)")]
    assert in_python(code) == sorted([(1, "misfit"), (2, "rivals"), *names])
    assert in_other_code("float rival_pose;  // mended\nconstraint()") == [(1, "rival"), (1, "mended")]
    assert in_text("A stock of `peers`,\nunmentioned [hindsight](hindsight.md).") == [(1, "stock"), (2, "hindsight")]
