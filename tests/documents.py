"""The documents of the workspace: their text, tables, blocks of commands and calls of programs."""

from __future__ import annotations

import re
import shlex
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
DOCUMENTS = {
    path.relative_to(ROOT).as_posix(): path.read_text()
    for path in sorted([*ROOT.glob("*.md"), *ROOT.glob("docs/**/*.md"), *ROOT.glob("[!.]*/README.md")])
    if path.name != "CHANGELOG.md"  # which also names what is gone
}
ALL = "\n".join(DOCUMENTS.values())


def blocks(text: str, language: str = "") -> list[str]:
    """Contents of the fenced blocks in this language; without one: what is typed, or drawn."""
    found = re.findall(r"^```(\w*)\n(.*?)^```$", text, flags=re.M | re.S)
    return [content for of, content in found if of == language]


def lines(text: str) -> list[str]:
    """Of the blocks without a language."""
    return [line.strip() for block in blocks(text) for line in block.splitlines()]


LINES = lines(ALL)
SPANS = re.findall(r"`([^`\n]+)`", re.sub(r"^```.*?^```$", "", ALL, flags=re.M | re.S))


def section(document: str, heading: str) -> str:
    """From below a heading to the next one like it."""
    below = f"\n{DOCUMENTS[document]}".split(f"\n{heading}\n", 1)[1]
    return below.split(f"\n{heading.split()[0]} ", 1)[0]


def table(document: str, heading: str) -> list[list[str]]:
    """Cells of the first table under a heading, without its header."""
    rows = re.search(r"(?:^\|.*\n)+", section(document, heading), flags=re.M)[0].splitlines()[2:]
    return [[cell.strip() for cell in row.strip("|").split(" | ")] for row in rows]


def commands(program: str) -> list[list[str]]:
    """Arguments of every call of a program: in blocks, and in running text where it is more than a name."""
    calls = [shlex.split(line) for line in LINES] + [call for span in SPANS if len(call := span.split()) > 2]
    return [call[1:] for call in calls if call[:1] == [program]]
