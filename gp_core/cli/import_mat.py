"""``gp-core import-mat``: the authors' labelled sets as landmark files."""

from __future__ import annotations

import argparse

from gp_core.cli.options import (
    Subparsers,
    add_command,
    say,
)
from gp_core.io import import_mat

__all__ = ["add"]


def add(commands: Subparsers) -> None:
    """Add the command to the parser.

    Parameters
    ----------
    commands : Subparsers
        The subparsers of ``gp-core``, to which the command is added.
    """
    parser = add_command(
        commands,
        "import-mat",
        run,
        summary="convert the authors' labelled sets to landmark files",
        example="gp-core import-mat sets_L.mat sets_R.mat -o labelled/",
    )
    parser.add_argument("left", metavar="CC_L.mat", help="sets of the left side, variable cc_L")
    parser.add_argument("right", metavar="CC_R.mat", help="sets of the right side, variable cc_R")
    parser.add_argument("-o", "--output", required=True, metavar="DIR", help="folder to write to")
    parser.add_argument("--replace", action="store_true", help="replace existing files")


def run(args: argparse.Namespace) -> int:
    """Run ``gp-core import-mat``.

    Parameters
    ----------
    args : argparse.Namespace
        The parsed options.

    Returns
    -------
    int
        Exit status; see `gp_core.cli.entry.main`.
    """
    written = import_mat(args.left, args.right, args.output, overwrite=args.replace)
    say(f"{len(written)} landmark files in {args.output}")
    return 0
