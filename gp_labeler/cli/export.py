"""The command ``gp-labeler export``: the landmark files of specimens, without a window."""

from __future__ import annotations

import argparse
import sys
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from gp_core.command_line import CommandParser
from gp_core.disk import all_or_none, protected_inputs
from gp_core.standard_streams import standard_streams

if TYPE_CHECKING:
    from gp_labeler.document.state import SpecimenState

__all__ = ["make_export_parser", "run_export"]

_EXAMPLE = """examples:
  gp-labeler export GP-014.gpspecimen.json -o landmarks
  gp-labeler export *.gpspecimen.json -o landmarks --suggested

Accepted ghosts that nobody has confirmed are suggestions, not observations: the landmark files leave them
out. --suggested writes them too, into <specimen>_L_suggested.mrk.json and _R_.
"""


def make_export_parser() -> argparse.ArgumentParser:
    """Return the parser of ``gp-labeler export``."""
    parser = CommandParser(
        prog="gp-labeler export",
        description="Write the landmarks of specimens as files for 3D Slicer and gp-core.",
        epilog=_EXAMPLE,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.add_argument("specimens", type=Path, nargs="+", metavar="SPECIMEN", help="a .gpspecimen.json file")
    parser.add_argument("-o", "--output", type=Path, required=True, metavar="DIR", help="where to write")
    parser.add_argument(
        "--format",
        action="append",
        metavar="SUFFIX",
        help=".mrk.json (the default), .fcsv or .csv; may be given several times",
    )
    parser.add_argument("--suggested", action="store_true", help="also write suggestions, to separate files")
    parser.add_argument("--measurements", action="store_true", help="also write rulers and angles")
    parser.add_argument("--replace", action="store_true", help="replace existing files")
    return parser


def run_export(arguments: Sequence[str]) -> int:
    """Read, write, and say what was written and what is missing.

    Raises
    ------
    GpError
        A specimen cannot be read, nothing is placed in it, or a file is there already or cannot be written.
    """
    args = make_export_parser().parse_args(arguments)
    with standard_streams(args, {}, ("specimens",), folders=("output",)):
        return _export(args)


def _export(args: argparse.Namespace) -> int:
    from gp_labeler.document.specimen_file import read_specimen  # here: `--help` need not wait

    states = [read_specimen(path) for path in args.specimens]
    with protected_inputs(args.specimens), all_or_none():
        lines = [line for state in states for line in _exported(state, args)]
    sys.stdout.writelines(f"{line}\n" for line in lines)
    return 0


def _exported(state: SpecimenState, args: argparse.Namespace) -> Iterator[str]:
    """Write the files of a specimen, and yield what was written and what is missing."""
    from gp_labeler.document.landmark_export import export_landmarks
    from gp_labeler.document.measurement_export import export_measurements

    report = export_landmarks(
        state,
        args.output,
        formats=tuple(args.format or (".mrk.json",)),
        overwrite=args.replace,
        suggested=args.suggested,
    )
    yield report.text
    if args.measurements and state.measurements:
        files = export_measurements(state, args.output, overwrite=args.replace)
        yield f"Wrote {', '.join(file.name for file in files)}."
