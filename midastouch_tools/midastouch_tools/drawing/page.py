"""A plain page of headings, tables, pictures and notes: as HTML with its style inside, and as Markdown."""

from __future__ import annotations

import html
import os
import re
from collections.abc import Sequence
from pathlib import Path

from midastouch_common.files import atomic_path

_STYLE = """
body { font: 15px/1.5 system-ui, sans-serif; color: #1d2127; margin: 2.5rem auto; max-width: 76rem;
  padding: 0 1.5rem }
h1 { font-size: 1.7rem } h2 { font-size: 1.2rem; margin-top: 2.2rem; border-bottom: 1px solid #e3e6ea }
table { border-collapse: collapse; margin: 1rem 0 } th, td { padding: .3rem .9rem; text-align: right }
th { border-bottom: 2px solid #c8ccd2; font-weight: 600 } tr:nth-child(even) td { background: #f6f7f9 }
th:first-child, td:first-child { text-align: left } td { overflow-wrap: anywhere }
figure { margin: 1.2rem 0 } img { max-width: 100%; height: auto } figcaption, p.note { color: #5b626d }
h1 + p.note { color: inherit }
pre { background: #f6f7f9; padding: .7rem 1rem; overflow-x: auto; font-size: 13px }
@media (max-width: 40rem) { body { margin: 1rem auto; padding: 0 .8rem } th, td { padding: .3rem .4rem } }
"""


class Page:
    """Page to which parts are added in order; `write` makes the file. Text is escaped, pictures are linked relative to
    the page."""

    def __init__(self, title: str):
        self._title = title
        self._html = [f"<h1>{html.escape(title)}</h1>"]
        self._markdown = [f"# {_plain(title)}"]

    def heading(self, text: str) -> None:
        """Add a section heading."""
        self._html.append(f"<h2>{html.escape(text)}</h2>")
        self._markdown.append(f"## {_plain(text)}")

    def note(self, text: str) -> None:
        """Add a paragraph: in grey, unless it opens the page."""
        self._html.append(f'<p class="note">{html.escape(text)}</p>')
        self._markdown.append(_plain(text))

    def code(self, text: str) -> None:
        """Add text in fixed width, such as a command."""
        self._html.append(f"<pre>{html.escape(text)}</pre>")
        self._markdown.append(f"```\n{text}\n```")

    def table(self, header: list[str], rows: Sequence[Sequence[object]]) -> None:
        """Add a table; the first column is aligned left, the others right."""
        head = "".join(f"<th>{html.escape(str(cell))}</th>" for cell in header)
        body = "".join("<tr>" + "".join(f"<td>{html.escape(str(c))}</td>" for c in row) + "</tr>" for row in rows)
        self._html.append(f"<table><tr>{head}</tr>{body}</table>")
        lines = [header, ["---"] + ["---:"] * (len(header) - 1), *rows]
        self._markdown.append("\n".join("| " + " | ".join(_plain(str(c)) for c in line) + " |" for line in lines))

    def picture(self, path: Path, caption: str) -> None:
        """Add a picture that lies in the folder of the page; a click shows it in full size."""
        text, name = html.escape(caption, quote=True), html.escape(path.name)
        image = f'<a href="{name}"><img src="{name}" alt="{text}"></a>'
        self._html.append(f"<figure>{image}<figcaption>{text}</figcaption></figure>")
        self._markdown.append(f"![{_plain(caption)}]({path.name})")

    def write(self, path: str | os.PathLike) -> Path:
        """Write the page as HTML; returns its path."""
        body = "\n".join(self._html)
        document = (
            '<!doctype html><html lang="en"><meta charset="utf-8">'
            '<meta name="viewport" content="width=device-width, initial-scale=1">'
            f"<title>{html.escape(self._title)}</title><style>{_STYLE}</style>{body}</html>\n"
        )
        with atomic_path(path) as temporary:
            temporary.write_text(document)
        return Path(path)

    def write_markdown(self, path: str | os.PathLike) -> Path:
        """Write the page as Markdown, which a repository shows; returns its path."""
        with atomic_path(path) as temporary:
            temporary.write_text("\n\n".join(self._markdown) + "\n")
        return Path(path)


def _plain(text: str) -> str:
    """Escape the characters of a text that Markdown would read as marks."""
    return re.sub(r"([\\`*_|<>\[\]#])", r"\\\1", text)
