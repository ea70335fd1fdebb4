"""``gp-core estimate``: touched points in, the pose of the cochlea out."""

from __future__ import annotations

import argparse
from collections.abc import Iterator
from pathlib import Path

import numpy as np

from gp_core.atlas.pose import METHODS, CochleaPose, estimate_pose
from gp_core.commands.options import Subparsers, add_command, add_json, read_atlas, save_json, say
from gp_core.errors import GpError
from gp_core.landmarks.files import read_touches

__all__ = ["add", "pose_table"]


def add(commands: Subparsers) -> None:
    """Add the command."""
    parser = add_command(
        commands,
        "estimate",
        run,
        summary="estimate the pose of a cochlea from a few touched points",
        example="gp-core estimate touches.dat --side R --json pose.json",
    )
    parser.add_argument(
        "touches", metavar="TOUCHES", help=".dat, .csv, .mrk.json or .fcsv with three or more touches"
    )
    parser.add_argument("--side", required=True, choices=("L", "R"), help="side of the head")
    parser.add_argument(
        "--atlas",
        nargs="+",
        default=["published"],
        metavar="ATLAS",
        help="published (default), an atlas file, or landmark files of labelled animals",
    )
    parser.add_argument("--method", choices=METHODS, default="robust", help="default: robust")
    parser.add_argument(
        "--probe-noise",
        type=float,
        metavar="MM",
        help="error of an ordinary touch; default: found from the touches",
    )
    add_json(parser)
    parser.add_argument("--tfm", metavar="FILE", help="write the pose as an ITK / Slicer transform here")


def run(args: argparse.Namespace) -> int:
    """Estimate, print, and write what was asked for."""
    touches = read_touches(args.touches, args.side)
    atlas, specimens = read_atlas(args.atlas)
    try:
        pose = estimate_pose(
            touches, args.side, atlas, method=args.method, specimens=specimens, probe_noise=args.probe_noise
        )
    except GpError as error:
        raise type(error)(
            error.problem, file=error.file or args.touches, landmark=error.landmark, remedy=error.remedy
        ) from None
    save_json(args.json, pose.as_dict())
    if args.tfm:
        pose.save_tfm(args.tfm)
    for line in pose_table(pose, Path(args.touches).name):
        say(line)
    if touches.unseen:
        say(f"  not seen by the tracker: {' '.join(sorted(touches.unseen))}")
    return 0


def pose_table(pose: CochleaPose, source: str) -> Iterator[str]:
    """Yield the lines of a short readable table."""
    yield f"Cochlea from {source}, {pose.side.word} side, method {pose.method}, atlas {pose.atlas}"
    yield ""
    x, y, z = pose.origin
    yield f"  origin CO     {x:10.3f} {y:10.3f} {z:10.3f} mm   95 % within {pose.radius_95:.2f} mm"
    x, y, z = pose.axis
    yield f"  axis CB->CA   {x:10.4f} {y:10.4f} {z:10.4f}      95 % within {np.degrees(pose.cone_95):.1f} deg"
    yield ""
    yield "  touch   from the mean, mm"
    for code, distance in pose.residuals.items():
        yield f"  {code:<7} {distance:6.2f}{'   doubtful' if code in pose.suspects else ''}"
    for warning in pose.warnings:
        yield f"  ! {warning}"
