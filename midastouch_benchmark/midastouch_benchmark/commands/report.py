"""`midastouch report`: result files as a page with tables, plots and pictures."""

from __future__ import annotations

import argparse

from midastouch_tools.commands import arguments


def add_parser(subparsers) -> None:
    """Add the sub-command."""
    parser = arguments.add_command(
        subparsers,
        "report",
        run,
        "turn result files into a page (HTML and Markdown) with tables, plots and pictures",
        "midastouch report out/drill.json out/bench.json --out out/report",
        "Takes the JSON files of every command that measures, several of each.",
    )
    parser.add_argument("results", nargs="+", metavar="JSON", help="result files")
    arguments.add_place(parser, "--out", "folder", "folder for index.html, index.md, pictures", required=True)


def run(args: argparse.Namespace) -> int:
    """Carry out the command."""
    from midastouch_tools.result_file import read_json

    from ..report.results_page import write_results_page

    page = write_results_page([(path, read_json(path)) for path in args.results], args.out)
    print(page)
    return 0
