"""The commands ``gp-labeler list`` and ``gp-labeler contact-sheet``: all specimens of some folders."""

from __future__ import annotations

import argparse
import json
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from gp_core.command_line import CommandParser
from gp_core.disk import protected_inputs, write_text
from gp_core.landmarks.features import Side
from gp_core.standard_streams import standard_streams

if TYPE_CHECKING:
    from gp_labeler.document.specimen_list import ListedSpecimen

__all__ = ["make_contact_sheet_parser", "make_list_parser", "run_contact_sheet", "run_list"]

_LIST_EXAMPLE = """examples:
  gp-labeler list scans/
  gp-labeler list scans/ --unfinished --json list.json
"""

_SHEET_EXAMPLE = """examples:
  gp-labeler contact-sheet GP-014.gpspecimen.json -o GP-014.pdf
  gp-labeler contact-sheet scans/ -o sheets/       one file for each specimen
  gp-labeler contact-sheet scans/ -o review.pdf    all in one file

A page for each side: every feature on its best slice and on the bone, with certainty, check and note.
Each scan is opened once, one at a time.
"""


def make_list_parser() -> argparse.ArgumentParser:
    """Return the parser of ``gp-labeler list``."""
    parser = CommandParser(
        prog="gp-labeler list",
        description="List the specimens in folders with their progress, and scans that are not begun. "
        "No scan is opened.",
        epilog=_LIST_EXAMPLE,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    what = "folders (searched with their subfolders), or .gpspecimen.json files"
    parser.add_argument("places", type=Path, nargs="+", metavar="DIR", help=what)
    parser.add_argument("--unfinished", action="store_true", help="list unfinished specimens only")
    parser.add_argument("--json", type=Path, metavar="FILE", help="write the list here")
    return parser


def run_list(arguments: Sequence[str]) -> int:
    """Print the list.

    Raises
    ------
    GpError
        A folder does not exist, or the file cannot be written.
    """
    args = make_list_parser().parse_args(arguments)
    with standard_streams(args, {"json": ".json"}, ("places",)):
        return _list(args)


def _list(args: argparse.Namespace) -> int:
    from gp_labeler.document.specimen_list import (  # here: `--help` need not wait
        list_specimens,
        progress_text,
    )

    rows = list_specimens(args.places)
    n = len(rows)
    shown = [row for row in rows if not (args.unfinished and row.is_finished)]
    if args.json is not None:
        with protected_inputs([row.path for row in rows]):
            write_text(args.json, json.dumps([row.as_dict() for row in shown], indent=1) + "\n")
    width = max((len(row.specimen) for row in shown), default=8)
    for row in shown:
        sys.stdout.write(f"{_line(row, width)}\n")
    sys.stdout.write(f"{n} specimen{'' if n == 1 else 's'}, {progress_text(rows)}\n")
    return 0


def _line(row: ListedSpecimen, width: int) -> str:
    if row.problem:
        return f"{row.specimen:<{width}}  cannot be read: {row.problem} ({row.path})"
    if not row.is_begun:
        return f"{row.specimen:<{width}}  not begun  {row.path}"
    sides = "  ".join(f"{side.word} {row.done(side):>2}/{_total()}" for side in Side)
    who = ", ".join(row.labellings[:3]) + (", …" if len(row.labellings) > 3 else "")
    scan = row.scan if row.scan_is_there or not row.scan else f"{row.scan} (not found)"
    return f"{row.specimen:<{width}}  {sides}  {row.changed[:10]}  {who}  {scan}".rstrip()


def _total() -> int:
    from gp_labeler.document.specimen_list import SIDE_TOTAL

    return SIDE_TOTAL


def make_contact_sheet_parser() -> argparse.ArgumentParser:
    """Return the parser of ``gp-labeler contact-sheet``."""
    parser = CommandParser(
        prog="gp-labeler contact-sheet",
        description="Make contact sheets of labelled specimens as PDF, for review.",
        epilog=_SHEET_EXAMPLE,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    what = ".gpspecimen.json files, or folders of them"
    parser.add_argument("specimens", type=Path, nargs="+", metavar="SPECIMEN", help=what)
    where = "a .pdf file for all, or a folder for one file each"
    parser.add_argument("-o", "--output", type=Path, required=True, metavar="PDF|DIR", help=where)
    every = "pages for each labelling of a specimen that was labelled several times, not only the one in work"
    parser.add_argument("--all-labellings", action="store_true", help=every)
    return parser


def run_contact_sheet(arguments: Sequence[str]) -> int:
    """Make the sheets, and say which specimens could not be opened: then the status is 1.

    Raises
    ------
    GpError
        There are no specimens, none could be opened, or a file cannot be written.
    """
    args = make_contact_sheet_parser().parse_args(arguments)
    with standard_streams(args, {"output": ".pdf"}, ("specimens",)):
        return _make_sheets(args)


def _make_sheets(args: argparse.Namespace) -> int:
    from gp_core.errors import GpError
    from gp_labeler.document.specimen_list import specimen_files
    from gp_labeler.jobs.contact_sheet import MakeContactSheets
    from gp_labeler.jobs.runner import Progress

    files = tuple(specimen_files(args.specimens))
    if not files:
        remedy = "Name another folder, or the files themselves."
        raise GpError("holds no specimens (*.gpspecimen.json)", file=args.specimens[0], remedy=remedy)
    with protected_inputs(files):
        job = MakeContactSheets(files, args.output, args.all_labellings)
        made = job.run(Progress(lambda fraction, text: None))
    sys.stdout.write(f"{made.lines[0]}\n")
    for line in made.problems:
        sys.stderr.write(f"gp-labeler: {line}\n")
    return 1 if made.problems else 0
