"""``gp-core draw``: landmark files and touches of animals that are drawn from an atlas."""

from __future__ import annotations

import argparse
from collections.abc import Iterator

from gp_core.atlas.atlas import Atlas
from gp_core.cli.options import Subparsers, add_command, say
from gp_core.cli.study_options import add_seed
from gp_core.disk import all_or_none, write_text
from gp_core.errors import GpError
from gp_core.landmarks.anatomy import modiolar_axis
from gp_core.study.drawn_labels import draw_labels, draw_touches

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
        "draw",
        run,
        summary="draw animals from an atlas, as landmark files or touches to learn with",
        example="gp-core draw -n 8 -o labelled/ --observers AB CD --rounds 2 --label-error 0.1",
    )
    parser.add_argument("-n", type=int, default=8, metavar="N", help="how many animals; default: 8")
    parser.add_argument("-o", "--output", metavar="DIR", help="folder for their landmark files")
    parser.add_argument("--atlas", metavar="FILE", help="an atlas file; default: the published atlas")
    parser.add_argument(
        "--observers", nargs="+", default=[], metavar="NAME", help="observers who label each animal"
    )
    parser.add_argument(
        "--rounds", type=int, default=1, metavar="N", help="how often each observer labels it; default: 1"
    )
    parser.add_argument(
        "--label-error",
        type=float,
        default=0.0,
        metavar="MM",
        help="SD of each coordinate of a label; default: 0",
    )
    parser.add_argument("--replace", action="store_true", help="replace existing files")
    parser.add_argument(
        "--csv",
        metavar="FILE",
        help="write touches of one more animal here: the paper's six features of its left ear, in a "
        "tracker's frame; its true cochlea is printed",
    )
    parser.add_argument(
        "--touch-error",
        type=float,
        default=0.1,
        metavar="MM",
        help="SD of each coordinate of a touch; default: 0.1",
    )
    add_seed(parser)


def run(args: argparse.Namespace) -> int:
    """Run ``gp-core draw``.

    Parameters
    ----------
    args : argparse.Namespace
        The parsed options.

    Returns
    -------
    int
        Exit status; see `gp_core.cli.entry.main`.

    Raises
    ------
    GpError
        Neither a folder nor a file was named.
    """
    if args.output is None and args.csv is None:
        raise GpError("there is nothing to write", remedy="Name a folder (-o DIR), or a file (--csv FILE).")
    atlas = Atlas.published() if args.atlas is None else Atlas.load(args.atlas)
    with all_or_none():
        lines = [
            *(_draw_labels(args, atlas) if args.output is not None else ()),
            *(_draw_touches(args, atlas) if args.csv is not None else ()),
        ]
    for line in lines:
        say(line)
    return 0


def _draw_labels(args: argparse.Namespace, atlas: Atlas) -> Iterator[str]:
    written = draw_labels(
        args.output,
        args.n,
        atlas=atlas,
        observers=args.observers,
        rounds=args.rounds,
        label_error_mm=args.label_error,
        seed=args.seed,
        overwrite=args.replace,
    )
    yield f"{len(written)} landmark files in {args.output}"


def _draw_touches(args: argparse.Namespace, atlas: Atlas) -> Iterator[str]:
    touches, truth = draw_touches(atlas=atlas, touch_error_mm=args.touch_error, seed=args.seed)
    points = ((code, touches[code]) for code in touches.placed)
    rows = (f"{code},{x:.3f},{y:.3f},{z:.3f}\n" for code, (x, y, z) in points)
    write_text(args.csv, "".join(rows))
    yield f"{len(touches.placed)} touches in {args.csv}; the cochlea truly has"
    yield "  origin CO     " + "".join(f"{v:11.3f}" for v in truth["CO"]) + " mm"
    axis = modiolar_axis(truth["CA"], truth["CB"])
    yield "  axis CB->CA   " + "".join(f"{v:11.4f}" for v in axis)
