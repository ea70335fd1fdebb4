"""``gp-core serve``: poses for programs in other languages, over HTTP on this machine."""

from __future__ import annotations

import argparse
import importlib
import sys
from contextlib import suppress

from gp_core.atlas.fitting import fit_atlas
from gp_core.cli.options import Subparsers, add_atlas, add_command, read_atlas, say
from gp_core.errors import blaming
from gp_core.service import DEFAULT_PORT, PoseService

__all__ = ["add"]


def add(commands: Subparsers) -> None:
    """Add the command to the parser.

    Parameters
    ----------
    commands : Subparsers
        The subparsers of ``gp-core``, to which the commands are added.
    """
    parser = add_command(
        commands,
        "serve",
        run,
        summary="answer requests of programs in other languages: touches in, poses out, on this machine only",
        example="gp-core serve --port 18950 &\n"
        '  curl -s --data \'{"side": "L", "touches": {...}}\' http://127.0.0.1:18950/estimate',
    )
    parser.add_argument(
        "--port",
        type=int,
        default=DEFAULT_PORT,
        metavar="N",
        help="port; default: %(default)s; 0: any free port, which the first line tells",
    )
    add_atlas(parser, more=", which also allow the method jrmpc", default=["published"])


def run(args: argparse.Namespace) -> int:
    """Run ``gp-core serve`` until Ctrl-C.

    Parameters
    ----------
    args : argparse.Namespace
        The parsed options.

    Returns
    -------
    int
        Exit status; see `gp_core.cli.entry.main`.
    """
    atlas, specimens = read_atlas(args.atlas)
    if atlas is None:
        with blaming(" ".join(args.atlas)):
            atlas = fit_atlas(specimens or [])
    with suppress(ImportError):  # without it the first answers take some milliseconds longer
        importlib.import_module("gp_core.registration.student_t_fit_compiled")
    service = PoseService(args.port, atlas=atlas, specimens=specimens or ())
    try:
        say(f"listening at {service.url}, atlas {atlas.name}; Ctrl-C ends it")
        sys.stdout.flush()
        service.wait()
    finally:
        service.close()
    return 0
