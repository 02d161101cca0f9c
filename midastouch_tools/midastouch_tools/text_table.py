"""Plain-text tables for the terminal."""

from __future__ import annotations

import shutil
import textwrap
from collections.abc import Iterable, Sequence

_NARROWEST = 20  # characters of a column that is wrapped


def text_table(header: list[str], rows: Iterable[Sequence[object]], left: int = 1) -> str:
    """Rows under a header, columns padded; the first `left` columns are aligned left, the others right.

    If a row does not fit into the terminal, the last column is wrapped between words, and all columns are aligned left.
    """
    cells = [[str(cell) for cell in row] for row in [header, *rows]]
    widths = [max(len(row[k]) for row in cells) for k in range(len(header))]
    room = shutil.get_terminal_size().columns - sum(w + 2 for w in widths[:-1])
    widths[-1] = min(widths[-1], max(room, _NARROWEST))
    between_words = textwrap.TextWrapper(widths[-1], break_long_words=False, break_on_hyphens=False)
    wrapped = [between_words.wrap(row[-1]) or [""] for row in cells]
    if any(len(parts) > 1 for parts in wrapped):
        left = len(header)
    lines = []
    for row, (first, *rest) in zip(cells, wrapped, strict=True):
        nothing = [""] * (len(row) - 1)
        lines += [_padded(line, widths, left) for line in ([*row[:-1], first], *([*nothing, part] for part in rest))]
    lines.insert(1, "  ".join("-" * w for w in widths))
    return "\n".join(lines)


def _padded(cells: list[str], widths: list[int], left: int) -> str:
    pairs = enumerate(zip(cells, widths, strict=True))
    return "  ".join(cell.ljust(w) if k < left else cell.rjust(w) for k, (cell, w) in pairs).rstrip()


def plural(noun: str) -> str:
    """Return the plural of an English noun."""
    return f"{noun}es" if noun.endswith(("ch", "ss")) else f"{noun}s"


def counted(count: int, noun: str) -> str:
    """Return a number with its noun in the singular or plural, such as "1 frame" or "2 touches"."""
    return f"{count} {noun if count == 1 else plural(noun)}"


def number(value: float | None) -> str:
    """Format `value` with one decimal; a dash for None or nan."""
    return "-" if value is None or value != value else f"{value:.1f}"
