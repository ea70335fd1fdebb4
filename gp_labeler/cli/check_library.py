"""The command ``gp-labeler check-library``: labels that contradict the other labelled scans."""

from __future__ import annotations

import argparse
import json
import sys
from collections.abc import Sequence
from pathlib import Path

from gp_core.command_line import CommandParser
from gp_core.disk import all_or_none, protected_inputs, write_text
from gp_core.standard_streams import shown_path, standard_streams
from gp_labeler.cli.propose import add_library_options, library_of, prepare

__all__ = ["make_check_library_parser", "run_check_library"]

_EXAMPLE = """examples:
  gp-labeler check-library labelled/
  gp-labeler check-library GP-0*.gpspecimen.json --json library.json --pictures library.pdf

Every labelled scan is predicted from the others. Labels that are far from their prediction, or fit better
under each other's names, are reported. The exit status is 1 if anything was found.
"""


def make_check_library_parser() -> argparse.ArgumentParser:
    """Return the parser of ``gp-labeler check-library``."""
    parser = CommandParser(
        prog="gp-labeler check-library",
        description="Find labels that contradict the other labelled scans.",
        epilog=_EXAMPLE,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.add_argument(
        "labelled", type=Path, nargs="+", metavar="LABELLED", help="labelled scans, or folders of them"
    )
    parser.add_argument("--json", type=Path, metavar="FILE", help="write the findings to this file")
    parser.add_argument(
        "--pictures",
        type=Path,
        metavar="PDF|DIR",
        help="draw each label that was found, and where it is expected: a .pdf file, or a folder for one "
        "file each",
    )
    add_library_options(parser)
    return parser


def run_check_library(arguments: Sequence[str]) -> int:
    """Predict every scan from the others, and say what does not agree.

    Returns
    -------
    int
        0; 1 where a label should be looked at.

    Raises
    ------
    GpError
        The labelled scans cannot be read, or there are fewer than three.
    """
    args = make_check_library_parser().parse_args(arguments)
    with standard_streams(args, {"json": ".json", "pictures": ".pdf"}, ("labelled",)):
        return _check(args)


def _check(args: argparse.Namespace) -> int:
    from gp_core.study.parallel import open_executor  # here: `--help` need not wait
    from gp_labeler.autolabel.cross_check import check_predictions, require_enough
    from gp_labeler.autolabel.registration import COARSER, engine_named
    from gp_labeler.autolabel.registration_process import HereRegistration
    from gp_labeler.jobs.library_sheet import draw_library_check

    engine = engine_named(args.engine)
    library = library_of(args.labelled, args)
    require_enough(library.scans)
    if engine == "demons":
        sys.stderr.write(f"gp-labeler: {COARSER}\n")
    with protected_inputs(args.labelled), open_executor(args.workers, args.scheduler) as executor:
        prepare(library, engine, executor)
        predictions = library.held_out(HereRegistration(engine))
        check = check_predictions(library.scans, predictions)
        with all_or_none():
            if args.json is not None:
                write_text(args.json, json.dumps(check.as_json(), indent=1) + "\n")
            drawn = (
                draw_library_check(check, library.scans, predictions, args.pictures) if args.pictures else ()
            )
    for name in check.checked:
        found = check.of(name)
        sys.stdout.write(f"{name}: {f'{len(found)} to review' if found else 'agrees with the others'}\n")
        sys.stdout.write("".join(f"  {finding.text}\n" for finding in found))
    for name in check.unchecked:
        sys.stdout.write(f"{name}: the head was not found, so its labels were not checked\n")
    if args.pictures:
        sys.stdout.write(f"pictures: {', '.join(map(shown_path, drawn)) or 'none: nothing to review'}\n")
    return 1 if check.findings else 0
