"""Plain-text tables for the terminal."""

from __future__ import annotations


def text_table(header: list[str], rows: list[list[object]], left: int = 1) -> str:
    """Rows under a header, columns padded; the first `left` columns are aligned left, the others right."""
    cells = [[str(cell) for cell in row] for row in [header, *rows]]
    widths = [max(len(row[k]) for row in cells) for k in range(len(header))]
    lines = []
    for row in cells:
        padded = [
            cell.ljust(w) if k < left else cell.rjust(w) for k, (cell, w) in enumerate(zip(row, widths, strict=True))
        ]
        lines.append("  ".join(padded).rstrip())
    lines.insert(1, "  ".join("-" * w for w in widths))
    return "\n".join(lines)


def number(value: float | None, digits: int = 1) -> str:
    """`value` with `digits` decimals, a dash for None or nan."""
    return "-" if value is None or value != value else f"{value:.{digits}f}"
